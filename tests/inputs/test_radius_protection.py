"""A measured radius under AUTOSAR E2E: which frames are a radius; the headers by the library."""

import struct
from pathlib import Path

import pytest
from crccheck.crc import Crc8SaeJ1850

from canshaper.codec.frame import FrameFault
from canshaper.machine.deployment import Deployment
from tests.machine.protected_machine import load
from tests.rigs.radius import RadiusInput

TICK_NS = 20_000_000
LOW = b"\x77"


class Tip:
    """A radius that is fresh for 0.1 s, and the sender of its frames."""

    def __init__(self, deployment: Deployment) -> None:
        radius = deployment.motions["crane"].radius
        assert radius is not None
        self.radius = RadiusInput(radius)
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


def test_a_repeated_radius_is_not_new_and_gets_old(tip: Tip) -> None:
    tip.send(4000)
    for _ in range(5):
        tip.now_ns += TICK_NS
        assert tip.send(5000, step=0) is FrameFault.COUNTER_REPEATED
        assert tip.known_m == pytest.approx(4.0)
    tip.now_ns += 1
    assert tip.known_m is None


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
