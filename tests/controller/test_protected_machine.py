"""A machine whose every message is protected by AUTOSAR E2E; its headers by the library."""

import struct
from pathlib import Path

import pytest
from crccheck.crc import Crc8Autosar, Crc8SaeJ1850

from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.shaping.states import State
from tests.machine.protected_machine import IDS, load

TICK_NS = 20_000_000
JOYSTICK, STOP = 272, 64
BOTH, NIBBLE = b"\x23\x01", b"\x42\x00"


def p01(included: bytes, count: int, top: int, body: bytes) -> bytes:
    """A frame of profile 1 with these bytes of the data ID in its CRC."""
    rest = bytes([top << 4 | count]) + body
    return bytes([Crc8SaeJ1850.calc(included + rest, initvalue=0) ^ 0xFF]) + rest


class Rig:
    """A controller and everything that is sent to it."""

    def __init__(self, directory: Path, *changes: tuple[str, str]) -> None:
        self.controller = Controller(load(directory, *changes))
        self.now_ns = 0
        self.count = 0

    def frame(self, can_id: int, data: bytes) -> FrameFault:
        """Give it a frame; what was wrong with it."""
        self.controller.counters.last_fault = FrameFault.NONE
        self.controller.receive(Frame("crane", can_id, False, data), self.now_ns)
        return self.controller.counters.last_fault

    def joystick(self, slew: int = 0, enable: int = 1, included: bytes = BOTH) -> bytes:
        body = struct.pack("<h", slew) + struct.pack(">h", 0) + bytes([enable, 0])
        return p01(included, self.count, 0, body)

    def stop(self, pressed: int = 0, top: int = 0xA) -> bytes:
        return p01(NIBBLE, self.count, top, bytes([pressed]))

    def tick(self) -> list[Frame]:
        frames = list(self.controller.tick(self.now_ns))
        self.now_ns += TICK_NS
        self.count = (self.count + 1) % 15
        return frames

    def run(self, ticks: int, slew: int = 0) -> list[Frame]:
        sent = []
        for _ in range(ticks):
            assert self.frame(JOYSTICK, self.joystick(slew)) is FrameFault.NONE
            assert self.frame(STOP, self.stop()) is FrameFault.NONE
            sent += self.tick()
        return sent

    @property
    def axis(self) -> tuple[State, str]:
        axis = self.controller.axes["slew"].axis
        return axis.state, axis.reason.name


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    return Rig(tmp_path)


def test_a_joystick_with_its_header_drives_and_needs_no_more_than_qualify(rig: Rig) -> None:
    rig.run(1)
    assert rig.axis[0] is State.NEUTRAL_WAIT
    rig.run(1)
    assert rig.axis[0] is State.READY
    rig.run(40, slew=1000)
    assert rig.axis[0] is State.ACTIVE
    assert rig.controller.axes["slew"].axis.demand == 1.0


@pytest.mark.parametrize("included", [b"\x24\x01", b"\x23\x00", b"\x01\x23", b"\x23", b""])
def test_a_joystick_with_another_data_id_never_arms(rig: Rig, included: bytes) -> None:
    for _ in range(20):
        rig.frame(STOP, rig.stop())
        assert rig.frame(JOYSTICK, rig.joystick(included=included)) is FrameFault.CHECKSUM
        rig.tick()
    assert rig.axis == (State.NEUTRAL_WAIT, "JOYSTICK_UNTRUSTED")


@pytest.mark.parametrize("bit", range(64))
def test_nothing_in_a_frame_with_a_flipped_bit_is_believed(tmp_path: Path, bit: int) -> None:
    """Not even a released enable: bit 48 is the enable itself."""
    rig = Rig(tmp_path)
    rig.run(3)
    rig.run(5, slew=1000)
    wrong = bytearray(rig.joystick(slew=-1000, enable=0))
    wrong[bit // 8] ^= 1 << bit % 8
    assert rig.frame(JOYSTICK, bytes(wrong)) is FrameFault.CHECKSUM
    rig.frame(STOP, rig.stop())
    rig.tick()
    assert rig.axis[0] is State.ACTIVE
    assert rig.controller.axes["slew"].axis.demand == 1.0


def test_a_pressed_stop_counts_with_its_own_data_id_only(rig: Rig) -> None:
    rig.run(3)
    rig.run(5, slew=1000)
    for top in (0xB, 0, 0x2):
        assert rig.frame(STOP, rig.stop(pressed=1, top=top)) is FrameFault.CHECKSUM
    rig.run(1, slew=1000)
    assert rig.axis[0] is State.ACTIVE
    rig.frame(JOYSTICK, rig.joystick(1000))
    rig.frame(STOP, rig.stop(pressed=1))
    rig.tick()
    assert rig.axis == (State.TRIPPED, "EMERGENCY_STOP")


def test_every_valve_frame_has_a_header_of_profile_2(rig: Rig) -> None:
    sent = rig.run(3) + rig.run(60, slew=1000)
    sent += rig.controller.neutral_frames()
    valves = [f.data for f in sent if f.can_id == 512]
    assert [data[1] & 0x0F for data in valves] == [(n + 1) % 16 for n in range(64)]
    for data in valves:
        assert data[0] == Crc8Autosar.calc(data[1:] + bytes([IDS[data[1] & 0x0F]]))
    commands = [struct.unpack("b", data[2:3])[0] for data in valves]
    assert max(commands) > 60
    assert commands[-1] == 0


def test_every_status_frame_is_protected(rig: Rig) -> None:
    sent = rig.run(3) + rig.run(90, slew=1000)
    axis = [f.data for f in sent if f.can_id == 768]
    assert len(axis) > 15  # every 100 ms and at every transition
    assert [data[1] & 0x0F for data in axis] == [(n + 1) % 15 for n in range(len(axis))]
    for data in axis:
        included = b"\x02" if data[1] & 1 else b"\x34"
        assert data == p01(included, data[1] & 0x0F, data[1] >> 4, data[2:])
    assert axis[-1][1] >> 4 == State.ACTIVE
    service = [f.data for f in sent if f.can_id == 784]
    assert [data[5] >> 4 for data in service] == [(n + 1) % 8 for n in range(len(service))]
    assert len(service) > 15
    for data in service:
        assert data[6] == Crc8SaeJ1850.calc(data[:6])
