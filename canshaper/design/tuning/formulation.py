"""Task of the tuner: weights, requirements and time grid of Eq. 14-15.

    minimise   1/N sum_k  x'Q x + R (y - 0.95)^2 + S (y - 1)^2 + P (y_k - y_(k-1))^2        (Eq. 15)
    over       the real poles of G_FF (14d), at a distance from the imaginary axis (14e)

for a unit step on the joystick, k = 0 ... N-1. With y_(-1) = 0 the first jump counts. Commands
are fractions of full speed; u_max cancels, because the cost grows with its square.
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import get_args

from canshaper.config.desk import PoleDistance, States, matrix, weights_fault
from canshaper.errors import DesignError
from canshaper.shaping.sway import SwayMode

# The paper's word for "sufficiently far from the imaginary axis".
POLE_DISTANCE = 5.0
# Fastest pole is this times sqrt(rate of the valve x sway frequency): 6 rad/s at 5 full speeds per
# second and 2.86 rad/s. Faster ones make the limit-aware filter chase a valve that cannot follow;
# docs/tuning.md shows where it breaks.
POLE_PER_RATE = 1.6
# Poles slower than the swing leave more of it, so a slow valve may be chased up to there.
SLOW_POLE_PER_RATE = 2.6
# Above this damping ratio each swing is less than a seventh of the one before.
MOST_DAMPED = 0.3
# The schema of the deployment file.
SLOWEST_RAD_S, FASTEST_RAD_S = 0.1, 100.0
# Part of full speed that the output must stay within for the run-on to be over.
SETTLED = 0.05
# Allowed overshoot of a filter with three poles: too small for a step of a valve frame.
OVER_COMMAND = 1e-4


def in_range(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raise DesignError with range and value unless the value is finite and in [low, high]."""
    if not (math.isfinite(value) and low <= value <= high):
        expected = f"{low:g} to {high:g} {unit}".rstrip()
        raise DesignError(f"{name}: expected {expected}, got {value:g} {unit}".rstrip())


@dataclass(frozen=True, slots=True)
class Weights:
    """Weights of Eq. 15; the defaults are those of the paper's slewing axis.

    Attributes:
        q: matrix Q: one number for both states, its diagonal, or its rows (symmetric).
        r: weight R of the distance from 95 % of the command (rise time).
        s: weight S of the distance from the command.
        p: weight P of the change of the output from sample to sample.

    Raises:
        DesignError: a weight is negative or no number, Q is not positive semi-definite, or R and S
            are both zero (then the best filter would never move the crane).
    """

    q: tuple[float, ...] = (1.0, 1.0)
    r: float = 1.0
    s: float = 3.0
    p: float = 1.0

    def __post_init__(self) -> None:
        if fault := weights_fault(self.q, self.r, self.s):
            raise DesignError(fault)
        for name, value in (("R", self.r), ("S", self.s), ("P", self.p)):
            in_range(f"weight {name}", value, 0.0, 1e6)

    @property
    def matrix(self) -> tuple[float, float, float]:
        """The entries q11, q12, q22 of Q."""
        return matrix(self.q)


PAPER_SLEW = Weights()
PAPER_NEAR_FAR = Weights(r=2.0, s=0.0, p=0.03)


@dataclass(frozen=True, slots=True)
class Requirements:
    """Requirements on a setting, besides real poles (14d).

    Attributes:
        pole_distance: reading of Eq. 14e: as in the text, as printed, or off.
        within_command: the response to a step never passes the command.
        max_jump: largest part of a step that the filter may pass at once.
        max_rate_per_s: rate of the valve, full speeds per second. It bounds the poles
            (``POLE_PER_RATE``) and, with a third pole, the slope of the response to a full step.
        max_run_on_s: time after which the response to a step stays within 5 % of full speed.
        third_pole: require a third real pole, so that the filter passes no part of a step at once.

    Raises:
        DesignError: a value is out of range.
    """

    pole_distance: PoleDistance = "text"
    within_command: bool = True
    max_jump: float | None = None
    max_rate_per_s: float | None = None
    max_run_on_s: float | None = None
    third_pole: bool = False

    def __post_init__(self) -> None:
        if self.pole_distance not in get_args(PoleDistance):
            names = ", ".join(get_args(PoleDistance))
            raise DesignError(f"pole distance: expected one of {names}, got {self.pole_distance}")
        if self.max_jump is not None:
            in_range("first jump", self.max_jump, 0.01, 100.0, "of the command")
        if self.max_rate_per_s is not None:
            in_range("rate of the valve", self.max_rate_per_s, 0.1, 1000.0, "full speeds/s")
        if self.max_run_on_s is not None:
            in_range("run-on", self.max_run_on_s, 0.05, 20.0, "s")


def check_swing(mode: SwayMode) -> None:
    """Raise DesignError for a tool whose swing decays by itself: a filter would only prolong it."""
    if mode.damping_ratio > MOST_DAMPED:
        raise DesignError(
            f"damping ratio: expected 0 to {MOST_DAMPED:g}, got {mode.damping_ratio:.3g}: the tool"
            " comes to rest by itself in a swing; filter: { kind: off }"
        )


@dataclass(frozen=True, slots=True)
class Task:
    """One tuning: sway mode, sampling, cost and requirements.

    Attributes:
        mode: sway mode of the axis.
        tick_s: Ts, the period at which the axis is sent.
        horizon_s: N Ts, the time for which the cost watches the step.
        weights: weights of Eq. 15; unused if ``length_range_pct`` is set.
        states: the states that Q weighs.
        require: requirements that every setting keeps.
        length_range_pct: if set, minimise the worst residual sway over pendulum lengths of
            -range ... +range percent, not Eq. 15; then ``max_run_on_s`` is required.

    Raises:
        DesignError: a value is out of range.
    """

    mode: SwayMode
    tick_s: float = 0.02
    horizon_s: float = 3.0
    weights: Weights = field(default_factory=Weights)
    states: States = "sway"
    require: Requirements = field(default_factory=Requirements)
    length_range_pct: float | None = None

    def __post_init__(self) -> None:
        check_swing(self.mode)
        in_range("tick", self.tick_s, 1e-3, 0.2, "s")
        in_range("horizon", self.horizon_s, max(0.2, 5.0 * self.tick_s), 60.0, "s")
        if self.states not in get_args(States):
            names = ", ".join(get_args(States))
            raise DesignError(f"states: expected one of {names}, got {self.states}")
        if self.length_range_pct is not None:
            in_range("length range", self.length_range_pct, 1.0, 60.0, "%")
            if self.require.max_run_on_s is None:
                raise DesignError(
                    "length range without a run-on: slower is always more robust, so the longest"
                    " run-on has to be given"
                )

    @property
    def samples(self) -> int:
        """N, the number of samples in the horizon."""
        return max(5, round(self.horizon_s / self.tick_s))

    @property
    def pole_count(self) -> int:
        """Number of poles of the filter, 2 or 3."""
        return 3 if self.require.third_pole else 2

    def slowest(self) -> tuple[float, str]:
        """Return the smallest allowed |pole|, rad/s, and the name of the bound that sets it."""
        far = POLE_DISTANCE * -self.mode.pole.real
        if self.require.pole_distance == "text" and far > SLOWEST_RAD_S:
            return far, "pole distance (14e)"
        return SLOWEST_RAD_S, "slowest pole of a deployment"

    def fastest(self) -> tuple[float, str]:
        """Return the largest allowed |pole|, rad/s, and the name of the bound that sets it."""
        bounds = [
            (FASTEST_RAD_S, "fastest pole of a deployment"),
            (1.0 / self.tick_s, "fastest pole of the tick"),
        ]
        if self.require.max_rate_per_s is not None:
            at_rate = math.sqrt(self.require.max_rate_per_s * self.mode.omega_rad_s)
            floor = min(SLOW_POLE_PER_RATE * at_rate, self.mode.omega_rad_s)
            bounds.append((max(POLE_PER_RATE * at_rate, floor), "rate of the valve"))
        if self.require.pole_distance == "printed":
            bounds.append((POLE_DISTANCE * -self.mode.pole.real, "pole distance (14e, printed)"))
        return min(bounds)


def lengths(range_pct: float, count: int) -> list[float]:
    """Return lengths over -range ... +range percent, as factors of the nominal length."""
    return [1.0 + range_pct / 100.0 * (2.0 * i / (count - 1) - 1.0) for i in range(count)]


def at_length(mode: SwayMode, factor: float) -> SwayMode:
    """Return the mode of the same joint and mass on a pendulum ``factor`` times as long.

    w^2 ~ 1/l and, for a constant damping of the joint, 2 zeta w = c/(m l^2) ~ 1/l^2; zeta stays
    within 0.95.
    """
    return SwayMode(
        mode.omega_rad_s / math.sqrt(factor), min(0.95, mode.damping_ratio * factor**-1.5)
    )


def longest_tail_s(mode: SwayMode) -> float:
    """Return the longest tail that the tools try: two periods, at least 5 s, at most 12 s."""
    return min(max(5.0, math.ceil(2.0 * mode.period_s)), 12.0)


def gain_at(mode: SwayMode, tick_s: float, y: Sequence[float]) -> float:
    """Return |H(e^(pT))|: the sum of a step response's increments times e^(-pT k), over its end."""
    turn, at = cmath.exp(-mode.pole * tick_s), 1.0 + 0j
    total, before = 0j, 0.0
    for value in y:
        total += (value - before) * at
        before = value
        at *= turn
    return abs(total) / abs(y[-1])
