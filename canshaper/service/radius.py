"""Radius of the tip for the radial compensation: fixed, or measured by a CAN signal."""

import math

from canshaper.can.binding import BoundRadial
from canshaper.can.frame import FrameFault


class RadiusInput:
    """Takes the frames of the radius signal; answers the radius now, or that it is not known."""

    def __init__(self, bound: BoundRadial) -> None:
        self._fixed_m = bound.config.radius_m
        self._message = bound.message
        radius = bound.config.radius
        self._signal = radius.signal if radius else ""
        self._timeout_ns = radius.timeout_ms * 1_000_000 if radius else 0
        self._received_ns: int | None = None
        self._radius_m = 0.0

    def receive(self, data: bytes, now_ns: int) -> FrameFault:
        """Take a frame; a raw value outside the DBC range is none."""
        message = self._message
        if message is None or len(data) != message.length:
            return FrameFault.WRONG_LENGTH
        signal = message.get_signal_by_name(self._signal)
        raw = message.decode(data, decode_choices=False, scaling=False)
        value = float(raw[self._signal]) * signal.scale + signal.offset  # type: ignore
        if not (signal.minimum or 0.0) <= value <= (signal.maximum or math.inf):
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
