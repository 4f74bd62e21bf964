"""The optimal tuner: Eq. 14-15 from several starts, the bounds at the optimum, and its flatness."""

import itertools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from canshaper.design.tuning.conflict import box_conflict, explain, feasible_point
from canshaper.design.tuning.formulation import FASTEST_RAD_S, POLE_DISTANCE, SLOWEST_RAD_S, Task
from canshaper.design.tuning.program import Program, Solution, Vector
from canshaper.errors import DesignError, InfeasibleError
from canshaper.shaping.shapers.gff import denominator_from_poles
from canshaper.shaping.sway import SwayMode

# "As good": what the poles may do within so much of the optimal cost.
FLAT = 0.01
# Starts that end within so much of the lowest cost ended in the same optimum.
_SAME_COST = 1e-5


@dataclass(frozen=True, slots=True)
class Tuning:
    """A setting of G_FF and how it was found.

    Attributes:
        poles_rad_s: the two poles of the filter, rad/s, slowest first.
        third_pole_rad_s: pole of the lag on the command, rad/s, or None.
        a1: coefficient of s in Eq. 13 for the two poles, s.
        a2: coefficient of s^2 in Eq. 13, s^2.
        method: "optimal" or "manual".
        cost: Eq. 15 (mean over the samples), or the worst residual if that was minimised.
        active: requirements that bound the optimum.
        ranges_rad_s: per pole, its range with the requirements kept and at most 1 % more cost, if
            the other poles follow.
        starts: number of starts.
        converged: number of starts that ended in this optimum.
        build_s: time to build the programme.
        solve_s: time to solve it, the ranges included.
    """

    poles_rad_s: tuple[float, float]
    third_pole_rad_s: float | None
    a1: float
    a2: float
    method: str
    cost: float | None = None
    active: tuple[str, ...] = ()
    ranges_rad_s: tuple[tuple[float, float], ...] = ()
    starts: int = 0
    converged: int = 0
    build_s: float = 0.0
    solve_s: float = 0.0


def tune(
    task: Task,
    starts: int | Sequence[tuple[float, ...]] = 3,
    on_progress: Callable[[float, str], None] | None = None,
) -> Tuning:
    """Solve a task.

    Args:
        task: cost and requirements.
        starts: number of starts, or the poles of each start in rad/s (negative, slowest first).
        on_progress: called with the part done, 0 to 1, and the name of the next step.

    Raises:
        InfeasibleError: no poles keep all requirements; the message has the attainable values.
        DesignError: a value is out of range, or no start converged.
    """
    report = on_progress or (lambda _done, _what: None)
    if isinstance(starts, int) and not 1 <= starts <= 1000:
        raise DesignError(f"starts: expected 1 to 1000, got {starts}")
    box_conflict(task)
    report(0.0, "building the programme")
    begin = time.perf_counter()
    program = Program(task)
    built = time.perf_counter()
    points = spread(program, starts) if isinstance(starts, int) else given(program, starts)
    ranges_at = 0.7
    solutions: list[Solution] = []
    for i, point in enumerate(points):
        report(ranges_at * i / len(points), f"start {i + 1} of {len(points)}")
        solutions.append(program.solve(point))
    good = [solution for solution in solutions if solution.success]
    if not good:
        good = [_second_try(program)]
    best = min(good, key=lambda solution: solution.cost)
    converged = sum(s.cost <= best.cost * (1.0 + _SAME_COST) + 1e-9 for s in good)
    report(ranges_at, "range of the poles")
    ranges = _ranges(program, best)
    report(1.0, "solved")
    q = _settled(program, best)
    a1, a2 = denominator_from_poles((-q[0], -q[1]))
    return Tuning(
        (-q[0], -q[1]),
        -q[2] if len(q) == 3 else None,
        a1,
        a2,
        "optimal",
        best.cost,
        best.active,
        ranges,
        len(points),
        converged,
        built - begin,
        time.perf_counter() - built,
    )


def spread(program: Program, count: int) -> list[Vector]:
    """Return starts over the whole box: slowest pole by golden section, small ratios to the rest.

    The first start lies at the frequency of the sway, where the optimum usually is.
    """
    low, high = program.low[0], program.high[0]
    swing = math.log(program.task.mode.omega_rad_s)
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    places = [min(max(swing, low), high)]
    places += [low + (high - low) * (0.2 + golden * i) % 1.0 for i in range(1, count)]
    ratios = itertools.cycle((0.1, 0.5, 0.3))
    rest = program.size - 1
    return [
        np.array([place, *[min(ratio, (high - place) / rest)] * rest])
        for place, ratio in zip(places, ratios, strict=False)
    ]


def given(program: Program, starts: Sequence[tuple[float, ...]]) -> list[Vector]:
    """Return the starts, as z, of these poles; raise DesignError where they are not negative."""
    points = []
    for poles in starts:
        if len(poles) != program.size or not all(p < 0.0 for p in poles):
            text = f"start: expected {program.size} negative poles, got {poles}"
            raise DesignError(text)
        q = np.log(np.sort(-np.array(poles)))
        points.append(np.array([q[0], *np.diff(q)]))
    return points


def _second_try(program: Program) -> Solution:
    """Solve from a feasible point of a search over all poles, or raise the reason for none."""
    point = feasible_point(program)
    if point is None:
        raise InfeasibleError(explain(program))
    solution = program.solve(point)
    if not solution.success:
        raise DesignError("the solver did not converge from any start; try more starts")
    return solution


def _ranges(program: Program, best: Solution) -> tuple[tuple[float, float], ...]:
    """Return each pole's range, slowest first, in which the cost is within ``FLAT`` of the best."""
    limit = best.cost * (1.0 + FLAT)
    result = []
    for i in range(program.size):
        ends = []
        for sign in (1.0, -1.0):
            direction = tuple(sign if j == i else 0.0 for j in range(program.size))
            end = program.solve(best.z, direction=direction, cost_limit=limit)
            z = end.z if end.success else best.z
            ends.append(-float(np.exp(np.sum(z[: i + 1]))))
        result.append((ends[0], ends[1]))
    return tuple(result)


def _settled(program: Program, best: Solution) -> list[float]:
    """Return the poles q_i; poles that the interior-point method left a hair apart become equal."""
    q = [float(x) for x in np.exp(np.cumsum(best.z))]
    for together in range(len(q), 1, -1):
        group = q[:together]
        if group[-1] / group[0] < 1.01:
            return [math.prod(group) ** (1.0 / together)] * together + q[together:]
    return q


# "Slightly less than two times the first pole."
SECOND_TO_FIRST = 1.9


def manual(mode: SwayMode) -> Tuning:
    """Return the setting of the manual rule: first pole at five times the sway pole's real part.

    Raises:
        DesignError: the sway is damped so little or so much that the poles leave the range of a
            deployment.
    """
    first = POLE_DISTANCE * mode.pole.real
    poles = first, SECOND_TO_FIRST * first
    if -first < SLOWEST_RAD_S or -poles[1] > FASTEST_RAD_S:
        ratio = SLOWEST_RAD_S / POLE_DISTANCE / mode.omega_rad_s
        raise DesignError(
            f"poles of the manual rule: expected {SLOWEST_RAD_S:g} to {FASTEST_RAD_S:g} rad/s"
            f" (damping ratio {ratio:.3g} or more), got {-first:.3g} and {-poles[1]:.3g} rad/s from"
            f" a damping ratio of {mode.damping_ratio:.3g}; the optimal method needs no damping"
        )
    a1, a2 = denominator_from_poles(poles)
    return Tuning(poles, None, a1, a2, "manual")
