"""Clocks of a test: that of the loop and the wall clock, which can be set."""

import pytest

from canshaper.bus import packet
from canshaper.bus.port import Port

START_NS = 10**12
WALL_NS = 1_763_750_000_000_000_000  # what the wall clock is ahead of the loop's


class Clocks:
    """Both clocks of a machine; they run only when the test lets them."""

    def __init__(self) -> None:
        self.now_ns = START_NS
        self.ahead_ns = WALL_NS

    def boottime_ns(self) -> int:
        return self.now_ns

    def time_ns(self) -> int:
        return self.now_ns + self.ahead_ns

    def replace(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(packet, "time", self)
        monkeypatch.setattr(packet, "boottime_ns", self.boottime_ns)


def arrivals_of(port: Port) -> list[int]:
    """Of all frames that wait, after the start of the test."""
    return [port.arrived_ns - START_NS for _ in port.frames()]
