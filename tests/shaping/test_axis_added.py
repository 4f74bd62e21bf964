"""Velocity that another axis asks: what must hold whatever is asked, and when.

The oracle knows inputs and outputs only. Time is in ticks, missed ones included.
"""

import copy
import math

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput, Reason, State
from canshaper.shaping.sway import SwayMode, SwayModel

BAND = 0.02
LARGEST = 0.3
TICK_S = 0.05
MODE = SwayMode(2.86, 0.05)
POLES = (-5.655, -4.112)
DRIVEN = (State.ACTIVE, State.BYPASS_ON)
DEAF = (State.NEUTRAL_WAIT, State.TRIPPED, State.STOPPING)
LOST = (Reason.JOYSTICK_TIMEOUT, Reason.JOYSTICK_ERROR, Reason.SWITCH_INVALID)
TRIPS = (Reason.SEND_FAILED, Reason.LOOP_STALLED)
SETUPS = [  # limits, and steps of the frame
    (OutputLimits(tail_s=0.4), 125),
    (OutputLimits(tail_s=0.2, deadband=0.05, minimum=0.1), 125),
    (OutputLimits(rise_per_s=1.5, fall_per_s=8.0, tail_s=0.4, maximum=0.77), 125),
    (OutputLimits(rise_per_s=8.0, fall_per_s=1.5, tail_s=0.1), 125),
    (OutputLimits(tail_s=0.3, deadband=0.25), 10),
    (OutputLimits(tail_s=0.0, rise_per_s=100.0, fall_per_s=100.0, maximum=0.3), 125),
]
joysticks = st.sampled_from([0.0, BAND, 0.021, -0.021, 0.3, -0.3, 1.0, -1.0]) | st.floats(-1.0, 1.0)
velocities = st.one_of(
    st.sampled_from([0.0, 5e-324, -1e-300, 1e-9, 0.004, -0.004, 0.0041, 0.25, -0.25, 0.5, -0.5]),
    st.floats(-0.5, 0.5),
)
durations = st.sampled_from([1, 2, 3, 5, 10, 20])
anything = st.builds(
    CommandInput,
    command=joysticks,
    fault=st.none() | st.none() | st.sampled_from(LOST),
    enabled=st.booleans(),
    bypass=st.booleans(),
    reset=st.booleans(),
    trip=st.none() | st.none() | st.sampled_from(TRIPS),
)


class AddedByAnother(RuleBasedStateMachine):
    """Drives an axis with joystick and added velocity; checks every tick."""

    @initialize(setup=st.sampled_from(SETUPS))
    def build(self, setup: tuple[OutputLimits, int]) -> None:
        limits, steps = setup
        self.limits = limits
        model = SwayModel(MODE, TICK_S)
        self.axis = ShapedAxis(
            TICK_S,
            limits,
            sway=model,
            shaper=Gff(model, POLES),
            neutral_band=BAND,
            stop_s=0.3,
            grid_steps=steps,
        )
        self.axis.allow_added(LARGEST, 3600.0)
        self.shadow = SwayModel(MODE, TICK_S)
        self.rise, self.fall = limits.rise_per_s * TICK_S, limits.fall_per_s * TICK_S
        # Rates act before rounding, half a step to either side; and half a one more for a bound.
        self.slack = 1.5 / (steps * (1.0 - limits.deadband)) + 1e-12
        self.tail = round(limits.tail_s / TICK_S)
        self.falling = math.ceil(limits.maximum / self.fall)
        self.joystick, self.added = CommandInput(), 0.0
        self.now = 0
        self.mixed = False  # something was added since the axis was at rest
        self.armed = False
        # when which command was given by a usable joystick
        self.commanded: list[tuple[int, float]] = []
        self.demanded: list[tuple[int, float]] = []  # the same, but no rest ends it
        self.idle = 0  # ticks for which no one has asked for anything
        self.keep(2)

    @rule(command=joysticks, added=velocities, ticks=durations)
    def push(self, command: float, added: float, ticks: int) -> None:
        self.joystick, self.added = self.joystick._replace(command=command), added
        self.keep(ticks)

    @rule(added=st.lists(velocities, min_size=1, max_size=20))
    def ask(self, added: list[float]) -> None:
        for self.added in added:
            self.tick()

    @rule(cause=st.sampled_from([*LOST, *TRIPS, None]), bypass=st.booleans(), ticks=durations)
    def fail(self, cause: Reason | None, bypass: bool, ticks: int) -> None:
        """The joystick is lost, the axis trips, or the switch is released; the asking goes on."""
        before = self.joystick
        name = {"trip": cause} if cause in TRIPS else {"fault": cause}
        self.joystick = before._replace(enabled=cause is not None, bypass=bypass, **name)
        self.keep(ticks)
        self.joystick = before

    @rule(inputs=st.lists(st.tuples(anything, velocities), min_size=1, max_size=12))
    def chaos(self, inputs: list[tuple[CommandInput, float]]) -> None:
        before = self.joystick
        for self.joystick, self.added in inputs:
            self.tick()
        self.joystick = before

    @rule()
    def recover(self) -> None:
        self.joystick = CommandInput(enabled=False)
        self.keep(1)
        self.joystick, self.added = CommandInput(), 0.0
        self.keep(2)

    @rule()
    def let_go(self) -> None:
        """Nothing asked any more: at rest after the tail and the time to fall from full speed."""
        self.joystick, self.added = CommandInput(reset=True), 0.0
        self.keep(self.tail + self.falling + 10)  # stop_s and the way through the states
        assert self.axis.raw == 0
        assert self.axis.state in (State.READY, State.TRIPPED)

    @rule(ticks=st.integers(1, 5))
    def miss(self, ticks: int) -> None:
        self.axis.hold(ticks)
        for _ in range(ticks):
            self.shadow.step(self.axis.applied)
        self.now += ticks

    @rule(omega=st.floats(1.0, 6.0))
    def retune(self, omega: float) -> None:
        mode = SwayMode(omega, 0.02)
        self.axis.retune(mode, lambda model: Gff(model, POLES))
        self.shadow = self.shadow.retuned(mode, self.axis.applied)

    @rule(bad=st.sampled_from([math.nan, math.inf, -math.inf, 1.1, -1e300]))
    def nonsense(self, bad: float) -> None:
        """It trips an axis that would carry it out, and is nothing to any other."""
        self.added = bad
        before = self.axis.state
        self.tick()
        if before in (*DRIVEN, State.READY) and self.usable and not self.joystick.bypass:
            assert (self.axis.state, self.axis.reason) == (State.TRIPPED, Reason.OUTPUT_INVALID)
        self.added = 0.0

    def keep(self, ticks: int) -> None:
        for _ in range(ticks):
            self.tick()

    def tick(self) -> None:
        joystick, axis = self.joystick, self.axis
        old, before = axis.state, axis.sent
        self.usable = joystick.fault is None and joystick.trip is None and joystick.enabled
        centred = joystick.fault is None and abs(joystick.command) <= BAND
        other = copy.deepcopy(axis) if not self.usable or joystick.bypass or old in DEAF else None
        axis.tick(joystick, self.added)
        self.now += 1
        if other is not None:  # nothing that may be added to
            other.tick(joystick, 0.0)
            assert (axis.state, axis.raw, axis.sent) == (other.state, other.raw, other.sent)
            assert axis.applied == other.applied == axis.sent

        # what was asked
        if self.usable and self.armed and not centred:
            self.commanded.append((self.now, joystick.command))
            self.demanded.append((self.now, joystick.command))
        self.commanded = [(at, c) for at, c in self.commanded if self.now - at <= self.tail]
        self.demanded = [(at, c) for at, c in self.demanded if self.now - at <= self.tail]
        if axis.state not in (*DRIVEN, State.STOPPING):  # at rest: it begins from nothing
            self.commanded = []
        self.armed = self.usable and (self.armed or centred)
        carried = self.added if axis.state is State.ACTIVE and not joystick.bypass else 0.0
        self.idle = 0 if self.commanded or carried else self.idle + 1

        # what may come of it
        if old is State.READY and axis.state in DRIVEN and centred:
            assert (axis.state, axis.reason) == (State.ACTIVE, Reason.COMPENSATING)
            assert carried
        assert abs(axis.sent) <= self.limits.maximum
        assert (axis.raw == 0) == (axis.sent == 0.0)
        if axis.state not in (*DRIVEN, State.STOPPING):
            assert axis.raw == 0
        if axis.raw:
            assert joystick.trip is None
            assert self.usable or axis.state is State.STOPPING
            assert self.idle <= self.falling
        self.mixed = bool(carried) or (self.mixed and axis.raw != 0)
        self.check_model(carried)
        self.check_speed(carried, before)
        self.check_rate(before)

    def check_model(self, carried: float) -> None:
        """It is driven by what was sent for the operator of this axis, and by nothing else."""
        axis = self.axis
        if axis.reason is Reason.OUTPUT_INVALID:
            self.shadow.angle, self.shadow.rate = 0.0, 0.0
            assert axis.applied == 0.0
        assert axis.applied == axis.sent - carried
        self.shadow.step(axis.applied)
        assert axis.sway is not None
        assert (axis.sway.angle, axis.sway.rate) == (self.shadow.angle, self.shadow.rate)
        assert math.isfinite(self.shadow.angle + self.shadow.rate)

    def check_speed(self, carried: float, before: float) -> None:
        """No faster than joystick, addition and what is carried of it; except while falling."""
        for sign in (1.0, -1.0):
            # Where something is added, demands count that a stop or a trip came after.
            counted = self.demanded if self.mixed else self.commanded
            allowed = max([0.0, *(sign * c for _, c in counted)])
            if self.axis.state in DRIVEN and sign * self.axis.command < 0.0:
                allowed = 0.0
            elif self.mixed and not allowed:
                allowed = LARGEST
            # The own part falls by the rate, whatever is added; so it does where that has ended.
            falling = sign * before - (0.0 if self.mixed else self.fall) + self.slack
            assert sign * self.axis.sent <= max(allowed, min(falling, sign * before), 0.0) + 1e-12

    def check_rate(self, before: float) -> None:
        sent = self.axis.sent
        if self.axis.state not in (*DRIVEN, State.STOPPING):
            return
        if self.mixed and before * self.axis.command < 0.0 and abs(sent) < abs(before):
            return  # what was added against the joystick is left out at once
        if before * sent >= 0.0:
            assert abs(sent) - abs(before) <= self.rise + self.slack
            assert abs(before) - abs(sent) <= self.fall + self.slack
        else:
            spent = max(0.0, abs(before) - self.slack) / self.fall
            assert spent + max(0.0, abs(sent) - self.slack) / self.rise <= 1.0 + 1e-9


AddedByAnother.TestCase.settings = settings(
    max_examples=3 * settings().max_examples,
    stateful_step_count=25,
    suppress_health_check=list(HealthCheck),
)
TestAddedByAnother = pytest.mark.slow(AddedByAnother.TestCase)
