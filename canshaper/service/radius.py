"""Radius of the tip for the radial compensation: fixed, or measured by a CAN signal."""

from typing import Any

from canshaper.can.binding import BoundRadial
from canshaper.can.frame import FrameFault
from canshaper.can.inputs import BoundRadius
from canshaper.can.signals import find_signal, special_codes
from canshaper.service.input import GOOD, Input
from canshaper.shaping.states import Reason


class MeasuredRadius(Input):
    """A radius of the tip that comes in frames.

    Attributes:
        radius_m: the last one that counted.
        measured_ns: when it came; None when there is none.
    """

    def __init__(self, bound: BoundRadius) -> None:
        super().__init__(bound)
        signal = find_signal(bound.message, bound.config.signal)
        # All checked with the deployment.
        assert signal is not None
        assert signal.minimum is not None
        assert signal.maximum is not None
        self._signal = signal
        self._low, self._high = signal.minimum, signal.maximum
        self._special = special_codes(signal)
        self.radius_m = 0.0
        self.measured_ns: int | None = None

    def heard(
        self, raw: dict[str, Any], commands: dict[str, float | Reason], now_ns: int, counts: bool
    ) -> FrameFault:
        """An error code or a value outside the DBC range is no radius."""
        value = raw[self._signal.name]
        radius_m = value * self._signal.scale + self._signal.offset
        if value in self._special or not self._low <= radius_m <= self._high:
            return FrameFault.INVALID_SIGNAL
        if counts:
            self.radius_m, self.measured_ns = radius_m, now_ns
        return GOOD

    def forget(self) -> None:
        """Nothing received so far counts any more."""
        super().forget()
        self.measured_ns = None


class RadiusInput:
    """Takes the frames of the radius signal; answers the radius now, or that it is not known."""

    def __init__(self, bound: BoundRadial) -> None:
        self._fixed_m = bound.config.radius_m
        self._measured = MeasuredRadius(bound.radius) if bound.radius else None
        self._timeout_ns = bound.radius.config.timeout_ms * 1_000_000 if bound.radius else 0

    def receive(self, data: bytes, now_ns: int) -> FrameFault:
        """Take a frame; a fixed radius has none."""
        if self._measured is None:
            return FrameFault.WRONG_LENGTH
        return self._measured.receive(data, now_ns)

    def forget(self) -> None:
        """Nothing received so far counts any more."""
        if self._measured is not None:
            self._measured.forget()

    def circle_m(self, now_ns: int, tip_share: float) -> float | None:
        """Radius on which the grapple runs, m; None while a measured radius is lost.

        Args:
            now_ns: monotonic time.
            tip_share: radius of the tip as a part of that of the grapple. A fixed radius is that
                of the grapple, a measured one that of the tip.
        """
        if self._fixed_m is not None:
            return self._fixed_m
        measured = self._measured
        if measured is None or measured.measured_ns is None:
            return None
        if now_ns - measured.measured_ns > self._timeout_ns:
            return None
        return measured.radius_m / tip_share
