"""Axes whose sway and filter follow the measured length of a rope."""

from canshaper.controller.events import ValueEvent
from canshaper.controller.runner import AxisControl
from canshaper.inputs.value import Value
from canshaper.shaping.rope import RopeLength
from canshaper.shaping.states import Reason
from canshaper.shaping.sway import SwayMode


class RopeControl:
    """Lets an axis follow its rope.

    Args:
        name: of the axis.
        runner: the axis, before it has run; what drives its valve for a measurement follows none.
        value: the measured length.
    """

    def __init__(self, name: str, runner: AxisControl, value: Value) -> None:
        sway = runner.bound.config.sway
        assert sway is not None and sway.length is not None  # checked with the deployment
        config, mode, ends = sway.length, sway.mode(), sway.ends()
        self._name, self._axis, self._value = name, runner.axis, value
        self._last_ns: int | None = None
        self._offset_m, self._damping_ratio = config.offset_m, mode.damping_ratio
        self._period_s = mode.period_s
        self._rope = RopeLength(config.lowest_m, config.highest_m, config.lost)
        self._followed_m = 0.0
        self._axis.prepare(*(end.period_s / self._period_s for end in ends))
        runner.add_interlock(self._objection)
        self._follow()

    def step(self, now_ns: int) -> ValueEvent | None:
        """Follow the rope; return whether its length is known, where that has changed."""
        rope, measured = self._rope, self._value.fresh(now_ns)
        elapsed_s = 1e-9 * (now_ns - self._last_ns) if self._last_ns is not None else 0.0
        self._last_ns = now_ns
        if measured is not None:
            measured += self._offset_m
        changed = rope.step(measured, elapsed_s, rests=self._axis.neutral)
        if rope.length_m != self._followed_m:
            self._follow()
        return ValueEvent(f"axis={self._name} length", rope.state) if changed else None

    def _follow(self) -> None:
        self._followed_m = length_m = self._rope.length_m
        mode = SwayMode.from_length(length_m, self._damping_ratio)
        self._axis.follow(mode, mode.period_s / self._period_s)

    def _objection(self, _neutral: bool, _now_ns: int) -> Reason | None:
        return Reason.LENGTH_LOST if self._rope.stops else None
