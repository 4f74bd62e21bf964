"""Radius of the tip for the radial compensation: fixed, or measured by a CAN signal."""

from typing import Self

from canshaper.codec.frame import FrameFault
from canshaper.codec.signals import find_signal
from canshaper.inputs.value import ValueInput
from canshaper.machine.bound_axis import BoundRadial
from canshaper.machine.inputs import BoundRadius


class RadiusInput:
    """Takes the frames of the radius signal; answers the radius now, or that it is not known."""

    def __init__(self, bound: BoundRadial) -> None:
        self._fixed_m = bound.config.radius_m
        self._measured = _measured(bound.radius) if bound.radius else None

    def receive(self, data: bytes, arrived_ns: int) -> FrameFault:
        """Take a frame; a fixed radius has none."""
        if self._measured is None:
            return FrameFault.WRONG_LENGTH
        return self._measured.receive(data, arrived_ns)

    def invalidate(self) -> None:
        """Nothing received so far counts any more."""
        if self._measured is not None:
            self._measured.invalidate()

    def copy_state(self, before: Self) -> None:
        """Continue the sequence of the same message."""
        assert self._measured is not None  # only a measured one is received
        assert before._measured is not None
        self._measured.copy_state(before._measured)

    def circle_m(self, now_ns: int, tip_share: float) -> float | None:
        """Radius on which the grapple runs, m; None while a measured radius is lost.

        Args:
            now_ns: monotonic time.
            tip_share: radius of the tip as a part of that of the grapple. A fixed radius is that
                of the grapple, a measured one that of the tip.
        """
        if self._fixed_m is not None:
            return self._fixed_m
        assert self._measured is not None  # one of both is there
        radius_m = self._measured.fresh(now_ns)
        return None if radius_m is None else radius_m / tip_share


def _measured(bound: BoundRadius) -> ValueInput:
    """A radius that comes in frames; what lies outside its DBC range is none."""
    signal = find_signal(bound.message, bound.config.signal)
    # All checked with the deployment.
    assert signal is not None
    assert signal.minimum is not None
    assert signal.maximum is not None
    return ValueInput(bound, signal.name, signal.minimum, signal.maximum)
