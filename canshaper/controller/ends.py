"""Where axes end: ahead of their end stops, and where the tip rests if they are let go now."""

import math
from collections.abc import Mapping

from canshaper.controller.events import ValueEvent
from canshaper.controller.runner import AxisControl
from canshaper.inputs.value import Value
from canshaper.machine.motion import BoundMotion
from canshaper.shaping.end_stops import UNBOUNDED, EndStops, RunOn, bounds
from canshaper.shaping.states import State

# Lag of a usual proportional valve; an error of a fifth moves the aim of a tip of 1 m/s by 2 cm.
VALVE_LAG_S = 0.1
# States in which the filter lets an axis run on.
SHAPED = (State.ACTIVE, State.STOPPING)


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
        self._run_on = runner.follow_run_on()
        self._known = True

    def step(self, now_ns: int) -> ValueEvent | None:
        """Bound the demand of this tick.

        Without a position nothing is bounded: the axis is as if it had no ends.

        Args:
            now_ns: monotonic time.

        Returns:
            Whether the position is known, where that has changed.
        """
        runner, position = self._runner, self._position.fresh(now_ns)
        axis = runner.axis
        if position is None:
            runner.room = axis.bounds = UNBOUNDED
        else:
            runner.room = self._stops.room(position, axis.sent, self._run_on.travel())
            axis.bounds = bounds(runner.room, runner.displaced)
        known = position is not None
        if known is self._known:
            return None
        self._known = known
        return ValueEvent(f"axis={runner.bound.name} ends", "known" if known else "lost")


class AimPoint:
    """Way that the tip of a crane still goes if its joysticks are let go now.

    That is what the filters still ask for, what the valves lag behind, and the way back from where
    the motion of both axes has moved the tip. It is not known while a filter still holds demands of
    both directions, after a reversal for as long as its response, nor while another set is in force
    than the axis' own.

    Args:
        bound: the motion of both axes; it has a message for this.
        axes: axes of the machine by name.

    Attributes:
        codec: of its message, which is sent every so many ``ticks``.
        slew_deg: angle that the crane still turns; 0 where it is not known.
        radius_m: way of the tip out or in; 0 where it is not known.
        known: whether both are known.
    """

    def __init__(self, bound: BoundMotion, axes: Mapping[str, AxisControl]) -> None:
        assert bound.aim and bound.config.near_far  # checked with the deployment
        self.codec, self.ticks = bound.aim, bound.aim_ticks
        self._slew, self._near_far = axes[bound.config.slew], axes[bound.config.near_far]
        self._run_on = self._slew.follow_run_on(), self._near_far.follow_run_on()
        self.slew_deg = self.radius_m = 0.0
        self.known = True

    def update(self) -> None:
        """Find it by the state of both axes now."""
        slew, near_far = map(_travel, (self._slew, self._near_far), self._run_on)
        slewing, sway = self._slew.bound.config.slewing, self._near_far.bound.config.sway
        assert slewing and sway  # checked with the deployment
        self.slew_deg = math.degrees((slew or 0.0) * slewing.full_speed_rad_s)
        self.radius_m = (near_far or 0.0) * sway.full_speed_m_s
        self.known = slew is not None and near_far is not None


def _travel(runner: AxisControl, run_on: RunOn) -> float | None:
    """Travel of an axis after a release, full speed times seconds; None where it is not known."""
    back, ahead = 0.0, 0.0
    if runner.axis.state in SHAPED:
        back, ahead = run_on.travel()
    if (back and ahead) or runner.active_set:
        return None
    return back + ahead + VALVE_LAG_S * runner.axis.sent - runner.displaced
