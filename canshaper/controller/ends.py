"""An axis that is stopped ahead of its end stops, by a measured position."""

from canshaper.controller.events import EndsEvent
from canshaper.controller.runner import AxisControl
from canshaper.inputs.value import Value
from canshaper.shaping.end_stops import UNBOUNDED, EndStops, RunOn, bounds


class AxisEnds:
    """Bounds the demands of an axis before it acts.

    Args:
        runner: the axis; it has ends.
        position: its measured position.
    """

    __slots__ = ("_known", "_position", "_run_on", "_runner", "_stops")

    def __init__(self, runner: AxisControl, position: Value) -> None:
        config = runner.bound.config.limits.ends
        assert config is not None
        margin, lag_s = config.margin, config.lag_ms / 1000.0
        self._runner, self._position = runner, position
        self._stops = EndStops(
            config.lowest + margin, config.highest - margin, config.full_speed, lag_s
        )
        tail_s = runner.bound.config.limits.tail_s
        self._run_on = RunOn(*runner.new_filter(), runner.period_s, tail_s)
        self._known = True

    def step(self, now_ns: int, last: int, now: int) -> EndsEvent | None:
        """Bound the demand of this tick.

        Without a position nothing is bounded: the axis is as if it had no ends.

        Args:
            now_ns: monotonic time.
            last: number of the deadline before; the axis has held its demand since then.
            now: number of this deadline.

        Returns:
            Whether the position is known, where that has changed.
        """
        runner, position = self._runner, self._position.fresh(now_ns)
        axis, period = runner.axis, runner.period_ticks
        if ticks := now // period - last // period:  # it held its last demand until now
            self._run_on.add(axis.command, ticks)
        if position is None:
            runner.room = axis.bounds = UNBOUNDED
        else:
            runner.room = self._stops.room(position, axis.sent, self._run_on.travel())
            axis.bounds = bounds(runner.room, runner.displaced)
        known = position is not None
        if known is self._known:
            return None
        self._known = known
        return EndsEvent(runner.bound.name, known)
