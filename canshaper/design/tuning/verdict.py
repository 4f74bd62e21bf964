"""Judge a filter on its machine: the part of the swing that it leaves, and what would leave less.

That part is the larger one of a full press and a full release, through the limits of the axis
(tail, rates, smallest output) and a lagging valve, relative to the same movement without filter.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

from canshaper.config.filters import Filter
from canshaper.config.limits import Sway
from canshaper.config.source import Place
from canshaper.design.tuning.evaluate import Machine, ShaperFor, evaluate, shaper_of
from canshaper.design.tuning.formulation import MOST_DAMPED, longest_tail_s
from canshaper.machine.deployment import Deployment
from canshaper.machine.filters import every_filter
from canshaper.machine.stop_distance import output_limits, when
from canshaper.shaping.sway import SwayMode

# Parts of the swing: a good filter leaves up to GOOD; one that leaves more than USELESS is refused.
GOOD, USELESS = 0.10, 0.50
_FASTER = (1.5, 2.0, 3.0, 5.0)  # times the rate of the valve
# A change is worth naming that leaves less than this part.
_HELPS = 0.8


@dataclass(frozen=True, slots=True)
class Verdict:
    """Swing that a filter leaves, and changes that would leave less.

    Attributes:
        left: largest part of the swing that is left at the judged lengths.
        length_pct: percent by which that pendulum is longer than the sway data says.
        cures: texts of changes that would leave less; empty for a good filter.
    """

    left: float
    length_pct: float
    cures: tuple[str, ...] = ()

    @property
    def useless(self) -> bool:
        """True if the filter must not be written to the file."""
        return self.left > USELESS

    @property
    def word(self) -> str:
        """One of "good", "poor" and "useless"."""
        return "useless" if self.useless else "poor" if self.left > GOOD else "good"

    def with_cure(self, left: float, change: str) -> Self:
        """Return a copy with ``change`` as first cure, if the verdict needs one and it helps.

        Args:
            left: share of the swing that is left with the change.
            change: the change, as the subject of a sentence.
        """
        if self.left <= GOOD or left >= _HELPS * self.left:
            return self
        text = f"{change} would leave {100.0 * left:.1f} %"
        return replace(self, cures=(text, *self.cures))

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict for ``--json``."""
        return {"word": self.word, **asdict(self)}

    def __str__(self) -> str:
        at = f"a length {self.length_pct:+g} % wrong" if self.length_pct else "the right length"
        text = f"{self.word}: {100.0 * self.left:.1f} % of the swing is left at {at}"
        if self.word == "good":
            return text
        cures = (
            "; ".join(self.cures)
            or "tail, valve and stopping distance do not help: design it again"
        )
        return f"{text}, expected {100.0 * GOOD:g} % or less; {cures}"


def judge(
    mode: SwayMode, tick_s: float, shaper_for: ShaperFor, machine: Machine, range_pct: float = 0.0
) -> Verdict:
    """Judge a filter at the right length and at both ends of the range that it covers.

    Args:
        mode: sway mode of the file.
        tick_s: period of the axis, s.
        shaper_for: makes the filter on a sway model.
        machine: limits and valve behind the filter.
        range_pct: length error that the filter covers, +- percent.
    """
    lengths = (-range_pct, 0.0, range_pct) if range_pct else (0.0,)
    residuals = evaluate(mode, tick_s, shaper_for, machine, lengths).residuals
    worst = max(residuals, key=lambda one: one.machine)
    verdict = Verdict(worst.machine, worst.length_pct)
    if verdict.word == "good":
        return verdict
    if mode.damping_ratio > MOST_DAMPED:
        return replace(verdict, cures=("filter: { kind: off }: the tool comes to rest by itself",))
    if worst.length_pct:
        right = next(one.machine for one in residuals if not one.length_pct)
        verdict = verdict.with_cure(right, "the right length")

    def left_with(**changed: Any) -> float:
        other = replace(machine, limits=replace(machine.limits, **changed))
        return evaluate(mode, tick_s, shaper_for, other, (worst.length_pct,)).worst(100.0)

    if math.isfinite(machine.limits.run_on):
        verdict = verdict.with_cure(left_with(run_on=math.inf), "a stop_distance_m long enough")
    best, what = math.inf, ""
    for words, rates in _faster(machine):
        best, what = min((best, what), (left_with(**rates), words))
        if best <= GOOD:
            break
    verdict = verdict.with_cure(best, what)
    low, high = int(10.0 * machine.limits.tail_s), round(10.0 * longest_tail_s(mode))
    if low < high:
        best = left_with(tail_s=high / 10.0)
        while best <= GOOD and high - low > 1:  # the shortest that is good: halve what is between
            middle = (low + high) // 2
            left = left_with(tail_s=middle / 10.0)
            low, high, best = (low, middle, left) if left <= GOOD else (middle, high, best)
        verdict = verdict.with_cure(best, f"tail_s: {high / 10.0:g}")
    return verdict


def _faster(machine: Machine) -> Iterator[tuple[str, dict[str, Any]]]:
    limits = machine.limits
    for times in _FASTER:
        rate = times * min(limits.rise_per_s, limits.fall_per_s)
        rates = {name: max(rate, getattr(limits, name)) for name in ("rise_per_s", "fall_per_s")}
        slow = " and ".join(name for name, one in rates.items() if one > getattr(limits, name))
        yield f"a valve with {slow} of {rate:.3g}", rates


def on_axis(
    deployment: Deployment,
    axis: str,
    chosen: Filter,
    *,
    sway: Sway | None = None,
    tail_s: float | None = None,
) -> tuple[SwayMode, float, ShaperFor, Machine]:
    """Return the arguments of ``judge``, ``evaluate`` and ``press`` for a filter on a swaying axis.

    Args:
        deployment: the machine; the axis gives the limits, with its stopping distance.
        axis: name of the axis.
        sway: sway data; None for that of the axis.
        tail_s: tail in place of that of the file.
    """
    bound = deployment.axes[axis]
    sway = sway or bound.config.sway
    assert sway is not None
    limits = output_limits(bound.config, **when(deployment, axis))
    limits = limits if tail_s is None else replace(limits, tail_s=tail_s)
    tick_s = bound.period_ticks * deployment.config.tick_ms / 1000.0
    shaper = shaper_of(chosen, tick_s, bound.config.limits.slowest_per_s)
    return sway.mode(), tick_s, shaper, replace(Machine.of(bound), limits=limits)


def verdicts(deployment: Deployment) -> Iterator[tuple[Place, Verdict]]:
    """Yield (place, verdict) of each filter of a swaying axis, profiles too; none of kind "off"."""
    for name, bound in deployment.axes.items():
        for place, chosen, sway in every_filter(("axes", name), bound.config):
            if sway is not None and chosen.kind != "off":
                yield place, judged(deployment, name, chosen, sway=sway)


def judged(
    deployment: Deployment,
    axis: str,
    chosen: Filter,
    *,
    sway: Sway | None = None,
    tail_s: float | None = None,
) -> Verdict:
    """Judge a filter on an axis over the range that it was designed for; see ``on_axis``."""
    design = chosen.design()
    range_pct = (design.length_range_pct if design else None) or 0.0
    return judge(*on_axis(deployment, axis, chosen, sway=sway, tail_s=tail_s), range_pct)
