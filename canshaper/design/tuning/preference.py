"""One number from quicker to calmer, in place of weights: settings along a Pareto front.

The module measures settings on a grid of two or three real poles through the limits of the axis and
keeps those that meet the requirements. The number weighs quickness (rise and run-on) against calm
(dip and swing left). Each of the two is scaled to its span on the front, and the setting with the
smallest larger one is chosen (Chebyshev). So every setting of the front can be the answer, and a
larger number never gives a quicker setting.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

from rich.table import Table

from canshaper.design.tuning.evaluate import Evaluation, Machine, evaluate, gff
from canshaper.design.tuning.formulation import Task, in_range
from canshaper.errors import InfeasibleError
from canshaper.report.console import new_table

_LENGTHS_PCT = (-10, 0, 10)
_COUNT = 33  # 7 % apart over a span of 1 to 9
_RATIOS = (1.0, 1.4)
# The sampled response of two poles at the frequency of the sway may pass the command by so much.
_OVER = 1e-3


@dataclass(frozen=True, slots=True)
class Choice:
    """A setting of the front: its poles in rad/s, slowest first, and its measures."""

    poles_rad_s: tuple[float, ...]
    measures: Evaluation

    @property
    def felt(self) -> tuple[float, float, float, float]:
        """Rise in s, run-on in s of full speed, dip, worst swing left: less of each is better."""
        m = self.measures
        return m.rise_s, m.mean_delay_s, m.dip, m.worst()


def front(
    task: Task,
    machine: Machine,
    preference: float,
    on_progress: Callable[[float, str], None] = lambda _done, _what: None,
) -> list[Choice]:
    """Return the settings of the Pareto front, quickest first.

    Args:
        task: swing, tick and requirements; its weights and length range have no meaning here.
        machine: limits and valve behind the filter.
        preference: from 0, quickest, to 1, calmest; only its range is checked.
        on_progress: called with the part done, 0 to 1, and the name of the present step.

    Raises:
        DesignError: the preference is out of range.
        InfeasibleError: no setting keeps the requirements.
    """
    in_range("preference (0 quickest, 1 calmest)", preference, 0.0, 1.0)
    require, grid, allowed = task.require, [*_grid(task)], []
    for k, poles in enumerate(grid):
        on_progress(k / len(grid), "measuring settings")
        shaper = gff((poles[0], poles[1]), poles[2] if len(poles) == 3 else None)
        m = evaluate(task.mode, task.tick_s, shaper, machine, _LENGTHS_PCT)
        limits = (
            (m.peak, 1.0 + _OVER if require.within_command else None),
            (m.first_jump, require.max_jump),
            (m.run_on_s, require.max_run_on_s),
        )
        if all(most is None or value <= most for value, most in limits):
            allowed.append(Choice(poles, m))
    if not allowed:
        raise InfeasibleError("no poles keep all requirements; without --preference it says which")
    best = [one for one in allowed if not any(_beats(other.felt, one.felt) for other in allowed)]
    return sorted(best, key=lambda one: one.felt)


def chosen(choices: list[Choice], preference: float) -> Choice:
    """Return the setting of a front for a preference from 0, quickest, to 1, calmest."""

    def shares(first: int) -> list[float]:
        sums = [sum(one.felt[first : first + 2]) for one in choices]
        span = max(sums) - min(sums)
        return [(one - min(sums)) / (span or 1.0) for one in sums]

    def loss(pair: tuple[float, float]) -> tuple[float, float]:
        return max((1.0 - preference) * pair[0], preference * pair[1]), sum(pair)

    losses = [loss(pair) for pair in zip(shares(0), shares(2), strict=True)]
    return choices[losses.index(min(losses))]


def table(choices: list[Choice], preference: float, full_speed_m_s: float) -> Table:
    """Return the front from quick to calm as a table, with the row of this preference in bold."""
    heads = ("poles, rad/s", "rise, s", "dip, %", "run-on, m", "left, %", "±10 %")
    result = new_table("preference", *heads)
    for row in sorted({0.0, 0.25, 0.5, 0.75, 1.0, preference}):
        one = chosen(choices, row)
        poles = " ".join(f"{pole:.2f}" for pole in one.poles_rad_s)
        rise_s, run_on_s, dip, worst = one.felt
        cells = [f"{row:g}", poles, f"{rise_s:.2f}", f"{100 * dip:.0f}"]
        cells += [f"{run_on_s * full_speed_m_s:.2f}", f"{100 * one.measures.worst(0.0):.1f}"]
        style = "bold" if row == preference else None
        result.add_row(*cells, f"{100 * worst:.1f}", style=style)
    return result


def _grid(task: Task) -> Iterator[tuple[float, ...]]:
    """Yield poles in rad/s, slowest first; only with a third pole if the task requires it."""
    low, high = task.slowest()[0], task.fastest()[0]
    for k, second, third in product(range(_COUNT), _RATIOS, (None, *_RATIOS)):
        first = low * (high / low) ** (k / (_COUNT - 1))
        poles = [first, first * second, *([] if third is None else [first * second * third])]
        if len(poles) >= task.pole_count and poles[-1] <= high * (1.0 + 1e-9) and low <= high:
            yield tuple(-min(pole, high) for pole in poles)


def _beats(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return one != other and all(a <= b for a, b in zip(one, other, strict=True))
