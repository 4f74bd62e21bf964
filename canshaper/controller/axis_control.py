"""Control of one axis: from its joystick to the setpoint in the message of its valve."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Self

from canshaper.codec.message import Sender
from canshaper.config.schema import AxisSection
from canshaper.inputs.joystick import CommandSource
from canshaper.inputs.stops import EmergencyStopInput, StopCauses
from canshaper.inputs.value import Feedback, ProfileChoice, Value
from canshaper.machine.stop_distance import output_limits
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.demand_bounds import RunOn
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.states import CommandInput, Reason, State, Transition, Trust
from canshaper.shaping.sway import SwayModel

if TYPE_CHECKING:
    from canshaper.controller.parameter_sets import Load, SetChooser
    from canshaper.inputs.sway_sensor import SensorNode, SwaySensorInput, SwaySignal

# Least radius that counts for the speed of the tip. At the pillar the speed would be 0, and with it
# the scale of every swing.
LEAST_RADIUS_M = 0.5


class AxisControl:
    """Control of one axis: its joystick, its causes to stop, its shaped axis, its valve's message.

    Attributes:
        bound: the axis of the file with its codecs; ``bound.config`` is what is in force.
        valve: sender of its valve's message.
        axis: the shaped axis: state machine, filter and output stage.
        period_ticks, period_s: time between two setpoints to its valve, ticks and seconds.
        room: (back, ahead), how far it may still move to its end stops, full speed times seconds;
            back is negative, and without end stops both are infinite.
        displaced: how far a motion has moved it from where its own demands lead, full speed times
            seconds.
        stops: causes to stop it or to keep it from starting, besides its joystick.
        added: velocity that a two-axis motion asks this axis to add, part of full speed.
        damps: whether that motion asks it to damp the swing that the other axis causes.
        radius: measured radius of the tip of an axis that slews, or None.
        other: the axis whose motion makes the load of this one swing, or None; both have sway
            sensors of one kind.
        alone: whether a measurement drives it; it is then part of no motion.
        feedback: feedback of its valve, or None.
        run_on: run-on of its filter, or None where nothing needs it.
        chooser: choice of its sway data and filter, or None without a choice.
    """

    def __init__(
        self, bound: BoundAxis, tick_s: float, joystick: CommandSource, valve: Sender
    ) -> None:
        config = bound.config
        self.bound = bound
        self.valve = valve
        self._joystick = joystick
        self._releases = 0  # of the joystick, as this axis knows them
        self.stops = StopCauses()
        self._signal = config.command.signal
        self._put = bound.valve.put
        self._neutral_band = config.command.neutral_pct / 100.0
        self.period_ticks = bound.period_ticks
        self.period_s = period_s = tick_s * bound.period_ticks
        shaper, sway = self.new_filter()
        self.axis = ShapedAxis(
            period_s,
            self.limits(config),
            sway=sway,
            shaper=shaper,
            neutral_band=self._neutral_band,
            stop_s=config.limits.stop_s,
            grid_steps=bound.valve.steps,
        )
        self._full_speed_m_s = config.sway.full_speed_m_s if config.sway else 0.0
        self.added, self.damps = 0.0, False
        self.room = -math.inf, math.inf
        self.displaced = 0.0
        self.run_on: RunOn | None = None
        self.other: AxisControl | None = None
        self.alone = False
        self.chooser: SetChooser | None = None
        self.radius: Value | None = None
        self._sway_signal: SwaySignal | None = None
        self.feedback = Feedback(bound.feedback, period_s) if bound.feedback else None

    def limits(self, config: AxisSection) -> OutputLimits:
        """Return the output limits of this axis with a configuration."""
        return output_limits(config, timeout_ms=self.bound.timeout_ms, period_s=self.period_s)

    def trip_in_motion(self, reason: Reason) -> None:
        """Trip with the next tick, unless the axis is neutral."""
        if not self.axis.neutral:
            self.stops.trip = reason

    def drop_added(self) -> None:
        """Add nothing from now on; what was added makes the next output no faster."""
        self.added, self.damps = 0.0, False
        self.axis.drop_added()

    def new_filter(self) -> tuple[Shaper, SwayModel | None]:
        """Return a new filter by the present ``bound.config``, and its new sway model or None."""
        config, period_s = self.bound.config, self.period_s
        sway = SwayModel(config.sway.mode(), period_s) if config.sway else None
        return _shaper(config, period_s, sway), sway

    def follow_run_on(self) -> RunOn:
        """Return the run-on of its filter, which is computed from now on."""
        if self.run_on is None:
            tail_s = self.bound.config.limits.tail_s
            self.run_on = RunOn(*self.new_filter(), self.period_s, tail_s)
        return self.run_on

    def add_chooser(self, load: "Load | None", profile: ProfileChoice | None) -> None:
        """Let load and operator choose sway data and filter."""
        from canshaper.controller.parameter_sets import SetChooser

        self.chooser = SetChooser(self.bound, self.axis, load, profile)

    def add_sway_sensor(self, message: "SwaySensorInput") -> None:
        """Add the sway sensor whose measurements are in this message."""
        from canshaper.inputs.sway_sensor import SwaySignal
        from canshaper.shaping.sensed import SensedSway

        bound, sway = self.bound.sway_sensor, self.axis.sway
        assert bound is not None
        assert sway is not None  # checked with the deployment
        self._sway_signal = SwaySignal(message, bound)
        damps = bound.config.use == "damp"
        self.axis.sensed = SensedSway(sway, bound.timing, bound.limits, bound.gains, damps=damps)

    def measured_by(self, node: "SensorNode") -> None:
        """Use measurements of the sway sensor only while this node works."""
        assert self._sway_signal is not None  # of an axis with a sensor
        self._sway_signal.node = node

    def isolate(self, joystick: CommandSource, axis: ShapedAxis | None = None) -> None:
        """Isolate the axis for a measurement: it gets another joystick, and no motion adds to it.

        Args:
            joystick: source of its demand from now on.
            axis: shaped axis from now on; by default it stays.
        """
        self._joystick = joystick
        self.alone = True
        self.added, self.damps = 0.0, False
        if axis is not None:
            self.axis, self.chooser = axis, None

    def copy_state(self, before: Self) -> None:
        """Stay tripped, and trip for causes that are pending: a reload is no reset."""
        latched = before.axis
        if latched.state is State.TRIPPED:
            self.axis.restore(latched.state, latched.reason)
        self.stops.copy_state(before.stops)

    def adjust(self, config: AxisSection) -> None:
        """Continue with other sway data, filter and limits; all else stays.

        Args:
            config: the new configuration. Its filter suits the period of this axis; its limits
                differ only while the axis is neutral.
        """
        limits = self.limits(config)
        if limits != self.limits(self.bound.config):
            self.axis.limit(limits)
        if config.sway is not None:
            mode, period_s = config.sway.mode(), self.period_s
            self.axis.retune(mode, lambda sway: _shaper(config, period_s, sway))
            self._full_speed_m_s = config.sway.full_speed_m_s
        self.bound = replace(self.bound, config=config)

    def hold(self, last: int, now: int) -> Transition | None:
        """Count missed deadlines, in which the valve kept its last output.

        Args:
            last, now: numbers of the deadline of the last tick and of the one of this tick.

        Returns:
            The change of state, if the filter failed in them; else None.
        """
        passed = now // self.period_ticks - last // self.period_ticks
        return self.axis.hold(passed - 1) if passed > 1 else None

    def command(
        self, now_ns: int, emergency: EmergencyStopInput | None, overrun: bool
    ) -> Transition | None:
        """Find the setpoint of this tick, and put it into the message of the valve.

        A trip cause that was noted since the last tick acts now. The caller sends the frame, and
        calls ``axis.propagate`` after it.

        Args:
            now_ns: monotonic time.
            emergency: the emergency stop, where there is one.
            overrun: whether too many deadlines were missed lately.

        Returns:
            The change of state of this tick, or in TRIPPED the first error of the filter; or None.
        """
        fault = None
        axis, joystick, stops = self.axis, self._joystick, self.stops
        if emergency or stops.interlocks or stops.invalid or stops.foreign_ns is not None:
            fault = stops.fault(now_ns, emergency, neutral=axis.neutral)
        trip, stops.trip = stops.trip, None
        command, self._releases = joystick.command(
            self._signal, now_ns, self._releases, trip, self._neutral_band
        )
        # Enable that is released in motion trips; a fault would only stop through the filter.
        if fault is not None and (command.enabled or axis.neutral):
            # Another switch that does not agree must not hide a release of the one to press. Where
            # that one is lost, its return is no press.
            let_go = not command.enabled and command.fault is None
            enabled = not (let_go and fault is Reason.ENABLE_OFF)
            # The position of a valid joystick still counts: it may be held against the run-on.
            held, reset = command.command, command.reset
            command = CommandInput(held, fault=fault, enabled=enabled, reset=reset, trip=trip)
        # Late ticks spoil a filter. In bypass there is none, and the operator keeps control.
        late = Reason.LOOP_OVERRUN if overrun and axis.state is not State.BYPASS_ON else None
        if late and command.enabled and command.fault is None:
            command = command._replace(fault=late, bypass=False)
        if self.chooser is not None:
            self.chooser.update(now_ns)
        if self._sway_signal is not None and axis.sensed is not None:
            value, scale = self._sway_signal.new_value(), self._scale(now_ns)
            commanded, damps, other = axis.output.commanded, self.damps, self.other
            shown = other.own_swing(now_ns) if other and damps else None
            axis.sensed.measure(value, scale, commanded=commanded, damps=damps, other=shown)
        transition = axis.command(command, self.added, damps=self.damps)
        try:
            self._put(self.valve.raw, axis.output.steps)
        except Exception as error:  # neutral takes its place in the message
            old = axis.state if transition is None else transition.old
            transition = axis.invalidate(old, error)
            self.put(0)
        return transition

    def put(self, steps: int) -> None:
        """Put a setpoint, signed steps of the valve's signal, into the message of the valve."""
        self.bound.valve.put(self.valve.raw, steps)

    def _scale(self, now_ns: int) -> float:
        """Return the swing, rad, of model angle 1 (see ``SwayModel``) at the present full speed."""
        if self.radius is not None and (radius_m := self.radius.fresh(now_ns)):
            slewing = self.bound.config.slewing
            assert slewing is not None  # checked with the deployment
            self._full_speed_m_s = max(radius_m, LEAST_RADIUS_M) * slewing.full_speed_rad_s
        assert self.axis.sway is not None
        return self.axis.sway.mode.angle_per_speed_rad * self._full_speed_m_s

    def own_swing(self, now_ns: int) -> float | None:
        """Return the swing of its own motion as its sensor shows it, rad or rad/s, or None."""
        sensed = self.axis.sensed
        return sensed.own(self._scale(now_ns)) if sensed else None

    @property
    def sway_deg(self) -> float:
        """Predicted swing of the load, degrees; 0 without sway data."""
        sway = self.axis.sway
        return math.degrees(sway.sway_rad(self._full_speed_m_s)) if sway else 0.0

    @property
    def reason(self) -> Reason:
        """Reason of its state; in ACTIVE also an end stop, or missing oil, that slows it."""
        axis = self.axis
        if axis.state is State.ACTIVE:
            if abs(axis.demand) < 1.0 and axis.demand in axis.bounds:
                return Reason.END_STOP
            if axis.demand and axis.scale < 1.0:
                return Reason.FLOW_LIMITED
        return axis.reason

    @property
    def trust(self) -> Trust:
        """Trust state of the sway sensor; NO_DATA without one."""
        return self.axis.sensed.state if self.axis.sensed else Trust.NO_DATA

    @property
    def swing_length_m(self) -> float:
        """Pendulum length that the sway sensor has shown last, m; 0 before the first."""
        seen = self.axis.sensed.length.result if self.axis.sensed else None
        return seen.length_m if seen else 0.0

    @property
    def active_set(self) -> int:
        """Number of the parameter set in force; 0 where there is no choice."""
        return self.chooser.number if self.chooser else 0


def _shaper(config: AxisSection, period_s: float, sway: SwayModel | None) -> Shaper:
    """Return the filter of an axis, for the rate of its valve."""
    rate = config.limits.slowest_per_s
    parameters = config.filter.parameters()
    return build_shaper(config.filter.kind, period_s, sway, valve_rate_per_s=rate, **parameters)
