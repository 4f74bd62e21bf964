"""A phone, or another gyroscope, that hangs on the tool in whatever position."""

import math
from collections.abc import Sequence

import numpy as np

from canshaper.commissioning.identification.segments import find_free
from canshaper.commissioning.identification.series import Array, Series, ordered
from canshaper.commissioning.identification.table import Table
from canshaper.errors import IdentificationError

# Width of the ellipse that is swung, part of its length, from which on it is reported.
ROUND = 0.3
# Swings from the start of the best free one that are looked at for it.
SWINGS = 6


def series_of(table: Table, label: str, column: str | None, about_s: float | None = None) -> Series:
    """The swing in a table: a column, or without one what the gyroscope turns about most.

    ``about_s``: the period as far as it is known, s.

    Raises:
        IdentificationError: no such column, no gyroscope, or a clock that goes back.
    """
    if column is not None:
        return _series(table, label, table.column(column))
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
        return _series(table, label, names[0])
    direction, width = _direction([_series(table, label, n) for n in names], about_s)
    # The sign is free; the largest part counts positive.
    direction *= math.copysign(1.0, direction[int(np.argmax(np.abs(direction)))])
    parts = " ".join(
        f"{v:+.2f} {n.partition('(')[0].split()[-1]}"
        for v, n in zip(direction, names, strict=True)
        if abs(v) >= 0.05
    )
    turned = direction @ np.stack([table.columns[n] for n in names])
    one = _series(table, label, names[0], f"gyroscope ({parts})", turned)
    if width > ROUND:
        one.notes.append(
            f"{table.path}: it swings round, {100.0 * width:.0f} % as wide as long; swing it in"
            " one direction only"
        )
    return one


def _series(
    table: Table, label: str, column: str, name: str = "", values: Array | None = None
) -> Series:
    """A column, or other values in its unit, under a name of their own."""
    unit = table.unit(column)
    name, values = (column, table.columns[column]) if values is None else (name, values)
    time, value = ordered(f"{table.path}: {name}", table.time_s, values * unit.factor)
    return Series(f"{table.path.name}: {name}", label, unit, time, value, notes=[*table.notes])


def _direction(columns: Sequence[Series], about_s: float | None) -> tuple[Array, float]:
    """Unit vector of the axis it swings about, and how round the swing is, 0 to 1."""
    spreads = np.array([float(np.std(one.value)) for one in columns])
    wide = [one for one, s in zip(columns, spreads, strict=True) if s > 0.3 * spreads.max()]
    free = [swings for one in wide if (swings := find_free(one, about_s))]
    if not free:
        return np.asarray(spreads == spreads.max(), dtype=np.float64), 0.0
    best = max(free, key=lambda swings: swings.worth)
    longest = max(best.segments, key=lambda s: float(np.var(s.value)) * float(s.time_s[-1]))
    return _ellipse(columns, longest.start_s, best.period_s)


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
    widths = [w / max(length, 1e-12) for length, w, _ in ellipses if length > longest[0] / 3.0]
    return longest[2], max(widths)
