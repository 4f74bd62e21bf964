"""Measured values that act on the axes ahead of each tick: end stops, rope length, shared oil."""

from collections.abc import Iterator, Mapping

from canshaper.config.limits import Hydraulics
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.events import ValueEvent
from canshaper.inputs.joystick import JoystickInput
from canshaper.inputs.value import Value
from canshaper.shaping.demand_bounds import UNBOUNDED, EndStops, FlowBudget, bounds
from canshaper.shaping.limits import within
from canshaper.shaping.states import Lost, Reason, State
from canshaper.shaping.sway import SwayMode


class AxisEnds:
    """Bounds the demand of an axis ahead of its end stops.

    Args:
        control: the axis, whose limits name its ends.
        position: its measured position.
    """

    __slots__ = ("_control", "_known", "_position", "_run_on", "_stops")

    def __init__(self, control: AxisControl, position: Value) -> None:
        config = control.bound.config.limits.ends
        assert config is not None
        margin, lag_s = config.margin, config.lag_ms / 1000.0
        self._control, self._position = control, position
        self._stops = EndStops(
            config.lowest + margin, config.highest - margin, config.full_speed, lag_s
        )
        self._run_on = control.follow_run_on()
        self._known = True

    def step(self, now_ns: int) -> ValueEvent | None:
        """Bound the demand of this tick.

        While the position is not known, the axis moves as if it had no end stops.

        Args:
            now_ns: monotonic time.

        Returns:
            The event, if the position has become known or was lost; else None.
        """
        control, position = self._control, self._position.fresh(now_ns)
        axis = control.axis
        if position is None:
            control.room = axis.bounds = UNBOUNDED
        else:
            control.room = self._stops.room(position, axis.output.setpoint, self._run_on.travel())
            axis.bounds = bounds(control.room, control.displaced)
        known = position is not None
        if known is self._known:
            return None
        self._known = known
        return ValueEvent(f"axis={control.bound.name} ends", "known" if known else "lost")


# No hoist is faster. A message may come only every half second, and round its value.
MOST_M_S = 3.0
MOST_SILENT_S = 0.5
ROUNDING_M = 0.3
# A length counts again when it has not jumped for this time.
SETTLES_S = 1.0
# Fastest change of the length that filters follow in motion, as a part of the length a second.
MOST_PER_S = 1.0


class RopeLength:
    """Length of a rope that the filters of an axis follow.

    The length does not jump where its signal is lost or jumps.

    Args:
        lowest_m: shortest rope that the filters know; a shorter one counts as this.
        highest_m: longest one. It counts until a length is known.
        lost: length while none is known: with "longest" that, with "hold" the last one; with
            "neutral" the last one too, but the axis must not move.

    Attributes:
        length_m: the length now.
        state: known, lost or jumped.
    """

    def __init__(self, lowest_m: float, highest_m: float, lost: Lost) -> None:
        self._lowest, self._highest, self._lost = lowest_m, highest_m, lost
        self.length_m = highest_m
        self.state = "known"
        self._measured: float | None = None  # last measured length
        self._since_s = 0.0  # time since it changed, without that while it was lost
        self._lost_s = 0.0  # time for which it has been lost
        self._settles_s = 0.0

    @property
    def stops(self) -> bool:
        """Whether the axis must not move, because the length is not known."""
        return self._lost == "neutral" and self.state != "known"

    def step(self, measured_m: float | None, elapsed_s: float, *, rests: bool) -> bool:
        """Take the measured length; return whether the state has changed.

        Args:
            measured_m: the length, m; None where it is not known. 0 or less is not known either.
            elapsed_s: time since the last step, seconds.
            rests: whether the axis is at rest, so that its filter may change at once.
        """
        state, before = self._state(measured_m, elapsed_s), self.state
        self.state = state
        wanted = self.length_m
        if state == "known" and measured_m is not None:
            wanted = min(max(measured_m, self._lowest), self._highest)
        elif self._lost == "longest":
            wanted = self._highest
        if not rests:
            most = MOST_PER_S * elapsed_s * self.length_m
            wanted = min(max(wanted, self.length_m - most), self.length_m + most)
        self.length_m = wanted
        return state != before

    def _state(self, measured_m: float | None, elapsed_s: float) -> str:
        if measured_m is None or not measured_m > 0.0:
            self._lost_s += elapsed_s
            return "lost"
        self._since_s += elapsed_s
        last, self._measured = self._measured, measured_m
        self._settles_s = max(self._settles_s - elapsed_s, 0.0)
        if last is not None and measured_m != last:
            # The rope may run all the time that its length is lost: the length before says less
            # and less, and nothing once this way is longer than the rope.
            ran_s = min(self._since_s, MOST_SILENT_S) + self._lost_s
            way = MOST_M_S * ran_s + ROUNDING_M
            self._since_s = 0.0
            if abs(measured_m - last) > way:
                self._settles_s = SETTLES_S
        self._lost_s = 0.0
        return "jumped" if self._settles_s else "known"


class RopeControl:
    """Lets sway model and filter of an axis follow the measured length of its rope.

    Args:
        name: name of the axis.
        control: the axis, before its first tick. Where a measurement replaces ``control.axis``, the
            replacement follows no rope.
        value: the measured length.
    """

    def __init__(self, name: str, control: AxisControl, value: Value) -> None:
        sway = control.bound.config.sway
        assert sway is not None and sway.length is not None  # checked with the deployment
        config, mode, ends = sway.length, sway.mode(), sway.ends()
        self._name, self._axis, self._value = name, control.axis, value
        self._last_ns: int | None = None
        self._offset_m, self._damping_ratio = config.offset_m, mode.damping_ratio
        self._period_s = mode.period_s
        self._rope = RopeLength(config.lowest_m, config.highest_m, config.lost)
        self._followed_m = 0.0
        self._axis.prepare(*(end.period_s / self._period_s for end in ends))
        control.stops.interlocks.append(self._objection)
        self._follow()

    def step(self, now_ns: int) -> ValueEvent | None:
        """Follow the rope; return the event if its length has become known, lost or jumped."""
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


# States in which a deflected joystick moves the axis, at the latest in this tick.
DRIVEN = (State.READY, State.ACTIVE, State.BYPASS_ON)
# Time for which the oil has to be enough before that is reported.
ENOUGH_S = 5.0


class SharedFlow:
    """Scales the demands of all axes by one factor, to the oil that the pump delivers.

    Args:
        config: flow of the pump, and the share of it that each axis takes.
        axes: the axes by name.
        joysticks: the joysticks by name.
        others: measured flow of functions that we do not drive, or None.
        tick_s: time between two ticks of the controller.
    """

    def __init__(
        self,
        config: Hydraulics,
        axes: Mapping[str, AxisControl],
        joysticks: Mapping[str, JoystickInput],
        others: Value | None,
        tick_s: float,
    ) -> None:
        self._axes = [
            (one, joysticks[one.bound.config.command.joystick].commands) for one in axes.values()
        ]
        shares = [config.shares.get(name, 1.0) for name in axes]
        self._config, self._others = config, others
        self._known = True
        self._budget = FlowBudget(shares, tick_s)
        self._enough = round(ENOUGH_S / tick_s)
        self._ticks = self._enough  # since the demands were last scaled

    def step(self, now_ns: int, ticks: int) -> Iterator[ValueEvent]:
        """Scale the demands of this tick, and yield events for the log, which must all be taken.

        Args:
            now_ns: monotonic time.
            ticks: ticks that have passed; more than 1 where deadlines were missed.
        """
        config = self._config
        flow = config.flow - config.others
        if self._others is not None and (measured := config.others_measured):
            value = self._others.fresh(now_ns)
            if (known := value is not None) is not self._known:
                self._known = known
                yield ValueEvent("hydraulics_others", "known" if known else "lost")
            if value is not None:
                flow = config.flow - max(value / measured.full, 0.0)
        demands, outputs = [], []
        for control, commands in self._axes:
            command = control.bound.config.command
            demand = commands.get(command.signal, 0.0)
            if isinstance(demand, Reason) or control.axis.state not in DRIVEN:
                demand = 0.0
            if control.axis.state is not State.BYPASS_ON:
                demand = within(demand, *control.axis.bounds, 0.0)
            demands.append(demand if abs(demand) > command.neutral_pct / 100.0 else 0.0)
            outputs.append(control.axis.output.setpoint)
        scale = self._budget.step(flow, demands, outputs, ticks)
        for control, _ in self._axes:
            control.axis.scale = scale
        before = self._ticks
        self._ticks = 0 if scale < 1.0 else before + ticks
        if before >= self._enough > self._ticks or before < self._enough <= self._ticks:
            state = "enough" if scale == 1.0 else f"scaled speed_pct={100.0 * scale:.0f}"
            yield ValueEvent("hydraulics", state)
