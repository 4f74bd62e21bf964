"""A phone, or another gyroscope, that hangs on the tool in whatever position."""

import math
from collections.abc import Sequence

import numpy as np

from canshaper.commissioning.identification.segments import FreeSwings, find_free
from canshaper.commissioning.identification.series import Array, Series, ordered
from canshaper.commissioning.identification.table import Table
from canshaper.errors import IdentificationError

# Width of the ellipse that is swung, part of its length, from which on it is reported.
ROUND = 0.3
# Swings from the start of the best free one that are looked at for it.
SWINGS = 6


def series_of(table: Table, label: str, column: str | None, about_s: float | None = None) -> Series:
    """The swing in a table: a column, or without one what the gyroscope turns about most.

    Args:
        table: the table.
        label: state of the grapple in it.
        column: name of the column; None for the gyroscope.
        about_s: the period as far as it is known, s.

    Raises:
        IdentificationError: no such column, no gyroscope, or a clock that goes back.
    """
    if column is not None:
        name = table.column(column)
        return _series(table, label, name, table.columns[name], notes=[])
    gyroscope = table.gyroscope()
    if not gyroscope:
        raise IdentificationError(
            f"{table.path}: expected the columns of a gyroscope, got {', '.join(table.columns)};"
            " name the column of the swing with --signal AXIS=COLUMN"
        )
    # One without any number would leave none of the sum of all.
    names = [n for n in gyroscope if np.isfinite(table.columns[n]).any()]
    if not names:
        raise IdentificationError(
            f"{table.path}: expected a number in each line of {', '.join(gyroscope)}, got none; is"
            " the sensor on?"
        )
    if len(names) == 1:
        return _series(table, label, names[0], table.columns[names[0]], notes=[])
    rates = np.stack([table.columns[n] for n in names])
    direction, round_ = _direction(table, names, about_s)
    notes = []
    if round_ > ROUND:
        notes.append(
            f"{table.path}: it swings round, {100.0 * round_:.0f} % as wide as long; swing it in"
            " one direction only"
        )
    # The sign is free; the largest part counts positive.
    direction *= math.copysign(1.0, direction[int(np.argmax(np.abs(direction)))])
    parts = " ".join(
        f"{v:+.2f} {n.partition('(')[0].split()[-1]}"
        for v, n in zip(direction, names, strict=True)
        if abs(v) >= 0.05
    )
    return _series(
        table, label, f"gyroscope ({parts})", direction @ rates, notes=notes, like=names[0]
    )


def _series(
    table: Table, label: str, name: str, values: Array, *, notes: list[str], like: str | None = None
) -> Series:
    unit = table.unit(like or name)
    time, value = ordered(f"{table.path}: {name}", table.time_s, values * unit.factor)
    source = f"{table.path.name}: {name}"
    return Series(source, label, unit, time, value, notes=[*table.notes, *notes])


def _direction(table: Table, names: Sequence[str], about_s: float | None) -> tuple[Array, float]:
    """Unit vector of the axis it swings about, and how round the swing is, 0 to 1."""
    each = {n: _series(table, "", n, table.columns[n], notes=[]) for n in names}
    widest = max(float(np.std(one.value)) for one in each.values())
    best: FreeSwings | None = None
    for one in each.values():
        swings = find_free(one, about_s) if float(np.std(one.value)) > 0.3 * widest else None
        if swings and (best is None or swings.worth > best.worth):
            best = swings
    if best is None:
        spreads = np.array([float(np.std(one.value)) for one in each.values()])
        return np.asarray(spreads == spreads.max(), dtype=np.float64), 0.0
    longest = max(best.segments, key=lambda s: float(np.var(s.value)) * float(s.time_s[-1]))
    return _ellipse(list(each.values()), longest.start_s, best.period_s)


def _ellipse(columns: Sequence[Series], start_s: float, period: float) -> tuple[Array, float]:
    """Direction of a swing at its start, and the roundest that it gets: an ellipse turns."""
    omega = 2.0 * math.pi / period
    ellipses: list[tuple[float, float, Array]] = []  # length, width, direction
    for k in range(-2, 2 * SWINGS):
        at = start_s + 0.5 * period * (k + np.linspace(0.0, 3.0, 90))
        if at[0] < columns[0].time_s[0] or at[-1] > columns[0].time_s[-1]:
            continue
        waves = [np.cos(omega * at), np.sin(omega * at), np.ones_like(at), at - at.mean()]
        basis = np.stack(waves, axis=1)
        values = np.stack([np.interp(at, c.time_s, c.value) for c in columns], axis=1)
        fitted, *_ = np.linalg.lstsq(basis, values, rcond=None)
        directions, sizes, _ = np.linalg.svd(fitted[:2].T)
        ellipses.append((float(sizes[0]), float(sizes[1]), directions[:, 0]))
    if not ellipses:
        return np.eye(len(columns))[0], 0.0
    longest = max(ellipses, key=lambda f: f[0])
    widths = [
        width / max(length, 1e-12) for length, width, _ in ellipses if length > longest[0] / 3.0
    ]
    return longest[2], max(widths)
