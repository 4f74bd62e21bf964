"""The two-axis motion of a crane at work: it adds to both axes before either of them moves."""

from collections.abc import Mapping

from canshaper.config.crane import Motion
from canshaper.controller.events import MotionEvent
from canshaper.controller.runner import AxisControl
from canshaper.inputs.value import Value
from canshaper.machine.deployment import Deployment
from canshaper.shaping.motion import TwoAxisMotion, farthest_m
from canshaper.shaping.moving_axis import MovingAxis
from canshaper.shaping.states import State

# An axis at rest in READY may be moved by the other one.
ABLE = (State.READY, State.ACTIVE)
RADIUS = "radius"


class _Member:
    """One axis of the motion."""

    __slots__ = ("moving", "runner")

    def __init__(self, runner: AxisControl, full_speed: float) -> None:
        assert runner.axis.sway is not None  # checked with the deployment
        self.runner = runner
        self.moving = MovingAxis(full_speed, runner.period_s, runner.axis.sway)

    def bound(self, config: Motion) -> None:
        """Limit how far and how fast the motion may move this axis."""
        moving, axis = self.moving, self.runner.bound.config
        moving.farthest = farthest_m(config.max_path_m, damps=axis.damps)
        moving.largest = config.max_pct / 100.0
        moving.fall_per_s = axis.limits.fall_per_s

    def update(self, tick_s: float, last: int, now: int) -> None:
        """Read the state of the axis; see ``MotionRunner.step``."""
        moving, runner = self.moving, self.runner
        axis, period = runner.axis, runner.period_ticks
        if period == 1 == now - last:
            moving.ahead_s = 0.0
        else:
            passed = now // period - last // period
            if passed > 1:
                moving.held((passed - 1) * moving.period_s)
            moving.ahead_s = 0.0 if passed else (period - now % period) * tick_s
        if axis.sway is not moving.sway:  # changed while it runs
            assert axis.sway is not None
            moving.follow(axis.sway)
        full, (back, ahead) = moving.full_speed, runner.room
        moving.room_m = full * back, full * ahead
        moving.applied, moving.sent = axis.output.applied, axis.output.setpoint
        moving.commanded, moving.able = axis.output.commanded, axis.state in ABLE
        moving.unattended = axis.unattended


class MotionRunner:
    """Slew and near-far of one crane.

    Args:
        name: of the motion, in the file.
        config: the motion.
        slew: the axis that turns.
        near_far: the axis that moves the tip in and out, or None.
        radius: measured radius of the tip, or None.
        luffing: the axis that turns the boom up, or None.
        tick_s: time between two ticks of the controller.
    """

    def __init__(
        self,
        name: str,
        config: Motion,
        slew: AxisControl,
        near_far: AxisControl | None,
        radius: Value | None,
        *,
        luffing: AxisControl | None,
        tick_s: float,
    ) -> None:
        self._radius, self._circle_m, self._tick_s = radius, config.radius_m, tick_s
        slewing = slew.bound.config.slewing
        assert slewing is not None  # checked with the deployment
        slew.radius = radius
        if near_far and (one := slew.bound.sway_sensor) and (two := near_far.bound.sway_sensor):
            near_far.other = slew if one.timing.measured is two.timing.measured else None
        turning = _Member(slew, slewing.full_speed_rad_s)
        self._near_far = _Member(near_far, _full_speed_m_s(near_far)) if near_far else None
        self._members = [one for one in (turning, self._near_far) if one]
        for member in self._members:
            member.runner.axis.allow_added(config.max_pct / 100.0, config.max_s)
        bending: _Member | None = None
        if luffing and config.luffing_rad_s:
            bending = _Member(luffing, config.luffing_rad_s)
            luffing.axis.bends = True
            self._members.append(bending)
        self._roped = [one for one in self._members if one.runner.bound.rope]
        self._name = name
        self._apart = slew.bound.name  # what keeps the axes apart: at the start that they wait
        if self._near_far:
            self._near_far.bound(config)
        self._motion = TwoAxisMotion(
            turning.moving, self._near_far.moving if self._near_far else None, config.max_path_m
        )
        if bending:
            self._motion.luffing = bending.moving
            self._motion.height_m = _full_speed_m_s(bending.runner) / bending.moving.full_speed

    def adjust(self) -> None:
        """Take full speed and fall of near-far as they are now."""
        if self._near_far:
            moving, runner = self._near_far.moving, self._near_far.runner
            moving.full_speed = _full_speed_m_s(runner)
            moving.fall_per_s = runner.bound.config.limits.fall_per_s

    def step(self, now_ns: int, last: int, now: int) -> MotionEvent | None:
        """Give both axes what they add in this tick.

        Args:
            now_ns: monotonic time.
            last: number of the deadline before; axes have held their output since then.
            now: number of this deadline.

        Returns:
            Whether they move as one, where that has changed.
        """
        apart = ""
        tick_s, members = self._tick_s, self._members
        for member in members:
            if member.runner.alone:
                self._end()
                return None
            member.update(tick_s, last, now)
            if not (apart or member.moving.able):
                apart = member.runner.bound.name
        for member in self._roped:  # of which the model swings otherwise now
            member.moving.follow(member.moving.sway)
        tip_m = self._radius.fresh(now_ns) if self._radius else None
        self._motion.step((now - last) * tick_s, tip_m, self._circle_m)
        for member in members:
            moving, runner = member.moving, member.runner
            runner.added, runner.damps = moving.added, moving.damps
            runner.displaced = moving.reached / moving.full_speed
            if self._motion.unattended:
                runner.axis.added_time.renew()
        if tip_m is None and self._radius and not apart:
            apart = RADIUS
        return None if apart == self._apart else self._changed(apart)

    def _changed(self, apart: str) -> MotionEvent:
        """Take what keeps the axes apart now, or "" where nothing does; return the event."""
        self._apart = apart
        states = {one.runner.bound.name: one.runner.axis.state.name for one in self._members}
        why = f"{apart}={states.get(apart, 'lost')}" if apart else ""
        return MotionEvent(self._name, why)

    def on_trip(self, tripped: AxisControl) -> None:
        """End what is added at once, if the tripped axis is one of these."""
        if any(member.runner is tripped for member in self._members):
            self._end()

    def _end(self) -> None:
        self._motion.stop()
        for member in self._members:
            if not member.runner.alone:
                member.runner.drop_added()


def _full_speed_m_s(near_far: AxisControl) -> float:
    sway = near_far.bound.config.sway
    assert sway is not None  # checked with the deployment
    return sway.full_speed_m_s


def motion_runners(
    deployment: Deployment,
    axes: Mapping[str, AxisControl],
    radii: Mapping[str, Value],
    tick_s: float,
) -> list[MotionRunner]:
    """Motions of a deployment.

    Args:
        deployment: the deployment.
        axes: all of its axes by name.
        radii: measured radii of the tip by name of the motion, where there are any.
        tick_s: time between two ticks of the controller.
    """
    motions = []
    for name, bound in deployment.motions.items():
        config = bound.config
        near_far = axes[config.near_far] if config.near_far else None
        slew, radius = axes[config.slew], radii.get(name)
        luffing = axes[config.luffing] if config.luffing else None
        motions.append(
            MotionRunner(name, config, slew, near_far, radius, luffing=luffing, tick_s=tick_s)
        )
    return motions
