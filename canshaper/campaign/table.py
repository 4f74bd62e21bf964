"""A campaign on the terminal."""

from collections.abc import Iterator, Mapping

from rich.table import Table

from canshaper.campaign.statistics import CONFIDENCE, Quantile
from canshaper.campaign.summary import FIRST, Difference, Summary
from canshaper.report.console import new_table

_SHOWN = ("p50", "p95", "p99")
_INFLUENCES = 5
_SURE = f"{100 * CONFIDENCE:g} %"


def tables(summary: Summary) -> Iterator[Table]:
    """Quantiles without and with faults, what explains the residual, the worst drives."""
    counts = summary.counts
    for title, quantiles, count in (
        ("no fault", summary.quantiles, counts["without_fault"]),
        ("faults", summary.faulty, counts["with_fault"]),
    ):
        if quantiles:
            drawn = new_table(f"{title}: {count} drives", *_SHOWN)
            for measure, one in quantiles.items():
                drawn.add_row(measure, *(_cell(one[name]) for name in _SHOWN))
            yield drawn
    if explained := summary.influences[FIRST]:
        drawn = new_table(f"what drives {FIRST}", "explains", "trend")
        for factor in explained[:_INFLUENCES]:
            trend = "" if factor.trend is None else f"{factor.trend:+.2f}"
            drawn.add_row(factor.name, f"{100 * factor.explained:.0f} %", trend)
        yield drawn
    if summary.worst:
        drawn = new_table("worst", "seed", "left, deg", "peak, deg", "run-on, s")
        for row in summary.worst:
            figures = [row[name] or 0.0 for name in ("residual_deg", "peak_deg", "run_on_s")]
            drawn.add_row(row["operator"], str(row["seed"]), *(f"{one:.2f}" for one in figures))
        yield drawn


def lines(summary: Summary) -> Iterator[str]:
    """What the tables do not say: promises, the verdict."""
    promises = summary.promises
    yield f"In brackets: bounds with {_SURE} confidence; ?: too few drives for one"
    yield (
        f"Promises: {promises.broken} of {promises.drives} drives broke one;"
        f" with {_SURE} confidence at most {promises.most:.2g} of all drives do"
    )
    if promises.why:
        yield f"  first: {promises.why}"
    if over := summary.counts["swung_over"]:
        yield f"The grapple swung above the horizontal in {over} drives: their figures say nothing"
    for one in summary.verdicts:
        verdict = "kept" if one.kept else "NOT SHOWN"
        if one.quantile.low is not None and one.quantile.low > one.limit:
            verdict = "EXCEEDED"
        yield f"accept.{one.key}: {_cell(one.quantile)}, expected at most {one.limit:g}: {verdict}"


def difference_table(differences: Mapping[str, Difference]) -> Table:
    """Two files over the same drives."""
    drawn = new_table("second - first", "first p99", "second p99", "median", "less in")
    for measure, one in differences.items():
        drawn.add_row(
            measure,
            f"{one.first['p99'].value:.2f}",
            f"{one.second['p99'].value:.2f}",
            _cell(one.median),
            f"{100 * one.better:.0f} %",
        )
    return drawn


def _cell(one: Quantile) -> str:
    low, high = ("?" if bound is None else f"{bound:.3g}" for bound in (one.low, one.high))
    return f"{one.value:.3g} ({low}..{high})"
