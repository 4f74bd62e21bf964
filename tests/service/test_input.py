"""What a lever's frames are worth: sequence, checksum, silence."""

from collections.abc import Callable
from functools import reduce
from operator import xor
from typing import Any, Protocol

import pytest
from crccheck.crc import Crc8Autosar, Crc8SaeJ1850

from canshaper.can.frame import Frame, FrameFault
from canshaper.service.controller import Controller
from canshaper.shaping.states import State

# timeout_ms of the shipped levers, 100 ms: the last frame counts in so many ticks after its own.
FRESH_TICKS = 5
CHECK_AT = 6
LEFT = "    alive_counter: AliveCounter\n  right:"
ALL = "    alive_counter: AliveCounter\n"
CHECK = {
    ' SG_ Reset : 36|2@1+ (1,0) [0|1] "" SHAPER\n': (
        ' SG_ Reset : 36|2@1+ (1,0) [0|1] "" SHAPER\n SG_ Check : 48|8@1+ (1,0) [0|255] "" SHAPER\n'
    )
}


class Rig(Protocol):
    controller: Controller
    counts: dict[str, int]

    def lever(self, name: str = ..., **raw: int) -> Frame: ...
    def receive(self, *frames: Frame) -> None: ...
    def tick(self, missed: int = ...) -> dict[str, dict[str, Any]]: ...
    def run(self, ticks: int = ..., **raw: int) -> dict[str, dict[str, Any]]: ...
    def moving(self) -> "Rig": ...
    def state(self, axis: str = ...) -> State: ...
    def reason(self, axis: str = ...) -> str: ...
    def count(self, name: str) -> int: ...


Make = Callable[..., Rig]


def command(rig: Rig) -> float:
    return rig.controller.axes["slew"].axis.command


def velocity(sent: dict[str, dict[str, Any]]) -> float:
    return float(sent["SlewCommand"]["Velocity"])


def last_fault(rig: Rig) -> FrameFault:
    return rig.controller.counters.last_fault


def feed(rig: Rig, *frames: Frame) -> dict[str, dict[str, Any]]:
    """These frames of the left lever, a good one of the right, and a tick."""
    rig.receive(*frames, rig.lever("LeverRight"))
    return rig.tick()


def skip(rig: Rig, counts: int) -> None:
    """The left lever's counter runs on unseen; the next frame is ``counts`` + 1 after the last."""
    rig.counts["LeverLeft"] += counts


# -- sequence --------------------------------------------------------------------------------------


@pytest.mark.parametrize("silence", [0, 1, 4, 5, 6, 7, 20])
def test_a_frozen_counter_never_counts_again_however_long_it_was_silent(
    rig: Rig, silence: int
) -> None:
    """A gateway that repeats its last frame for ever, with pauses: the lever behind it is gone."""
    rig.run(5)
    frozen = rig.lever()
    for _ in range(3):
        for _ in range(15):
            feed(rig, frozen)
        assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "STICK_UNTRUSTED")
        for _ in range(silence):
            feed(rig)
            assert rig.state() is State.NEUTRAL_WAIT
    feed(rig, rig.lever())
    assert rig.state() is State.READY


def test_a_frozen_counter_stops_what_moves_through_the_filter(rig: Rig) -> None:
    rig.moving()
    frozen = rig.lever(Slew=1000)
    feed(rig, frozen)
    for _ in range(FRESH_TICKS):
        assert velocity(feed(rig, frozen)) > 50
        assert rig.state() is State.ACTIVE
    assert velocity(feed(rig, frozen)) > 50
    assert (rig.state(), rig.reason()) == (State.STOPPING, "STICK_UNTRUSTED")
    assert last_fault(rig) is FrameFault.COUNTER_REPEATED
    assert rig.count("InvalidSignals") == FRESH_TICKS + 1


@pytest.mark.parametrize("counter", [0, 3, 77, 255])
def test_a_lever_that_was_switched_off_may_begin_with_any_counter(rig: Rig, counter: int) -> None:
    rig.run(5)
    for _ in range(FRESH_TICKS + 1):
        feed(rig)
    assert rig.reason() == "STICK_TIMEOUT"
    rig.counts["LeverLeft"] = counter - 1
    feed(rig, rig.lever())
    assert rig.state() is State.READY
    assert rig.count("InvalidSignals") == 0
    feed(rig, rig.lever())
    assert rig.state() is State.READY


def test_a_jump_without_silence_is_refused_and_the_next_frame_counts(rig: Rig) -> None:
    rig.moving()
    skip(rig, 3)
    feed(rig, rig.lever(Slew=0))
    assert command(rig) == 1.0
    assert rig.state() is State.ACTIVE
    assert (rig.count("InvalidSignals"), last_fault(rig)) == (1, FrameFault.COUNTER_JUMP)
    feed(rig, rig.lever(Slew=200))
    assert command(rig) == pytest.approx(0.2)
    assert rig.count("InvalidSignals") == 1


@pytest.mark.parametrize("lost", [1, 2])
def test_a_few_lost_frames_are_no_jump(rig: Rig, lost: int) -> None:
    rig.moving()
    for _ in range(lost):
        rig.lever()
        feed(rig)
    feed(rig, rig.lever(Slew=200))
    assert command(rig) == pytest.approx(0.2)
    assert rig.count("InvalidSignals") == 0


def test_jumps_without_end_are_no_lever(rig: Rig) -> None:
    """Two senders of one id, each with a counter of its own."""
    rig.moving()
    for tick in range(FRESH_TICKS + 2):
        rig.counts["LeverLeft"] = 100 * (tick % 2) + tick
        feed(rig, rig.lever(Slew=1000))
    assert (rig.state(), rig.reason()) == (State.STOPPING, "STICK_UNTRUSTED")


@pytest.mark.parametrize("qualify", [2, 5])
def test_so_many_good_frames_are_needed_after_a_wrong_one(changed_rig: Make, qualify: int) -> None:
    rig = changed_rig({LEFT: LEFT.replace("\n  right", f"\n    qualify: {qualify}\n  right")})
    for _ in range(qualify - 1):
        feed(rig, rig.lever())
        assert rig.state() is State.NEUTRAL_WAIT
    feed(rig, rig.lever())
    assert rig.state() is State.READY
    feed(rig, rig.lever(Slew=1000))
    assert command(rig) == 1.0
    skip(rig, 10)
    for _ in range(qualify):
        feed(rig, rig.lever(Slew=200))
        assert command(rig) == 1.0
    feed(rig, rig.lever(Slew=200))
    assert command(rig) == pytest.approx(0.2)


@pytest.mark.parametrize("silent", [True, False])
def test_silence_is_not_distrust(rig: Rig, silent: bool) -> None:
    """The reason tells whom to ask: nothing comes, or what comes is wrong."""
    rig.run(5)
    frozen = rig.lever()
    for _ in range(FRESH_TICKS + 2):
        if silent:
            feed(rig)
        else:
            feed(rig, frozen)
    assert rig.reason() == ("STICK_TIMEOUT" if silent else "STICK_UNTRUSTED")
    for _ in range(FRESH_TICKS + 1):  # what was refused is forgotten as what was accepted is
        feed(rig)
    assert rig.reason() == "STICK_TIMEOUT"


# -- an enable seen released -----------------------------------------------------------------------


@pytest.mark.parametrize("wrong", ["repeated", "jump"])
def test_a_released_enable_in_a_frame_out_of_sequence_stops_at_once(rig: Rig, wrong: str) -> None:
    rig.moving()
    skip(rig, -1 if wrong == "repeated" else 100)
    sent = feed(rig, rig.lever(Slew=1000, Enable=0))
    assert velocity(sent) == 0
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ENABLE_LOST")
    for _ in range(20):  # frozen: nothing in it counts
        sent = feed(rig, rig.lever(Slew=1000, Enable=1, AliveCounter=rig.counts["LeverLeft"]))
        skip(rig, -1)
        assert velocity(sent) == 0
    assert rig.state() is State.TRIPPED


def test_a_released_enable_stays_released_until_a_frame_counts(rig: Rig) -> None:
    rig.run(3)
    assert rig.state() is State.READY
    number = rig.counts["LeverLeft"]
    feed(rig, rig.lever(AliveCounter=number, Enable=0))
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "ENABLE_OFF")
    feed(rig, rig.lever(AliveCounter=number))
    assert rig.reason() == "ENABLE_OFF"
    rig.counts["LeverLeft"] = number
    feed(rig, rig.lever())
    assert rig.state() is State.READY


def test_only_off_is_released(rig: Rig) -> None:
    """An error code out of sequence is no news: it neither stops nor enables."""
    rig.moving()
    number = rig.counts["LeverLeft"]
    for enable in (1, 2, 3):
        feed(rig, rig.lever(Slew=1000, AliveCounter=number, Enable=enable))
        assert rig.state() is State.ACTIVE


# -- checksum --------------------------------------------------------------------------------------

KINDS: dict[str, Callable[[bytes], int]] = {
    "xor": lambda data: reduce(xor, data),
    "sum": lambda data: sum(data) % 256,
    "crc8_sae_j1850": Crc8SaeJ1850.calc,
    "crc8_autosar": Crc8Autosar.calc,
}


class Protected:
    """A rig whose levers carry a checksum, made by the library."""

    def __init__(self, make: Make, kind: str = "crc8_sae_j1850") -> None:
        line = f"    checksum: {{ signal: Check, kind: {kind} }}\n"
        self.rig = make({ALL: ALL + line}, CHECK)
        self._calculate = KINDS[kind]

    def frame(self, name: str = "LeverLeft", *, error: int = 0, **raw: int) -> Frame:
        frame = self.rig.lever(name, Check=0, **raw)
        data = bytearray(frame.data)
        data[CHECK_AT] = error ^ self._calculate(bytes(data[:CHECK_AT] + data[CHECK_AT + 1 :]))
        return frame._replace(data=bytes(data))

    def run(self, ticks: int = 1, *, error: int = 0, **raw: int) -> dict[str, dict[str, Any]]:
        sent: dict[str, dict[str, Any]] = {}
        for _ in range(ticks):
            self.rig.receive(self.frame(error=error, **raw), self.frame("LeverRight"))
            sent = self.rig.tick()
        return sent


@pytest.mark.parametrize("kind", KINDS)
def test_a_lever_with_a_right_checksum_drives(changed_rig: Make, kind: str) -> None:
    protected = Protected(changed_rig, kind)
    protected.run(3)
    assert velocity(protected.run(50, Slew=1000)) > 50
    assert protected.rig.count("InvalidSignals") == 0


@pytest.mark.parametrize("kind", KINDS)
def test_a_lever_with_a_wrong_checksum_never_arms(changed_rig: Make, kind: str) -> None:
    protected = Protected(changed_rig, kind)
    protected.run(20, error=1)
    rig = protected.rig
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "STICK_UNTRUSTED")
    assert (rig.count("InvalidSignals"), last_fault(rig)) == (20, FrameFault.CHECKSUM)
    assert rig.state("lift") is State.READY  # the other lever is right


def test_nothing_in_a_frame_with_a_wrong_checksum_is_believed(changed_rig: Make) -> None:
    """Not the stick, not even a released enable: any bit of it may be the wrong one."""
    protected = Protected(changed_rig)
    protected.run(3)
    protected.run(50, Slew=1000)
    rig = protected.rig
    for _ in range(FRESH_TICKS):
        protected.run(1, error=0x80, Slew=-1000, Enable=0, AntiSwayOff=1)
        assert rig.state() is State.ACTIVE
        assert command(rig) == 1.0
    protected.run(1, error=0x80, Enable=0)
    assert (rig.state(), rig.reason()) == (State.STOPPING, "STICK_UNTRUSTED")


def test_one_wrong_checksum_costs_one_frame(changed_rig: Make) -> None:
    protected = Protected(changed_rig)
    protected.run(3)
    protected.run(50, Slew=1000)
    protected.run(1, error=1, Slew=300)
    assert command(protected.rig) == 1.0
    protected.run(1, Slew=300)
    assert command(protected.rig) == pytest.approx(0.3)
    assert protected.rig.count("InvalidSignals") == 1
