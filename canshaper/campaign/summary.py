"""Summary of a campaign: quantiles, broken promises, the worst drives, the verdict."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.table import Table

from canshaper.campaign.statistics import (
    CONFIDENCE,
    Columns,
    Difference,
    Influence,
    Quantile,
    influences,
    most_of,
    named_quantiles,
)
from canshaper.config.desk import MEASURES
from canshaper.report.console import new_table

# Columns that are not drawn.
_OUTCOMES = ("seed", *MEASURES, "raw_deg", "broken", "why", "swung_over", "fault", "engine")
WORST = 10
# A drive is worse than with anti-sway off where it leaves so much more swing, deg.
MORE_DEG = 0.3
# The measure that orders the worst drives, and whose factors are shown.
FIRST = "residual_deg"


@dataclass(frozen=True)
class Promises:
    """Drives in which the gate refused a valve frame.

    Attributes:
        drives: number of drives with a gate, with and without faults.
        broken: number of drives with a refused frame.
        most: upper bound of their share of all drives.
        why: seed, time and reason of the first one; "" where there is none.
    """

    drives: int
    broken: int
    most: float
    why: str


@dataclass(frozen=True)
class Worse:
    """Drives without a fault that leave over ``MORE_DEG`` more swing than with anti-sway off.

    Attributes:
        drives: number of drives that were also driven with anti-sway off.
        worse: number of drives that leave more swing.
        low, high: bounds of their share.
        seeds: seeds of the five worst, each with its swing and that with anti-sway off, deg.
    """

    drives: int
    worse: int
    low: float
    high: float
    seeds: Sequence[tuple[int, float, float]]


@dataclass(frozen=True)
class Verdict:
    """Verdict on one limit of the file.

    Attributes:
        key: key of the limit in ``accept``.
        limit: largest value that is accepted.
        quantile: quantile of the drives.
        kept: the upper bound of the quantile is within the limit; False where there is no bound.
    """

    key: str
    limit: float
    quantile: Quantile
    kept: bool


@dataclass(frozen=True)
class Summary:
    """Summary of all drives of a campaign.

    Attributes:
        quantiles: quantiles of the drives without a fault, by measure and name.
        faulty: quantiles of the drives with a fault.
        counts: number of drives: without_fault, with_fault, and of both together swung_over.
        engines: number of drives by engine: native, python, both.
        promises, worse: see their classes.
        influences: factors by measure, the one that explains most first.
        worst: the ten drives without a fault that leave the most swing.
        verdicts: one for each limit of the file.
    """

    quantiles: Mapping[str, Mapping[str, Quantile]]
    faulty: Mapping[str, Mapping[str, Quantile]]
    counts: Mapping[str, int]
    engines: Mapping[str, int]
    promises: Promises
    worse: Worse
    influences: Mapping[str, Sequence[Influence]]
    worst: Sequence[Mapping[str, Any]]
    verdicts: Sequence[Verdict]

    @property
    def accepted(self) -> bool:
        """Whether no promise was broken, and every limit is shown to be kept."""
        return not self.promises.broken and all(one.kept for one in self.verdicts)

    def as_dict(self) -> dict[str, Any]:
        """Return the summary for JSON."""
        return {**asdict(self), "accepted": self.accepted}


def summarise(columns: Columns, accept: Mapping[str, float]) -> Summary:
    """Summarise all drives.

    Args:
        columns: columns of all drives, see ``Store.columns``.
        accept: limits by their keys in the file.
    """
    faults = columns["fault"]
    sound = _where(columns, [not fault for fault in faults])
    faulty = _where(columns, [bool(fault) for fault in faults])
    of_sound = _quantiles(sound)
    broken = [k for k, count in enumerate(columns["broken"]) if count]
    engines = dict(Counter(columns["engine"]))
    drives = len(columns["seed"]) - engines.get("native", 0)
    why = f"drive {columns['seed'][broken[0]]} at {columns['why'][broken[0]]}" if broken else ""
    factors = {name: column for name, column in sound.items() if name not in _OUTCOMES}
    return Summary(
        of_sound,
        _quantiles(faulty),
        {
            "without_fault": len(sound["seed"]),
            "with_fault": len(faulty["seed"]),
            "swung_over": sum(columns["swung_over"]),
        },
        engines,
        Promises(drives, len(broken), most_of(len(broken), drives), why),
        _worse(sound),
        {measure: influences(factors, sound[measure]) for measure in MEASURES},
        worst(sound),
        [_verdict(key, limit, of_sound) for key, limit in accept.items()],
    )


def _worse(columns: Columns) -> Worse:
    """Compare each drive with the same drive with anti-sway off."""
    of = columns["seed"], columns[FIRST], columns.get("raw_deg", [None] * len(columns["seed"]))
    pairs = [(s, a, b) for s, a, b in zip(*of, strict=True) if a is not None and b is not None]
    worse = sorted((one for one in pairs if one[1] > one[2] + MORE_DEG), key=lambda o: o[2] - o[1])
    count, drives = len(worse), len(pairs)
    two_sided = 0.5 * (1.0 + CONFIDENCE)
    high = most_of(count, drives, confidence=two_sided)
    low = 1.0 - most_of(drives - count, drives, confidence=two_sided)
    return Worse(drives, count, low, high, worse[:5])


def _where(columns: Columns, keep: Sequence[bool]) -> dict[str, list[Any]]:
    return {
        name: [value for value, kept in zip(column, keep, strict=True) if kept]
        for name, column in columns.items()
    }


def _quantiles(columns: Columns) -> dict[str, dict[str, Quantile]]:
    """Return the quantiles by measure and name; leave out a measure that no drive has."""
    had = {one: [value for value in columns[one] if value is not None] for one in MEASURES}
    return {measure: named_quantiles(values) for measure, values in had.items() if values}


def worst(columns: Columns) -> list[dict[str, Any]]:
    """Return the ten drives without a fault that leave the most swing, the worst one first."""
    faults = columns["fault"]
    order = sorted(
        (k for k, value in enumerate(columns[FIRST]) if value is not None and not faults[k]),
        key=lambda k: -columns[FIRST][k],
    )
    names = ("seed", *MEASURES, "operator")
    return [{name: columns[name][k] for name in names} for k in order[:WORST]]


def _verdict(key: str, limit: float, quantiles: Mapping[str, Mapping[str, Quantile]]) -> Verdict:
    measure, _, name = key.rpartition("_")
    one = quantiles.get(measure, {}).get(name, Quantile(0.0, None, None))
    return Verdict(key, limit, one, one.high is not None and one.high <= limit)


_SHOWN = ("p50", "p95", "p99")
_INFLUENCES = 5
_SURE = f"{100 * CONFIDENCE:g} %"


def tables(summary: Summary) -> Iterator[Table]:
    """Yield the tables: quantiles without and with faults, factors, the worst drives."""
    counts = summary.counts
    for title, quantiles, count in (
        ("no fault", summary.quantiles, counts["without_fault"]),
        ("faults", summary.faulty, counts["with_fault"]),
    ):
        if quantiles:
            drawn = new_table(f"{title}: {count} drives", *_SHOWN)
            for measure, one in quantiles.items():
                drawn.add_row(measure, *(str(one[name]) for name in _SHOWN))
            yield drawn
    if explained := summary.influences[FIRST]:
        drawn = new_table(f"what drives {FIRST}", "explains", "trend")
        for factor in explained[:_INFLUENCES]:
            trend = "" if factor.trend is None else f"{factor.trend:+.2f}"
            drawn.add_row(factor.name, f"{100 * factor.explained:.0f} %", trend)
        yield drawn
    if summary.worst:
        drawn = new_table("worst", "seed", "still, s", "left, deg", "peak, deg", "run-on, s")
        shown = ("still_s", "residual_deg", "peak_deg", "run_on_s")
        for row in summary.worst:
            figures = ("-" if row[name] is None else f"{row[name]:.2f}" for name in shown)
            drawn.add_row(row["operator"], str(row["seed"]), *figures)
        yield drawn


def lines(summary: Summary) -> Iterator[str]:
    """Yield the lines of text: engines, promises, drives that are worse, verdicts."""
    promises, engines = summary.promises, summary.engines
    drives = ", ".join(f"{count} {name}" for name, count in sorted(engines.items()))
    yield f"Drives by engine: {drives}; the gate sees all but native"
    yield f"In brackets: bounds with {_SURE} confidence; ?: too few drives for one"
    yield (
        f"Promises: {promises.broken} of {promises.drives} drives broke one;"
        f" with {_SURE} confidence at most {promises.most:.2g} of all drives do"
    )
    if promises.why:
        yield f"  first: {promises.why}"
    if (worse := summary.worse).drives:
        share = f"{100 * worse.worse / worse.drives:.2g} %"
        bounds = f"{100 * worse.low:.2g}..{100 * worse.high:.2g}"
        yield (
            f"Worse than with anti-sway off, by more than {MORE_DEG:g} deg: {worse.worse} of"
            f" {worse.drives} drives, {share} ({bounds})"
        )
        for seed, left, raw in worse.seeds:
            yield f"  drive {seed}: {left:.2f} deg, with anti-sway off {raw:.2f}"
    if over := summary.counts["swung_over"]:
        yield f"The grapple swung above the horizontal in {over} drives, which end and count there"
    for one in summary.verdicts:
        verdict = "kept" if one.kept else "NOT SHOWN"
        if one.quantile.low is not None and one.quantile.low > one.limit:
            verdict = "EXCEEDED"
        yield f"accept.{one.key}: {one.quantile}, expected at most {one.limit:g}: {verdict}"


def difference_table(differences: Mapping[str, Difference]) -> Table:
    """Return the table that compares two files over the same drives."""
    drawn = new_table("second - first", "first p99", "second p99", "median", "less in")
    for measure, one in differences.items():
        drawn.add_row(
            measure,
            f"{one.first['p99'].value:.2f}",
            f"{one.second['p99'].value:.2f}",
            str(one.median),
            f"{100 * one.better:.0f} %",
        )
    return drawn
