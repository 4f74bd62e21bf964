"""Radius of the tip for the radial compensation: fixed, or measured by a CAN signal."""

from canshaper.can.binding import BoundRadial
from canshaper.can.frame import FrameFault
from canshaper.can.layout import Layout
from canshaper.can.signals import find_signal, special_codes


class RadiusInput:
    """Takes the frames of the radius signal; answers the radius now, or that it is not known."""

    def __init__(self, bound: BoundRadial) -> None:
        self._fixed_m = bound.config.radius_m
        self._layout = Layout(bound.message) if bound.message else None
        self._length = bound.message.length if bound.message else 0
        radius = bound.config.radius
        self._signal = (
            find_signal(bound.message, radius.signal) if bound.message and radius else None
        )
        self._special = special_codes(self._signal) if self._signal else {}
        self._timeout_ns = radius.timeout_ms * 1_000_000 if radius else 0
        self._received_ns: int | None = None
        self._radius_m = 0.0

    def receive(self, data: bytes, now_ns: int) -> FrameFault:
        """Take a frame; an error code or a value outside the DBC range is no radius."""
        layout, signal = self._layout, self._signal
        if layout is None or signal is None or len(data) != self._length:
            return FrameFault.WRONG_LENGTH
        raw = layout.decode(data)[signal.name]
        value = raw * signal.scale + signal.offset
        low, high = signal.minimum, signal.maximum
        assert low is not None  # checked with the deployment
        assert high is not None
        if raw in self._special or not low <= value <= high:
            return FrameFault.INVALID_SIGNAL
        self._radius_m, self._received_ns = value, now_ns
        return FrameFault.NONE

    def forget(self) -> None:
        """Nothing received so far counts any more."""
        self._received_ns = None

    def circle_m(self, now_ns: int, tip_share: float) -> float | None:
        """Radius on which the grapple runs, m; None while a measured radius is lost.

        Args:
            now_ns: monotonic time.
            tip_share: radius of the tip as a part of that of the grapple. A fixed radius is that
                of the grapple, a measured one that of the tip.
        """
        if self._fixed_m is not None:
            return self._fixed_m
        if self._received_ns is None or now_ns - self._received_ns > self._timeout_ns:
            return None
        return self._radius_m / tip_share
