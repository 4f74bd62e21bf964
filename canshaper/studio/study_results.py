"""Figures of a study from its placements: for each person, and by pairs of settings.

Seconds are compared as logarithms: a setting shortens a placement by a percentage.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from statistics import fmean, median, stdev
from typing import Any

import numpy as np
from rich.table import Table
from scipy import stats

from canshaper import __version__
from canshaper.campaign.statistics import CONFIDENCE
from canshaper.report import html
from canshaper.report.console import new_table
from canshaper.studio.study import BROKEN, HIT, LETTERS, rows_of

Rows = Sequence[Mapping[str, str]]
SPREAD = 0.215
"""Spread of the changes of the mean logarithm from person to person, one sigma: chosen. Log
times of a simulated operator (``canshaper work``, empty grapple) have .15 to .26; changes of three
kinds of them .26."""
PAIRS = [*combinations(LETTERS, 2)]
CHANGES_PCT, PERSONS = (5, 10, 15, 20, 30), (4, 6, 8, 12, 16, 24, 36)
_AT_GRIP = (("error_m", 100.0), ("swing_deg", 1.0))
NOTE = (
    "Seconds from the first motion of the crane to the grip; s a bit: slope over log2(way / width"
    " + 1); off, swing: median when the driver gripped. Practice and what was broken off count not."
)
PAIRS_NOTE = (
    f"Changes within a person: mean and {100 * CONFIDENCE:.0f} % by the bootstrap over persons;"
    " spread: one sigma of the change of the logarithm. Power: of the paired t test at 5 %."
)


def counted(rows: Rows, letter: str) -> list[Mapping[str, str]]:
    """Return the rows of a setting that count: no practice, not aborted."""
    return [
        row
        for row in rows
        if row["setting"] == letter and row["practice"] == "0" and row["outcome"] != BROKEN
    ]


def bits(row: Mapping[str, str]) -> float:
    """Return the index of difficulty of a placement, bits (ISO 9241-411)."""
    return math.log2(float(row["distance_m"]) / float(row["width_m"]) + 1.0)


def log_s(rows: Rows) -> float:
    """Return the mean natural logarithm of the seconds of at least one row."""
    return fmean(math.log(float(row["seconds"])) for row in rows)


def person_table(rows: Rows) -> Table:
    """Return a person's figures, a row for each letter; "-" where all targets are equally hard."""
    heads = ("placed", "hit\n%", "seconds\ngeom. mean", "s a bit", "off\ncm", "swing\ndeg")
    drawn = new_table("setting", *heads, "practice", "broken off")
    for letter in LETTERS:
        of_letter, done = [r for r in rows if r["setting"] == letter], counted(rows, letter)
        cells = ["-"] * 5
        if len({bits(row) for row in done}) > 1:
            line = stats.linregress([*map(bits, done)], [float(row["seconds"]) for row in done])
            cells = [
                f"{100.0 * hits(done):.0f}",
                f"{math.exp(log_s(done)):.2f}",
                f"{line.slope:.2f}",
                *(f"{f * median(float(r[n]) for r in done):.1f}" for n, f in _AT_GRIP),
            ]
        practice = sum(r["practice"] == "1" and r["outcome"] != BROKEN for r in of_letter)
        broken = sum(row["outcome"] == BROKEN for row in of_letter)
        drawn.add_row(letter, str(len(done)), *cells, str(practice), str(broken))
    return drawn


def person_page(person: str, rows: Rows) -> str:
    """Return the text of an HTML file with a person's figures, without room for a name."""
    first = rows[0] if rows else {"study": "-", "order": "-"}
    facts = [("person", person), ("study", first["study"]), ("order", first["order"])]
    facts.append(("gripped by", ", ".join(sorted({r["input"] for r in rows if r["input"]}))))
    facts.append(("canshaper", __version__))
    parts = [html.table(person_table(rows)), html.text(NOTE)]
    return html.document("Placements", facts, parts, signed=False)


def hits(rows: Rows) -> float:
    """Return the fraction of rows, at least one, that hit."""
    return fmean(row["outcome"] == HIT for row in rows)


def complete(folder: Path, study: str, placements: int) -> tuple[dict[str, Rows], list[str]]:
    """Return by code the rows of each person who is done, and the codes of the others.

    A table FOLDER/CODE.csv is done with so many counted ``placements`` of every setting.

    Raises:
        UsageError: a table does not belong to this study.
    """
    whole: dict[str, Rows] = {}
    others = []
    for path in sorted(folder.glob("*.csv")):
        rows = rows_of(path, study)
        if all(len(counted(rows, letter)) == placements for letter in LETTERS):
            whole[path.stem] = rows
        else:
            others.append(path.stem)
    return whole, others


def changes(persons: Mapping[str, Rows], pair: tuple[str, str]) -> list[float]:
    """Return each person's change of ``log_s`` from the first letter of a pair to the second."""
    logs = ([log_s(counted(rows, letter)) for letter in pair] for rows in persons.values())
    return [after - before for before, after in logs]


def spreads(persons: Mapping[str, Rows]) -> list[float]:
    """Return the standard deviation of two or more ``changes``, at least 0.001, for each pair."""
    return [max(0.001, stdev(changes(persons, pair))) for pair in PAIRS]


def pairs_table(persons: Mapping[str, Rows], names: Mapping[str, str]) -> Table:
    """Return a table with a row for each of ``PAIRS``: mean changes within persons, with bounds.

    Args:
        persons: rows of each person, at least three; each with rows that count of every setting.
        names: names of the settings, by letter.
    """
    level = f"{100 * CONFIDENCE:.0f} %"
    drawn = new_table("from, to", "seconds, %", level, "hits, points", level, "spread of logs")
    for pair in PAIRS:
        change = changes(persons, pair)
        points = [
            100.0 * (hits(counted(rows, pair[1])) - hits(counted(rows, pair[0])))
            for rows in persons.values()
        ]
        mean, low, high = (100.0 * math.expm1(one) for one in _bounds(change))
        cells = [f"{mean:+.1f}", f"{low:+.1f}..{high:+.1f}"]
        mean, low, high = _bounds(points)
        cells += [f"{mean:+.1f}", f"{low:+.1f}..{high:+.1f}", f"{stdev(change):.2f}"]
        drawn.add_row(" to ".join(names[letter] for letter in pair), *cells)
    return drawn


def _bounds(values: Sequence[float]) -> tuple[float, float, float]:
    """Return mean, lower and upper bound (bootstrap, at ``CONFIDENCE``) of one value a person."""
    options: dict[str, Any] = {"method": "percentile", "random_state": np.random.default_rng(0)}
    result = stats.bootstrap((values,), np.mean, confidence_level=CONFIDENCE, **options)
    bounds = result.confidence_interval
    return fmean(values), float(bounds.low), float(bounds.high)


def power(persons: int, change_pct: float, spread: float) -> float:
    """Return the chance that so many persons show times shorter by change_pct: paired t, 5 %."""
    free = persons - 1
    shift = abs(math.log1p(-change_pct / 100.0)) / spread * math.sqrt(persons)
    limit = stats.t.ppf(0.5 + CONFIDENCE / 2.0, free)
    return float(stats.nct.sf(limit, free, shift))  # the wrong way it is not shown


def power_table(spread: float) -> Table:
    """Return a table of ``power``, %: a row for each number of persons, one column a change."""
    heads = (f"{change} %" for change in CHANGES_PCT)
    drawn = new_table("persons", *heads, title=f"power, %, if quicker by; spread {spread:.3f}")
    for persons in PERSONS:
        chances = (power(persons, change, spread) for change in CHANGES_PCT)
        drawn.add_row(str(persons), *(f"{100.0 * chance:.0f}" for chance in chances))
    return drawn
