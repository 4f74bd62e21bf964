"""A joystick whose frames carry a checksum: a right one, a wrong one."""

from typing import Any

import pytest

from canshaper.checksums.kinds import CHECKSUMS
from canshaper.codec.frame import Frame, FrameFault
from canshaper.shaping.states import State
from tests.codec.checksum_reference import PLACES, with_checksum
from tests.rigs.forwarder import Make, command, last_fault, velocity

# timeout_ms of the shipped joysticks, 100 ms: the last frame counts in so many ticks after its own.
FRESH_TICKS = 5
ALL = "    alive_counter: AliveCounter\n"
RESET = ' SG_ Reset : 36|2@1+ (1,0) [0|1] "" SHAPER\n'


class Protected:
    """A rig whose joysticks carry a checksum, made by the reference."""

    def __init__(self, make: Make, kind: str = "crc8_sae_j1850") -> None:
        line = f"    checksum: {{ signal: Check, kind: {kind} }}\n"
        self._kind, self._bits = kind, CHECKSUMS[kind].bits
        check = f' SG_ Check : {PLACES[self._bits]} (1,0) [0|1] "" SHAPER\n'
        self.rig = make({ALL: ALL + line}, {RESET: RESET + check})

    def frame(self, name: str = "JoystickLeft", *, error: int = 0, **raw: int) -> Frame:
        frame = self.rig.joystick(name, Check=0, **raw)
        data = with_checksum(self._kind, self._bits, frame.can_id, frame.data)
        wrong = data[:6] + bytes((data[6] ^ error,)) + data[7:]  # each has a bit in byte 6
        return frame._replace(data=wrong)

    def run(self, ticks: int = 1, *, error: int = 0, **raw: int) -> dict[str, dict[str, Any]]:
        sent: dict[str, dict[str, Any]] = {}
        for _ in range(ticks):
            self.rig.receive(self.frame(error=error, **raw), self.frame("JoystickRight"))
            sent = self.rig.tick()
        return sent


@pytest.mark.parametrize("kind", CHECKSUMS)
def test_a_joystick_with_a_right_checksum_drives(changed_rig: Make, kind: str) -> None:
    protected = Protected(changed_rig, kind)
    protected.run(3)
    assert velocity(protected.run(50, Slew=1000)) > 50
    assert protected.rig.count("InvalidSignals") == 0


@pytest.mark.parametrize("kind", CHECKSUMS)
def test_a_joystick_with_a_wrong_checksum_never_arms(changed_rig: Make, kind: str) -> None:
    protected = Protected(changed_rig, kind)
    protected.run(20, error=1)
    rig = protected.rig
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "JOYSTICK_UNTRUSTED")
    assert (rig.count("InvalidSignals"), last_fault(rig)) == (20, FrameFault.CHECKSUM)
    assert rig.state("lift") is State.READY  # the other joystick is right


def test_nothing_in_a_frame_with_a_wrong_checksum_is_believed(changed_rig: Make) -> None:
    """Not the joystick, not even a released enable: any bit of it may be the wrong one."""
    protected = Protected(changed_rig)
    protected.run(3)
    protected.run(50, Slew=1000)
    rig = protected.rig
    for _ in range(FRESH_TICKS):
        protected.run(1, error=0x80, Slew=-1000, Enable=0, AntiSwayOff=1)
        assert rig.state() is State.ACTIVE
        assert command(rig) == 1.0
    protected.run(1, error=0x80, Enable=0)
    assert (rig.state(), rig.reason()) == (State.STOPPING, "JOYSTICK_UNTRUSTED")


def test_one_wrong_checksum_costs_one_frame(changed_rig: Make) -> None:
    protected = Protected(changed_rig)
    protected.run(3)
    protected.run(50, Slew=1000)
    protected.run(1, error=1, Slew=300)
    assert command(protected.rig) == 1.0
    protected.run(1, Slew=300)
    assert command(protected.rig) == pytest.approx(0.3)
    assert protected.rig.count("InvalidSignals") == 1
