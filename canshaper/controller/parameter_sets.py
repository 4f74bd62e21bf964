"""Choice of an axis' sway data and filter by load state and operator, in motion too."""

import math
from collections import deque
from collections.abc import Mapping, Sequence

from canshaper.config.filters import Profile
from canshaper.config.schema import AxisSection
from canshaper.controller.events import ValueEvent
from canshaper.inputs.value import ProfileChoice, ValueInput
from canshaper.machine.filters import parameter_sets
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.registry import (
    STEPS_BETWEEN,
    ParameterSet,
    at_position,
    build_shaper,
    position,
)

# Shortest time between two changes of one axis: a noisy weight must not keep the loop busy.
LEAST_BETWEEN_NS = 100_000_000
# A profile that changes on the way to a speed would leave as much swing as no filter. So the change
# waits until the axis is at rest, or has kept the demanded speed, within this part of full speed,
# for this time.
STEADY = 0.02
STEADY_NS = 200_000_000
LATE_S = 1.0  # a load is gripped at rest: a signal that changes this soon in a press is late
# No crane grips or drops loads more than twice in this time: a signal that does is restless.
SETTLES_NS = 2_000_000_000
_MOST_JUMPS = 3


class Load:
    """Load by its signal; not known while the signal is silent, or jumps to and fro.

    Args:
        signal: signal of the load state.
        breakpoints: load states of all parameter sets of the machine.

    Attributes:
        value: the load, in the unit of its signal; None while it is not known.
    """

    __slots__ = ("_jump", "_jumps_ns", "_said", "_signal", "_state", "value")

    def __init__(self, signal: ValueInput, breakpoints: Sequence[float]) -> None:
        self.value: float | None = None
        self._signal = signal
        self._jump = 0.5 * (max(breakpoints) - min(breakpoints))
        self._jumps_ns: deque[int] = deque(maxlen=_MOST_JUMPS)
        self._said: float | None = None  # value after the last jump
        self._state = "known"

    def step(self, now_ns: int) -> ValueEvent | None:
        """Read the signal; return the event if its state has changed."""
        value, jumps_ns = self._signal.fresh(now_ns), self._jumps_ns
        if value is not None and (self._said is None or abs(value - self._said) >= self._jump > 0):
            if self._said is not None:
                jumps_ns.append(now_ns)
            self._said = value
        restless = len(jumps_ns) == _MOST_JUMPS and now_ns - jumps_ns[0] < SETTLES_NS
        self.value = None if restless else value
        state = "restless" if restless else "lost" if value is None else "known"
        if state == self._state:
            return None
        self._state = state
        return ValueEvent("load_state", state)


class SetChooser:
    """Selects sway data and filter of one axis by load state and the operator's profile.

    Args:
        bound: the axis.
        axis: the shaped axis, which is retuned.
        load: the load, or None without a signal for it.
        profile: the operator's choice, or None; an attribute too.

    Attributes:
        number: number of the parameter set in force: 0 the axis' own, then its sets, then each
            profile and its sets, in the order of the file; between two sets the nearer one.
    """

    def __init__(
        self, bound: BoundAxis, axis: ShapedAxis, load: Load | None, profile: ProfileChoice | None
    ) -> None:
        config = bound.config
        self.number = 0
        self._axis = axis
        self._load = load
        self.profile = profile
        self._rate = config.limits.slowest_per_s
        self._programs = programs(bound)
        self._first: dict[str, int] = {}
        number = 0
        for name, (_, sets) in self._programs.items():
            self._first[name] = number
            number += 1 + len(sets)
        self._now: tuple[str, int | None] = ("", None)
        self._not_before_ns = 0
        self._maximum = config.limits.max_pct / 100.0
        self._restless_ns: int | None = None  # when the speed was not steady, while a profile waits
        # Velocity that drove the sway model in each tick of a press that began at rest; None in a
        # later press.
        self._driven: list[float] | None = []
        self._late = round(LATE_S / axis.sway.tick_s) if axis.sway else 0

    def update(self, now_ns: int) -> None:
        """Retune the axis by load and operator; a change of profile waits for a steady speed."""
        self._follow_press()
        name = self.profile.name(now_ns) if self.profile else ""
        if name not in self._programs:
            name = ""
        before, steps = self._now
        value = self._load.value if self._load else None
        lost = value is None and steps is not None  # while the speed changes it hangs there still
        if name == before and not lost:
            self._restless_ns = None
        elif not self._steady(now_ns):
            name = before
        else:
            lost = False
        base, sets = self._programs[name]
        if not lost:
            steps = position(sets, value) if sets and value is not None else None
        if (name, steps) == self._now or now_ns < self._not_before_ns:
            return
        self._now, self._not_before_ns = (name, steps), now_ns + LEAST_BETWEEN_NS
        chosen = base if steps is None else at_position(sets, steps)
        self.number = self._first[name]
        if steps is not None:
            self.number += 1 + round(steps / STEPS_BETWEEN)
        past = (self._driven or ()) if name == before else ()
        options = {"valve_rate_per_s": self._rate, **chosen.parameters}
        self._axis.retune(
            chosen.mode, lambda sway: build_shaper(chosen.kind, sway.tick_s, sway, **options), past
        )

    def _follow_press(self) -> None:
        """Record what drove the sway model in the last tick, in the first press since rest."""
        axis, driven = self._axis, self._driven
        if not axis.output.commanded:
            self._driven = []
        elif driven is not None:
            driven.append(axis.output.applied)
            if axis.demand == 0.0 or len(driven) > self._late:
                self._driven = None

    def _steady(self, now_ns: int) -> bool:
        """Return whether the axis is at rest or steady, so that the profile may change."""
        axis = self._axis
        if axis.neutral:
            return True
        speed = min(abs(axis.demand), self._maximum)
        off = abs(axis.output.applied - math.copysign(speed, axis.demand))
        if off > STEADY or self._restless_ns is None:
            self._restless_ns = now_ns
        return now_ns - self._restless_ns >= STEADY_NS


def profile_by_number(bound: BoundAxis) -> list[str]:
    """Return the profile of each parameter set, "" for the own filter; [] without profiles."""
    if not bound.config.profiles:
        return []
    return [name for name, (_, sets) in programs(bound).items() for _ in range(1 + len(sets))]


def programs(bound: BoundAxis) -> Mapping[str, tuple[ParameterSet, Sequence[ParameterSet]]]:
    """Return base and breakpoint sets of each profile by name; "" names the axis' own filter."""
    config = bound.config
    assert config.sway is not None  # checked with the deployment
    mode = config.sway.mode()
    sets: dict[str, tuple[ParameterSet, Sequence[ParameterSet]]] = {}
    parts: dict[str, AxisSection | Profile] = {"": config, **config.profiles}
    for name, part in parts.items():
        base = ParameterSet(0.0, mode, part.filter.kind, part.filter.parameters())
        sets[name] = (base, parameter_sets(part.gain_schedule))
    return sets
