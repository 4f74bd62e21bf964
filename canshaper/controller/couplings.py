"""Couplings that act on the axes ahead of each tick: load, ends, ropes, motions, shared oil."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from canshaper.config.crane import Motion
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.events import MotionEvent
from canshaper.controller.machine_inputs import MachineInputs
from canshaper.inputs.value import Value
from canshaper.machine.deployment import Deployment
from canshaper.machine.named_codes import values_of_schedules
from canshaper.protocols.interface import Event
from canshaper.shaping.moving_axis import MovingAxis
from canshaper.shaping.states import State
from canshaper.shaping.two_axis_motion import TwoAxisMotion, farthest_m

if TYPE_CHECKING:
    from canshaper.controller.measured_limits import AxisEnds, RopeControl, SharedFlow
    from canshaper.controller.parameter_sets import Load

# States in which the motion may move an axis; one at rest in READY too.
ABLE = (State.READY, State.ACTIVE)
RADIUS = "radius"


class _Member:
    """One axis of a motion: its control, and its state in the computation."""

    __slots__ = ("control", "moving")

    def __init__(self, control: AxisControl, full_speed: float) -> None:
        assert control.axis.sway is not None  # checked with the deployment
        self.control = control
        self.moving = MovingAxis(full_speed, control.period_s, control.axis.sway)

    def bound(self, config: Motion) -> None:
        """Limit how far and how fast the motion may move this axis."""
        moving, axis = self.moving, self.control.bound.config
        moving.farthest = farthest_m(config.max_path_m, damps=axis.damps)
        moving.largest = config.max_pct / 100.0
        moving.fall_per_s = axis.limits.fall_per_s

    def update(self, tick_s: float, last: int, now: int) -> None:
        """Copy the state of the axis; ``last`` and ``now`` are the numbers of two deadlines."""
        moving, control = self.moving, self.control
        axis, period = control.axis, control.period_ticks
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
        full, (back, ahead) = moving.full_speed, control.room
        moving.room_m = full * back, full * ahead
        moving.applied, moving.sent = axis.output.applied, axis.output.setpoint
        moving.commanded, moving.able = axis.output.commanded, axis.state in ABLE
        moving.unattended = axis.added_time.unattended


class MotionControl:
    """Two-axis motion of one crane: finds the velocities that slew and near-far add.

    Args:
        name: name of the motion in the file.
        config: section of the motion.
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
        self._radius, self.circle_m, self.tick_s = radius, config.radius_m, tick_s
        slewing = slew.bound.config.slewing
        assert slewing is not None  # checked with the deployment
        slew.radius = radius
        if near_far and (one := slew.bound.sway_sensor) and (two := near_far.bound.sway_sensor):
            near_far.other = slew if one.timing.measured is two.timing.measured else None
        turning = _Member(slew, slewing.full_speed_rad_s)
        self._near_far = _Member(near_far, _full_speed_m_s(near_far)) if near_far else None
        self._members = [one for one in (turning, self._near_far) if one]
        for member in self._members:
            member.control.axis.allow_added(config.max_pct / 100.0, config.max_s)
        bending: _Member | None = None
        if luffing and config.luffing_rad_s:
            bending = _Member(luffing, config.luffing_rad_s)
            luffing.axis.bends = True
            self._members.append(bending)
        self._roped = [one for one in self._members if one.control.bound.rope]
        self._name = name
        self._apart = slew.bound.name  # what keeps the axes apart; at the start slew waits
        if self._near_far:
            self._near_far.bound(config)
        self.motion = TwoAxisMotion(
            turning.moving, self._near_far.moving if self._near_far else None, config.max_path_m
        )
        if bending:
            self.motion.luffing = bending.moving
            self.motion.height_m = _full_speed_m_s(bending.control) / bending.moving.full_speed

    def adjust(self) -> None:
        """Take over a changed full speed or fall of near-far."""
        if self._near_far:
            moving, control = self._near_far.moving, self._near_far.control
            moving.full_speed = _full_speed_m_s(control)
            moving.fall_per_s = control.bound.config.limits.fall_per_s

    def step(self, now_ns: int, last: int, now: int) -> MotionEvent | None:
        """Find what each axis adds to its output now: nothing while a measurement drives one.

        It is stored in ``added``, ``damps`` and ``displaced`` of the axes.

        Args:
            now_ns: monotonic time.
            last: number of the deadline before; the axes have held their output since.
            now: number of this deadline.

        Returns:
            The event, if what keeps the axes from moving as one has changed; else None.
        """
        apart = ""
        tick_s, members = self.tick_s, self._members
        for member in members:
            if member.control.alone:
                self._end()
                return None
            member.update(tick_s, last, now)
            if not (apart or member.moving.able):
                apart = member.control.bound.name
        for member in self._roped:  # its rope may have another length now
            member.moving.follow(member.moving.sway)
        tip_m = self._radius.fresh(now_ns) if self._radius else None
        self.motion.step((now - last) * tick_s, tip_m, self.circle_m)
        for member in members:
            moving, control = member.moving, member.control
            control.added, control.damps = moving.added, moving.damps
            control.displaced = moving.reached / moving.full_speed
            if self.motion.unattended:
                control.axis.added_time.renew()
        if tip_m is None and self._radius and not apart:
            apart = RADIUS
        return None if apart == self._apart else self._changed(apart)

    def _changed(self, apart: str) -> MotionEvent:
        """Store what keeps the axes apart, "" where nothing does; return the event."""
        self._apart = apart
        states = {one.control.bound.name: one.control.axis.state.name for one in self._members}
        why = f"{apart}={states.get(apart, 'lost')}" if apart else ""
        return MotionEvent(self._name, why)

    def on_trip(self, tripped: AxisControl) -> None:
        """End the added velocities at once, if the tripped axis belongs to this motion."""
        if any(member.control is tripped for member in self._members):
            self._end()

    def _end(self) -> None:
        self.motion.stop()
        for member in self._members:
            if not member.control.alone:
                member.control.drop_added()


def _full_speed_m_s(near_far: AxisControl) -> float:
    sway = near_far.bound.config.sway
    assert sway is not None  # checked with the deployment
    return sway.full_speed_m_s


class Couplings:
    """Everything that acts on the axes of a machine before any of them runs in a tick.

    Args:
        deployment: the machine.
        axes: its axes by name.
        inputs: its inputs.
        tick_s: time between two ticks of the controller.

    Attributes:
        motions: the two-axis motions.
        any: whether the machine has any coupling.
    """

    def __init__(
        self,
        deployment: Deployment,
        axes: Mapping[str, AxisControl],
        inputs: MachineInputs,
        tick_s: float,
    ) -> None:
        config = deployment.config
        self._load: Load | None = None
        if inputs.load_state and (values := values_of_schedules(config).values()):
            from canshaper.controller import parameter_sets

            self._load = parameter_sets.Load(inputs.load_state, [*values])
        for control in axes.values():
            if control.bound.config.gain_schedule or control.bound.config.profiles:
                control.add_chooser(self._load, inputs.profile)
        self._ends: list[AxisEnds | RopeControl] = []
        self._flow: SharedFlow | None = None
        if (oil := config.hydraulics) or inputs.positions or inputs.ropes:
            from canshaper.controller import measured_limits

            self._ends = [measured_limits.AxisEnds(axes[n], p) for n, p in inputs.positions.items()]
            self._ends += [
                measured_limits.RopeControl(n, axes[n], v) for n, v in inputs.ropes.items()
            ]
            if oil:
                others = inputs.other_flow
                self._flow = measured_limits.SharedFlow(oil, axes, inputs.joysticks, others, tick_s)
        self.motions = [
            MotionControl(
                name,
                one.config,
                axes[one.config.slew],
                axes[one.config.near_far] if one.config.near_far else None,
                inputs.radii.get(name),
                luffing=axes[one.config.luffing] if one.config.luffing else None,
                tick_s=tick_s,
            )
            for name, one in deployment.motions.items()
        ]
        self._followed = [(control, control.run_on) for control in axes.values() if control.run_on]
        self.any = bool(self._load or self._ends or self._flow or self.motions)

    def step(self, now_ns: int, last: int, now: int, events: list[Event]) -> None:
        """Apply load, ends and ropes, then motions, then shared oil.

        Args:
            now_ns: monotonic time.
            last: number of the deadline of the tick before.
            now: number of this one.
            events: list that gets the events for the log.
        """
        for control, run_on in self._followed:  # the axis held its last demand until now
            if ticks := now // control.period_ticks - last // control.period_ticks:
                run_on.add(control.axis.demand, ticks)
        if self._load and (load := self._load.step(now_ns)):
            events.append(load)
        for end in self._ends:
            if (change := end.step(now_ns)) is not None:
                events.append(change)
        for motion in self.motions:
            if (event := motion.step(now_ns, last, now)) is not None:
                events.append(event)
        if self._flow:
            events += self._flow.step(now_ns, now - last)
