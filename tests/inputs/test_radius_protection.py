"""A measured radius under AUTOSAR E2E: which frames are a radius; the headers by the library."""

import struct
from pathlib import Path

import pytest
from crccheck.crc import Crc8SaeJ1850

from canshaper.codec.frame import FrameFault
from canshaper.inputs.value import radius_input
from canshaper.machine.deployment import Deployment
from tests.machine.protected_machine import load

TICK_NS = 20_000_000
LOW = b"\x77"


class Tip:
    """A radius that is fresh for 0.1 s, and the sender of its frames."""

    def __init__(self, deployment: Deployment) -> None:
        radius = deployment.motions["crane"].radius
        assert radius is not None
        self.radius = radius_input(radius)
        self.now_ns = 0
        self.count = 0

    def data(self, millimetres: int, included: bytes = LOW) -> bytes:
        """A frame with these bytes of the data ID in its CRC."""
        rest = bytes([self.count]) + struct.pack("<H", millimetres)
        return bytes([Crc8SaeJ1850.calc(included + rest, initvalue=0) ^ 0xFF]) + rest

    def give(self, data: bytes) -> FrameFault:
        return self.radius.receive(data, self.now_ns)

    def send(self, millimetres: int, step: int = 1) -> FrameFault:
        self.count = (self.count + step) % 15
        return self.give(self.data(millimetres))

    @property
    def known_m(self) -> float | None:
        return self.radius.fresh(self.now_ns)


@pytest.fixture
def tip(tmp_path: Path) -> Tip:
    return Tip(load(tmp_path))


def test_a_radius_with_its_header_is_known(tip: Tip) -> None:
    assert tip.known_m is None
    assert tip.send(4000) is FrameFault.NONE
    assert tip.known_m == pytest.approx(4.0)


@pytest.mark.parametrize("bit", range(32))
def test_a_radius_with_a_flipped_bit_is_none(tip: Tip, bit: int) -> None:
    tip.send(4000)
    tip.count += 1
    wrong = bytearray(tip.data(5000))
    wrong[bit // 8] ^= 1 << bit % 8
    assert tip.give(bytes(wrong)) is FrameFault.CHECKSUM
    assert tip.known_m == pytest.approx(4.0)


def test_after_a_stall_any_counter_is_the_first_one(tip: Tip) -> None:
    tip.send(4000)
    tip.radius.invalidate()
    assert tip.known_m is None
    assert tip.send(5000, step=9) is FrameFault.NONE
    assert tip.known_m == pytest.approx(5.0)


def test_a_radius_for_another_data_id_is_none(tip: Tip) -> None:
    for other in (b"\x76", b"\x77\x01", b""):
        assert tip.give(tip.data(5000, other)) is FrameFault.CHECKSUM
    assert tip.known_m is None


def test_a_repeated_radius_is_not_new_and_gets_old(tip: Tip) -> None:
    tip.send(4000)
    for _ in range(5):
        tip.now_ns += TICK_NS
        assert tip.send(5000, step=0) is FrameFault.COUNTER_REPEATED
        assert tip.known_m == pytest.approx(4.0)
    tip.now_ns += 1
    assert tip.known_m is None


def test_a_radius_after_a_jump_is_not_accepted_the_next_is(tip: Tip) -> None:
    tip.send(4000)
    assert tip.send(5000, step=3) is FrameFault.NONE
    assert tip.send(6000, step=4) is FrameFault.COUNTER_JUMP
    assert tip.known_m == pytest.approx(5.0)
    assert tip.send(7000) is FrameFault.NONE
    assert tip.known_m == pytest.approx(7.0)


def test_after_silence_a_radius_begins_again(tip: Tip) -> None:
    tip.send(4000)
    tip.now_ns += 101_000_000
    assert tip.send(5000, step=9) is FrameFault.NONE
    assert tip.known_m == pytest.approx(5.0)


def test_a_radius_out_of_range_does_not_break_the_sequence(tip: Tip) -> None:
    tip.send(4000)
    assert tip.send(60_001) is FrameFault.INVALID_SIGNAL
    assert tip.known_m == pytest.approx(4.0)
    assert tip.send(5000) is FrameFault.NONE
    assert tip.known_m == pytest.approx(5.0)


def test_a_radius_qualifies_too(tmp_path: Path) -> None:
    old = "      timeout_ms: 100\n      e2e: { profile: p01, data_id: 0x77"
    tip = Tip(load(tmp_path, (old, old.replace("e2e", "qualify: 3\n      e2e"))))
    for expected in (None, None, 4.0):
        assert tip.send(4000) is FrameFault.NONE
        assert tip.known_m == expected
    assert tip.send(5000, step=5) is FrameFault.COUNTER_JUMP
    for expected in (4.0, 4.0, 6.0):
        tip.send(6000)
        assert tip.known_m == pytest.approx(expected)


def test_nothing_known_holds_after_a_stall(tip: Tip) -> None:
    tip.send(4000)
    tip.radius.invalidate()
    assert tip.known_m is None
