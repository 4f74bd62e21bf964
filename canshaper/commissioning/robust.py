"""The robust shaper of an axis: designed for its swing in the file, or for each load."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from canshaper.commissioning.robust_task import RobustTask, between, following, second_of
from canshaper.config.filters import Filter, filter_of
from canshaper.config.limits import Sway
from canshaper.design.profiles import swinging_axis
from canshaper.design.tuning.evaluate import LENGTHS_PCT, Evaluation, evaluate
from canshaper.design.tuning.formulation import check_swing
from canshaper.design.tuning.robust import LEAST_TAP, RobustShaper, least_residual, shortest
from canshaper.design.tuning.verdict import GOOD, Verdict, judge
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.registry import KINDS

# Least taps of a shaper for lengths. A smaller one leaves less of the swing, but a tap of the
# joystick may become several movements; through the limits the smallest is not always the best.
_LEAST_TAPS = (LEAST_TAP, LEAST_TAP / 3.0, 0.0)
# Length of the response in swings: with a range that of ZVD, which is zero twice in its middle.
_SWINGS, _SWINGS_OF_RANGE = 0.77, 1.0
_LONGER = (1.15, 1.3, 1.5, 2.0)  # times the duration of a shaper that leaves too much
_MOST_TAPS = max(one.entries[1] for one in KINDS["robust"].parameters if one.entries)
# The responses for several loads begin alike for so long: a load that becomes known so late in a
# movement then changes no output. It costs the longer ones next to nothing.
_ALIKE_S = 0.5


@dataclass(frozen=True)
class RobustDesign:
    """A robust shaper that was designed for an axis.

    Attributes:
        task: its requirements.
        measured: what it leaves through the limits of the machine.
        without: shaper of the same task without its second mode.
        first: taps with which it had to begin.
        shortest: whether a residual set its duration.
    """

    task: RobustTask
    shaper: RobustShaper
    measured: Evaluation
    without: RobustShaper
    first: Sequence[float] = ()
    shortest: bool = False

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict on the shaper over its lengths; it names a longer shaper that is good, if any."""
        task, shaper = self.task, self.shaper
        setup = task.mode, task.tick_s, task.in_file(shaper), task.machine_of(shaper)
        verdict = judge(*setup, task.range_pct)
        if verdict.word == "good" or self.shortest:
            return verdict
        return _with_longer(task, shaper, verdict, self.first)

    @property
    def bound(self) -> BoundAxis:
        """The axis that it is for."""
        return self.task.bound

    @property
    def section(self) -> dict[str, Any]:
        """The filter section of the file."""
        return self.task.section(self.shaper)

    @property
    def chosen(self) -> Filter:
        """The filter as the file describes it."""
        return filter_of(**self.section)

    @property
    def needed_s(self) -> float | None:
        """Tail that it needs, s, where that of the file is shorter; else None."""
        lasts_s = self.task.lasts * self.shaper.duration_s
        return round(lasts_s + 0.1, 1) if self.bound.config.limits.tail_s < lasts_s else None

    @property
    def reversal_s(self) -> float | None:
        """``reversal_s`` that its second mode needs, where that of the file is less; else None."""
        design = self.chosen.design()
        return design.reversal_s(self.bound.config.limits) if design else None


def design_robust(
    deployment: Deployment,
    axis: str,
    *,
    at: int | None = None,
    range_pct: float = 15.0,
    lengths_m: tuple[float, float] | None = None,
    duration_s: float | None = None,
    residual_pct: float | None = None,
    second: str | None = None,
    first: Sequence[float] = (),
) -> RobustDesign:
    """Design the shaper of an axis.

    Args:
        deployment, axis: the machine, and the name of an axis with sway data.
        at: number of a breakpoint in the gain schedule; None for the axis' own filter.
        range_pct: lengths of the pendulum that it covers, +- %.
        lengths_m: instead: shortest and longest pendulum that it covers; for an axis that follows
            its rope the ends of that, of which it is designed for the shortest.
        duration_s: length of its impulse response; None for 0.77 of a swing, one with lengths.
        residual_pct: instead: part of the swing that the shortest such shaper may leave.
        second: a second mode as the option --second has it; None for that of the filter in the
            file.
        first: taps with which it begins, where it has a duration.

    Raises:
        DesignError: the axis has no sway data.
        UsageError: there is no such shaper, or the options contradict each other.
    """
    bound, sway = swinging_axis(deployment, axis)
    sway = sway if at is None else bound.config.gain_schedule[at].sway
    tick_ms = bound.period_ticks * deployment.config.tick_ms
    task = RobustTask(bound, at, sway.mode(), tick_ms, range_pct)
    if bound.rope:
        task, lengths_m = following(task, sway, lengths_m), None
    if lengths_m is not None:
        task = between(task, sway, lengths_m)
    if residual_pct is not None and duration_s is not None:
        raise UsageError("expected one of --duration and --residual, got both")
    task = replace(task, second=second_of(second, task))
    mode, tick_s, range_pct = task.mode, task.tick_s, task.range_pct
    swings = _SWINGS_OF_RANGE if lengths_m else _SWINGS
    length_s = duration_s or round(swings * mode.period_s / tick_s) * tick_s

    def design(task: RobustTask, least_tap: float) -> RobustShaper:
        given = task.requirements()
        if residual_pct is not None:
            return shortest(mode, residual_pct=residual_pct, **given)
        return least_residual(mode, duration_s=length_s, least_tap=least_tap, first=first, **given)

    lengths_pct = [0.5 * k * range_pct for k in range(-2, 3)] if lengths_m else LENGTHS_PCT
    try:
        check_swing(mode)
        shapers = [design(task, one) for one in _LEAST_TAPS[: 3 if lengths_m else 1]]
        without = design(replace(task, second=None), LEAST_TAP) if task.second else shapers[0]
        measures = [
            evaluate(mode, tick_s, task.in_file(one), task.machine_of(one), lengths_pct)
            for one in shapers
        ]
    except ValueError as error:
        raise UsageError(f"axis {axis}: {error}") from None
    best = min(range(len(shapers)), key=lambda k: measures[k].worst(range_pct))
    is_shortest = residual_pct is not None
    return RobustDesign(task, shapers[best], measures[best], without, first, is_shortest)


def _with_longer(
    task: RobustTask, shaper: RobustShaper, verdict: Verdict, first: Sequence[float]
) -> Verdict:
    """Return the verdict, which names the first of some longer responses that is good, if any."""
    for times in _LONGER:
        seconds = round(times * shaper.duration_s / task.tick_s) * task.tick_s
        if round(seconds / task.tick_s) + 1 > _MOST_TAPS:
            break  # of a file
        given = task.requirements()
        longer = least_residual(task.mode, duration_s=seconds, first=first, **given)
        machine = task.machine(seconds + 0.1)
        judged = judge(task.mode, task.tick_s, task.in_file(longer), machine, task.range_pct)
        if judged.left <= GOOD:
            return verdict.with_cure(judged.left, f"--duration {seconds:.2g}")
    return verdict


def design_loads(
    deployment: Deployment, axis: str, *, duration_s: float | None, **options: Any
) -> list[RobustDesign]:
    """Design the shaper of every breakpoint of an axis, and its own one in place of another kind.

    ``duration_s`` is for the shortest swing, which comes first; others get more in proportion.
    ``options`` are those of ``design_robust``.

    Raises:
        UsageError: there is no gain schedule, or no such shaper.
    """
    bound, own = swinging_axis(deployment, axis)
    config = bound.config
    if not config.gain_schedule:
        raise UsageError(f"--loads: expected a gain_schedule with the swing of each load at {axis}")
    swings: dict[int | None, Sway] = {None: own} if config.filter.kind != "robust" else {}
    swings |= {i: one.sway for i, one in enumerate(config.gain_schedule)}
    periods_s = {at: sway.mode().period_s for at, sway in swings.items()}
    first: Sequence[float] = ()
    designs = []
    for at, period_s in sorted(periods_s.items(), key=lambda one: one[1]):
        lasts_s = duration_s and duration_s * period_s / min(periods_s.values())
        one = design_robust(deployment, axis, at=at, duration_s=lasts_s, first=first, **options)
        first = first or one.shaper.taps[: round(_ALIKE_S / one.task.tick_s)]
        designs.append(one)
    return designs
