"""Whatever happens to an axis, these things hold: an independent oracle watches every tick.

It knows inputs and outputs, nothing of the axis' inside. Time is in ticks, missed ones included.
The joystick moves the axis, and in some machines a motion of two axes, which asks for anything.
"""

import copy
import math

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.states import CommandInput, Reason, State, Transition
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off
from tests.shaping.axis_histories import (
    BAND,
    CAUSES,
    SETUPS,
    SWITCHES,
    WAYS,
    Setup,
    Wild,
    additions,
    anything,
    durations,
    joysticks,
    modes,
)

History = tuple[CommandInput, float]
histories = st.tuples(anything, st.just(0.0) | additions)
MODE = SwayMode(2.86, 0.05)
DRIVEN = (State.ACTIVE, State.BYPASS_ON)
MAY_MOVE = (*DRIVEN, State.STOPPING)
DEAF = (State.NEUTRAL_WAIT, State.TRIPPED, State.STOPPING)


class AxisUnderWatch(RuleBasedStateMachine):
    """Drives an axis and checks every tick."""

    @initialize(setup=st.sampled_from(SETUPS))
    def build(self, setup: Setup) -> None:
        self.setup, self.wild = setup, Wild()
        self.limits = limits = setup.limits
        model = SwayModel(MODE, setup.tick_s) if setup.filter == "gff" else None
        shaper = self.shaper(model, (-5.655, -4.112))
        rest = {"neutral_band": BAND, "stop_s": setup.stop_s, "grid_steps": setup.steps}
        self.axis = ShapedAxis(setup.tick_s, limits, sway=model, shaper=shaper, **rest)
        self.axis.allow_added(setup.added, 3600.0)
        self.shadow = SwayModel(MODE, setup.tick_s)  # the hanging tool, as far as it is known
        self.rise, self.fall = limits.rise_per_s * setup.tick_s, limits.fall_per_s * setup.tick_s
        # Rates act before rounding. Half a step to either side makes one step; one and a half where
        # one of the two had to be rounded down because of a bound.
        self.slack = 1.5 / (setup.steps * (1.0 - limits.deadband)) + 1e-12
        self.tail = round(limits.tail_s / setup.tick_s)
        self.falling = math.ceil(limits.maximum / self.fall)  # ticks from full speed
        self.stop = max(1, round(setup.stop_s / setup.tick_s))
        self.joystick, self.added = CommandInput(), 0.0
        # the oracle's memory
        self.now = self.stop_from = 0
        self.armed = False  # joystick seen valid, enabled and neutral since it last was not usable
        # when which command was given by such a joystick, since the axis was at rest, and in all
        self.commanded: list[tuple[int, float]] = []
        self.demanded: list[tuple[int, float]] = []
        self.mixed = False  # something was added since the axis was at rest
        self.overtime = 0  # ticks for which nothing has moved it, beyond the tail
        self.enabled_before = self.reset_before = True
        self.tick()

    def shaper(self, model: SwayModel | None, poles: tuple[float, float]) -> Shaper:
        if model is not None and self.setup.filter == "gff":
            return Gff(model, poles)
        return self.wild if self.setup.filter == "wild" else Off()

    @rule(command=joysticks, added=st.just(0.0) | additions, ticks=durations)
    def push(self, command: float, added: float, ticks: int) -> None:
        self.added = added
        self.keep(self.joystick._replace(command=command), ticks)

    @rule(added=st.lists(additions, min_size=1, max_size=20))
    def ask(self, added: list[float]) -> None:
        for self.added in added:
            self.tick()

    @rule(bad=st.sampled_from([math.nan, math.inf, -math.inf, 1.1, -1e300]))
    def ask_for_nonsense(self, bad: float) -> None:
        """It trips an axis that would carry it out, and is nothing to any other."""
        before, self.added = self.axis.state, bad
        self.tick()
        if self.setup.added and before not in DEAF and self.usable and not self.joystick.bypass:
            assert (self.axis.state, self.axis.reason) == (State.TRIPPED, Reason.OUTPUT_INVALID)
        self.added = 0.0

    @rule()
    def let_go(self) -> None:
        """At rest after tail or stop, and the time to fall from full speed."""
        self.added = 0.0
        self.keep(CommandInput(reset=True), max(self.tail, self.stop) + self.falling + 10)
        assert self.axis.output.steps == 0
        assert self.axis.state in (State.READY, State.TRIPPED)

    @rule(command=joysticks, ticks=durations, then=durations)
    def stroke(self, command: float, ticks: int, then: int) -> None:
        """Get going, if need be, and reverse."""
        if self.axis.state not in (State.READY, *DRIVEN):
            self.recover()
        self.push(command, 0.0, ticks)
        self.push(-command, 0.0, then)

    @rule()
    def recover(self) -> None:
        """Act as an operator does when nothing moves: let go, switch off and on."""
        self.joystick, self.added = CommandInput(bypass=self.joystick.bypass), 0.0
        self.keep(self.joystick._replace(enabled=False), 1)
        self.keep(self.joystick, 2)

    @rule(cause=st.sampled_from(CAUSES), ticks=durations, then=st.lists(histories, max_size=5))
    def fail(self, cause: tuple[str, Reason], ticks: int, then: list[History]) -> None:
        name, reason = cause
        self.keep(self.joystick._replace(**{name: reason}), ticks)
        self.joystick = self.joystick._replace(**{name: None})
        self.chaos(then)

    @rule(name=st.sampled_from(SWITCHES), on=st.booleans(), ticks=durations)
    def switch(self, name: str, on: bool, ticks: int) -> None:
        self.keep(self.joystick._replace(**{name: on}), ticks)

    @rule(inputs=st.lists(histories, min_size=1, max_size=12))
    def chaos(self, inputs: list[History]) -> None:
        before = self.joystick
        for self.joystick, self.added in inputs:
            self.tick()
        self.joystick = before

    @rule(ticks=st.integers(1, 10))
    def miss(self, ticks: int) -> None:
        self.axis.hold(ticks)
        for _ in range(ticks):
            self.shadow.step(self.axis.output.applied)
        self.now += ticks

    @rule(mode=modes, pole=st.floats(-8.0, -0.5), ticks=durations)
    def retune(self, mode: SwayMode, pole: float, ticks: int) -> None:
        known = self.axis.sway is not None
        self.axis.retune(mode, lambda model: self.shaper(model, (pole, 1.5 * pole)))
        fresh = SwayModel(mode, self.setup.tick_s)
        self.shadow = self.shadow.retuned(mode, self.axis.output.applied) if known else fresh
        self.keep(self.joystick, ticks)

    @rule(says=st.one_of(joysticks, st.sampled_from([1e300, -1e300, math.nan, math.inf])))
    def filter_says(self, says: float) -> None:
        self.wild.says = says

    def keep(self, joystick: CommandInput, ticks: int) -> None:
        self.joystick = joystick
        for _ in range(ticks):
            self.tick()

    def tick(self) -> None:
        joystick, axis = self.joystick, self.axis
        old, sent_before = axis.state, axis.output.setpoint
        self.usable = joystick.fault is None and joystick.trip is None and joystick.enabled
        self.centred = joystick.fault is None and abs(joystick.command) <= BAND
        adds = bool(self.setup.added) and self.usable and not joystick.bypass and old not in DEAF
        twin = copy.deepcopy(axis) if self.setup.added and self.added and not adds else None
        transition = axis.tick(joystick, self.added)
        if twin is not None:  # nothing that may be added to
            twin.tick(joystick)
            one, other = axis.output, twin.output
            assert axis.state is twin.state
            assert (one.steps, one.setpoint) == (other.steps, other.setpoint)
            assert one.applied == other.applied == one.setpoint
        self.now += 1
        self.carried = self.added if adds and axis.state is State.ACTIVE else 0.0
        assert axis.output.applied == axis.output.setpoint - self.carried
        if axis.state is State.TRIPPED and axis.reason is Reason.OUTPUT_INVALID and transition:
            self.shadow = SwayModel(self.shadow.mode, self.setup.tick_s)
        self.shadow.step(axis.output.applied)
        self.remember()
        self.check_frame()
        self.check_way(old, transition, sent_before)
        self.check_cause()
        self.check_speed(sent_before)
        self.check_rate(old, sent_before)

    def remember(self) -> None:
        """Keep the command of the operator, by the inputs alone."""
        if self.usable and self.armed and not self.centred:
            for demands in (self.commanded, self.demanded):
                demands.append((self.now, self.joystick.command))
        since = self.now - self.tail if self.axis.state in MAY_MOVE else self.now + 1
        self.commanded = [(at, c) for at, c in self.commanded if at >= since]
        self.demanded = [(at, c) for at, c in self.demanded if self.now - at <= self.tail]
        self.mixed = bool(self.carried) or (self.mixed and self.axis.output.steps != 0)
        self.overtime = 0 if self.commanded or self.carried else self.overtime + 1
        self.armed = self.usable and (self.armed or self.centred)

    def check_frame(self) -> None:
        """A frame that can be sent, the velocity that it gives, and a model that knows it."""
        axis, limits, steps = self.axis, self.limits, self.setup.steps
        out, sent = axis.output.steps, axis.output.setpoint
        assert isinstance(out, int)
        assert abs(out) <= steps
        assert abs(sent) <= limits.maximum
        opened = max(0.0, abs(out) / steps - limits.deadband) / (1.0 - limits.deadband)
        assert math.isclose(sent, math.copysign(opened, out), abs_tol=1e-12)
        assert (out == 0) == (sent == 0.0)
        if axis.sway is not None:
            assert math.isfinite(axis.sway.angle)
            assert (axis.sway.angle, axis.sway.rate) == (self.shadow.angle, self.shadow.rate)

    def check_way(self, old: State, transition: Transition | None, before: float) -> None:
        """The state machine goes only ways it has, and leaves a trip only as it may."""
        joystick, axis = self.joystick, self.axis
        if axis.state is old:
            assert transition is None
        else:
            assert transition == Transition(old, axis.state, axis.reason)
            assert axis.state in WAYS[old]
            if axis.state in (*DRIVEN, State.READY):
                assert self.usable
            assert axis.state is not State.READY or self.centred
            if old is State.READY and axis.state in DRIVEN and self.centred:
                assert self.carried
                assert (axis.state, axis.reason) == (State.ACTIVE, Reason.COMPENSATING)
        if old is State.TRIPPED and axis.state is not State.TRIPPED:
            assert self.centred
            assert joystick.trip is None
            reset = joystick.reset and not self.reset_before
            assert reset or (joystick.enabled and not self.enabled_before)
        held = self.reset_before and joystick.fault is not None
        self.reset_before = joystick.reset or held
        unknown = joystick.fault in (Reason.JOYSTICK_TIMEOUT, Reason.JOYSTICK_UNTRUSTED)
        self.enabled_before = joystick.enabled or unknown
        self.stop_from = self.stop_from if old is State.STOPPING else self.now
        ended = self.now - self.stop_from >= self.stop
        assert not ended or axis.state is not State.STOPPING
        if old is State.STOPPING and axis.state is State.NEUTRAL_WAIT:
            assert ended or before == 0.0
        driven = axis.state in DRIVEN and not self.centred
        assert axis.demand == (joystick.command if driven else 0.0)

    def check_cause(self) -> None:
        """No motion without a fresh, valid, enabled command within the bounded times."""
        joystick, axis = self.joystick, self.axis
        if axis.output.steps == 0:
            return
        assert axis.state in MAY_MOVE
        assert joystick.trip is None
        assert joystick.fault is not None or joystick.enabled
        assert joystick.fault is None or axis.state is State.STOPPING
        assert self.overtime <= self.falling

    def check_speed(self, before: float) -> None:
        """Not faster than asked within the tail, not against the joystick, except while falling."""
        limits, sent = self.limits, self.axis.output.setpoint
        # Where something is added, demands count that a stop or a trip came after.
        demands = self.demanded if self.mixed else self.commanded
        most = self.setup.added if self.mixed else 0.0
        high = max([0.0, *(c for _, c in demands)]) or most
        low = max([0.0, *(-c for _, c in demands)]) or most
        if limits.allow_faster:
            high, low = math.ceil(high), math.ceil(low)
        if limits.allow_reverse:
            high = low = max(high, low)
        elif self.axis.state in DRIVEN and self.axis.demand > 0.0:
            low = 0.0
        elif self.axis.state in DRIVEN and self.axis.demand < 0.0:
            high = 0.0
        allowed, falling = (high, before) if sent > 0.0 else (low, -before)
        # The own part falls by the rate, whatever is added; so it does where that has ended.
        falling = min(falling, falling - (not self.mixed) * self.fall + self.slack)
        assert abs(sent) <= max(allowed, falling, 0.0) + 1e-12

    def check_rate(self, old: State, before: float) -> None:
        """Rise and fall within a tick; only a trip or the end of a stop cuts off."""
        sent, axis = self.axis.output.setpoint, self.axis
        if axis.state not in MAY_MOVE:
            assert sent == 0.0
            assert before == 0.0 or axis.state is State.TRIPPED or old is State.STOPPING
            return
        if before * sent >= 0.0:
            assert abs(sent) - abs(before) <= self.rise + self.slack
            assert abs(before) - abs(sent) <= self.fall + self.slack
        else:
            spent = max(0.0, abs(before) - self.slack) / self.fall
            assert spent + max(0.0, abs(sent) - self.slack) / self.rise <= 1.0 + 1e-9


AxisUnderWatch.TestCase.settings = settings(
    max_examples=3 * settings().max_examples,
    stateful_step_count=25,
    suppress_health_check=list(HealthCheck),
)
TestAxisUnderWatch = AxisUnderWatch.TestCase
