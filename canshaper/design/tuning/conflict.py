"""Report why no setting keeps all requirements, and which values are attainable instead.

The module searches the poles on a grid that closes in on the best point; the search needs no start
and no smooth measures.
"""

import itertools
import math
from collections.abc import Callable

import numpy as np

from canshaper.design.tuning.formulation import OVER_COMMAND, SETTLED, Task
from canshaper.design.tuning.program import Program, Vector
from canshaper.errors import InfeasibleError

_ROUNDS = 4
_TOLERANCE = 1e-6


def box_conflict(task: Task) -> None:
    """Raise InfeasibleError if the bounds on single poles leave no room."""
    (low, why_low), (high, why_high) = task.slowest(), task.fastest()
    if high <= 0.0:
        raise InfeasibleError(
            "the printed sense of 14e allows no pole: the sway is undamped; use the sense of"
            " the text, or off"
        )
    if low > high:
        raise InfeasibleError(
            f"{why_low} asks for poles of {low:.3g} rad/s or faster,"
            f" {why_high} allows {high:.3g} rad/s or slower; attainable is one of them"
        )


def feasible_point(program: Program) -> Vector | None:
    """Return poles that keep all requirements, as z of ``Program``, or None."""
    limits = _limits(program.task)

    def violation(measures: dict[str, float]) -> float:
        return max((measures[name] / limit for name, (limit, _) in limits.items()), default=0.0)

    value, z = _search(program, violation)
    return z if value <= 1.0 + _TOLERANCE else None


def explain(program: Program) -> str:
    """Return which requirements conflict and the attainable value of each with the others kept."""
    limits = _limits(program.task)
    slow, fast = program.task.slowest()[0], program.task.fastest()[0]
    requirements = "; ".join(text.format(f"{limit:.3g}") for limit, text in limits.values())
    lines = [
        f"no poles of {slow:.3g} ({program.task.slowest()[1]}) to {fast:.3g} rad/s"
        f" ({program.task.fastest()[1]}) keep all of: {requirements}"
    ]
    for name, (_, text) in limits.items():
        others = {n: limit for n, (limit, _) in limits.items() if n != name}

        def value(
            measures: dict[str, float], name: str = name, others: dict[str, float] = others
        ) -> float:
            over = max((measures[n] / limit for n, limit in others.items()), default=0.0)
            return 1e6 * over if over > 1.0 + _TOLERANCE else measures[name]

        best = _search(program, value)[0]
        if best < 1e5:
            kept = "with the others kept" if others else ""
            lines.append(f"attainable {kept}: {text.format(f'{best:.3g}')}")
    return "\n".join(lines)


def _limits(task: Task) -> dict[str, tuple[float, str]]:
    """Return measure -> (limit, text of the requirement)."""
    require = task.require
    result = {}
    if require.within_command:
        top = 1.0 if task.pole_count == 2 else 1.0 + OVER_COMMAND
        what = "first jump" if task.pole_count == 2 else "largest output"
        result["peak"] = (top, what + " at most {} times the command (within the command)")
    if require.max_jump is not None:
        result["jump"] = (require.max_jump, "first jump at most {} times the command")
    if require.max_rate_per_s is not None and task.pole_count == 3:
        result["slope"] = (require.max_rate_per_s, "slope at most {} full speeds/s (valve)")
    if require.max_run_on_s is not None:
        result["run_on"] = (require.max_run_on_s, "run-on at most {} s")
    return result


def _measures(program: Program, z: Vector) -> dict[str, float]:
    task = program.task
    y = program.response(z)
    outside = np.flatnonzero(np.abs(y - 1.0) > SETTLED * (1.0 + _TOLERANCE))
    run_on = 0 if not len(outside) else int(outside[-1]) + 1
    jump = float(y[0])
    peak = float(np.max(y))
    if task.pole_count == 2:
        jump = peak = math.exp(2.0 * z[0] + z[1]) / task.mode.omega_rad_s**2
    slope = float(np.max(np.abs(np.diff(y, prepend=0.0)))) / task.tick_s
    # Not settled at the end: the slower, the worse.
    late = abs(float(y[-1]) - 1.0) * len(y) if run_on == len(y) else 0.0
    return {"peak": peak, "jump": jump, "slope": slope, "run_on": (run_on + late) * task.tick_s}


def _search(program: Program, value: Callable[[dict[str, float]], float]) -> tuple[float, Vector]:
    """Return (value, z) of the smallest value over all poles of the box."""
    n = program.size
    low, high = program.low.copy(), program.high.copy()
    top = program.high[0]
    count = (41, 13) if n == 2 else (21, 7, 7)
    best, at = math.inf, low
    for _ in range(_ROUNDS):
        axes = [np.linspace(a, b, m) for a, b, m in zip(low, high, count, strict=True)]
        for point in itertools.product(*axes):
            z = np.array(point)
            if z.sum() > top + 1e-9:
                continue
            reached = value(_measures(program, z))
            if reached < best:
                best, at = reached, z
        width = [2.0 * (b - a) / (m - 1) for a, b, m in zip(low, high, count, strict=True)]
        low = np.maximum(program.low, at - width)
        high = np.minimum(program.high, at + width)
    return best, at
