"""Findings from the input of ``canshaper identify``: CAN logs, tables, phone, stopwatch."""

import math
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from canshaper.commissioning.identification.canlog import read_can
from canshaper.commissioning.identification.decay import free_columns
from canshaper.commissioning.identification.segments import find_free
from canshaper.commissioning.identification.series import Array, Series, Value, ordered
from canshaper.commissioning.identification.table import Table, read_table
from canshaper.commissioning.identification.verdict import SwingFinding, identify
from canshaper.commissioning.origins import origin_of
from canshaper.edit.edit import written_by
from canshaper.errors import IdentificationError, UsageError
from canshaper.machine.database import Messages
from canshaper.machine.deployment import Deployment
from canshaper.recording.tables import is_table
from canshaper.report.console import OnProgress
from canshaper_sim.axes import SWAY_SIGNALS

# A swing draws an ellipse; one that is wider than this part of its length is reported.
ROUND = 0.3
# So many swings from the start of the best free one show how wide it gets.
SWINGS = 6


def series_of(table: Table, column: str | None, about_s: float | None = None) -> Series:
    """Return the swing in a table: a column, or the rate about the axis that it turns about most.

    ``about_s`` is the approximate period, s; None where it is not known.

    Raises:
        IdentificationError: no such column, no gyroscope with numbers, or a clock that goes back.
    """
    if column is not None:
        return _series(table, table.column(column))
    gyroscope = table.gyroscope()
    if not gyroscope:
        raise IdentificationError(
            f"{table.path}: expected the columns of a gyroscope, got {', '.join(table.columns)};"
            " name the column of the swing with --signal AXIS=COLUMN"
        )
    # A column without any number would make the sum of all columns NaN.
    names = [n for n in gyroscope if np.isfinite(table.columns[n]).any()]
    if not names:
        raise IdentificationError(
            f"{table.path}: expected a number in each line of {', '.join(gyroscope)}, got none; is"
            " the sensor on?"
        )
    if len(names) == 1:
        return _series(table, names[0])
    direction, width = _direction([_series(table, n) for n in names], about_s)
    # The sign is free; the largest part counts positive.
    direction *= math.copysign(1.0, direction[int(np.argmax(np.abs(direction)))])
    parts = " ".join(
        f"{v:+.2f} {n.partition('(')[0].split()[-1]}"
        for v, n in zip(direction, names, strict=True)
        if abs(v) >= 0.05
    )
    turned = direction @ np.stack([table.columns[n] for n in names])
    one = _series(table, names[0], f"gyroscope ({parts})", turned)
    if width > ROUND:
        one.notes.append(
            f"{table.path}: it swings round, {100.0 * width:.0f} % as wide as long; swing it in"
            " one direction only"
        )
    return one


def _series(table: Table, column: str, name: str = "", values: Array | None = None) -> Series:
    """Return the series of a column, or of other values in its unit under another name."""
    unit = table.unit(column)
    name, values = (column, table.columns[column]) if values is None else (name, values)
    time, value = ordered(f"{table.path}: {name}", table.time_s, values * unit.factor)
    return Series(f"{table.path.name}: {name}", unit, time, value, notes=[*table.notes])


def _direction(columns: Sequence[Series], about_s: float | None) -> tuple[Array, float]:
    """Return the unit vector of the axis of the swing, and its width by its length, 0 to 1.

    Without a free swing these are the column that varies most, and 0.
    """
    spreads = np.array([float(np.std(one.value)) for one in columns])
    wide = [one for one, s in zip(columns, spreads, strict=True) if s > 0.3 * spreads.max()]
    free = [swings for one in wide if (swings := find_free(one, about_s))]
    if not free:
        return np.asarray(spreads == spreads.max(), dtype=np.float64), 0.0
    best = max(free, key=lambda swings: swings.worth)
    longest = max(best.segments, key=lambda s: float(np.var(s.value)) * float(s.time_s[-1]))
    return _ellipse(columns, longest.start_s, best.period_s)


def _ellipse(columns: Sequence[Series], start_s: float, period: float) -> tuple[Array, float]:
    """Return the direction of a swing where it is longest, and its largest width by length."""
    omega = 2.0 * math.pi / period
    ellipses: list[tuple[float, float, Array]] = []  # length, width, direction
    for k in range(-2, 2 * SWINGS):
        at = start_s + 0.5 * period * (k + np.linspace(0.0, 3.0, 90))
        if at[0] < columns[0].time_s[0] or at[-1] > columns[0].time_s[-1]:
            continue
        basis = free_columns(at, omega * at, np.ones_like(at))
        values = np.stack([np.interp(at, c.time_s, c.value) for c in columns], axis=1)
        fitted, *_ = np.linalg.lstsq(basis, values, rcond=None)
        directions, sizes, _ = np.linalg.svd(fitted[:2].T)
        ellipses.append((float(sizes[0]), float(sizes[1]), directions[:, 0]))
    if not ellipses:
        return np.eye(len(columns))[0], 0.0
    longest = max(ellipses, key=lambda f: f[0])
    widths = [w / max(length, 1e-12) for length, w, _ in ellipses if length > longest[0] / 3.0]
    return longest[2], max(widths)


# Name of the axis where neither a deployment nor an option names one.
UNNAMED = "swing"
# Standard deviations: of a hand at start and end, s, and of an eye, part of the angle.
_HAND_S = 0.15
_EYE_PART = 0.1
_FACTOR = 1.96


def stopwatch(
    swings: float, seconds: float, first_deg: float, last_deg: float
) -> tuple[Value, Value]:
    """Return period of small swings, s, and damping ratio, out of what a person measured.

    Args:
        swings: full swings (there and back) that were counted.
        seconds: how long they took.
        first_deg, last_deg: amplitudes at start and end, from rest to one side.

    Raises:
        IdentificationError: a number makes no swing, or too few swings were counted.
    """
    if not swings >= 3:
        raise IdentificationError(f"--swings: expected 3 or more, better 10, got {swings:g}")
    if not 0.15 <= seconds / swings <= 25.0:
        text = f"{seconds / swings:g} s, of {seconds:g} s for {swings:g} swings"
        raise IdentificationError(f"--seconds: expected 0.15 to 25 s a swing, got {text}")
    if not 0.0 < last_deg <= first_deg <= 60.0:
        raise IdentificationError(
            "--first, --last: expected up to 60 degrees, the last one above 0 and not larger than"
            f" the first, got {first_deg:g} and {last_deg:g}"
        )
    decrement = (math.log(first_deg) - math.log(last_deg)) / swings
    ratio = decrement / math.hypot(2.0 * math.pi, decrement)
    # Mean of (1 + A^2/16) over the counted swings: the amplitude falls exponentially.
    square = math.radians(first_deg) ** 2
    if decrement > 0.0:
        square *= -math.expm1(-2.0 * decrement * swings) / (2.0 * decrement * swings)
    period = seconds / swings / (1.0 + square / 16.0)
    period_half = _FACTOR * math.sqrt(2.0) * _HAND_S / swings
    ratio_half = _FACTOR * math.sqrt(2.0) * _EYE_PART / (2.0 * math.pi * swings)
    return Value(period, period_half), Value(ratio, ratio_half)


def timed_by_hand(timed: dict[str, float | None], logs: Sequence[str], axis: str) -> SwingFinding:
    """Return the finding of numbers for ``stopwatch``, by option; UsageError for None, or a log."""
    missing = [name for name, value in timed.items() if value is None]
    if missing or logs:
        got = f"none of {', '.join(missing)}" if missing else f"the log {logs[0]}"
        raise UsageError(f"expected {', '.join(timed)} together, and no log, got {got}")
    period, ratio = stopwatch(*(v for v in timed.values() if v is not None))
    return SwingFinding(axis, "", None, [], period_s=period, damping_ratio=ratio)


def axis_named(axis: str | None, deployment: Deployment | None) -> str:
    """Return an axis of the deployment, else UsageError; without deployment any, or "swing"."""
    if deployment is None:
        return axis or UNNAMED
    if axis not in deployment.axes:
        got = repr(axis) if axis else "none"
        names = ", ".join(deployment.axes)
        raise UsageError(f"--axis: expected an axis, got {got}; there are {names}")
    return axis


def signals_named(pairs: Sequence[str], deployment: Deployment | None) -> dict[str, str]:
    """Return the signal of each axis, out of AXIS=NAME; UsageError for another form or a second."""
    signals: dict[str, str] = {}
    for pair in pairs:
        axis, _, name = pair.partition("=")
        if not (axis and name):
            raise UsageError(f"--signal: expected AXIS=NAME, got {pair!r}")
        if axis in signals:
            raise UsageError(f"--signal: expected one signal of {axis}, got two")
        signals[axis_named(axis, deployment)] = name
    return signals


def logged(
    logs: Sequence[str],
    signals: dict[str, str],
    deployment: Deployment | None,
    messages: Messages,
    *,
    on_progress: OnProgress,
    axis: str | None = None,
    channel: str | None = None,
    about_s: float | None = None,
) -> list[SwingFinding]:
    """Return the findings of logs (LOG or LABEL=LOG), one for each axis and label.

    A label that is a number is the load state where the log has none. For the options see
    ``read_can`` and ``find_free``.
    """
    if not logs:
        raise UsageError(
            "expected a log or a stopwatch, got neither; see canshaper identify --help"
        )
    series: dict[tuple[str, str], list[Series]] = {}
    for label, path in map(_labelled, logs):
        report = partial(on_progress, what=path.name)
        if is_table(path):
            table = read_table(path, report)
            axes = [*signals] or [axis_named(axis, deployment)]
            shown = {a: series_of(table, signals.get(a), about_s) for a in axes}
        else:
            names = signals or simulated_signals(deployment, messages, axis)
            if not names:
                text = "expected --signal AXIS=MESSAGE.SIGNAL with what shows the swing, got none"
                raise UsageError(text)
            known: dict[str, Any] = {"deployment": deployment, "channel": channel}
            shown = read_can(path, names, messages, **known, on_progress=report)
        for name, one in shown.items():
            series.setdefault((name, label), []).append(one)
    findings = []
    for (name, label), parts in series.items():
        on_progress(0.5, f"{name} {label}")
        finding = identify(name, label, parts, about_s or _slower_s(deployment, name))
        if finding.at is None:
            with suppress(ValueError):
                finding.at = float(label)
        findings.append(finding)
    return findings


def _slower_s(deployment: Deployment | None, axis: str) -> float | None:
    """Return the file's period, s, where its filter covers a second mode, which may swing too."""
    bound = deployment.axes.get(axis) if deployment else None
    design = bound.config.filter.design() if bound else None
    sway = bound.config.sway if bound and design and design.second else None
    return sway.mode().period_s if sway else None


def measured_in(logs: Sequence[str], messages: Messages) -> dict[str, Any]:
    """Return the origin of values from logs, or of a stopwatch, whose crane is not known."""
    if not logs:
        return written_by("identify", simulated=None, log="stopwatch")
    return origin_of("identify", paths_of(logs), messages)


def paths_of(logs: Sequence[str]) -> list[Path]:
    """Return the paths of "LABEL=LOG"."""
    return [_labelled(log)[1] for log in logs]


def _labelled(text: str) -> tuple[str, Path]:
    """Return label and path of "LABEL=LOG"; an existing file with that name has no label."""
    label, equals, rest = text.partition("=")
    if not equals or Path(text).exists():
        return "", Path(text)
    return label, Path(rest)


def simulated_signals(
    deployment: Deployment | None, messages: Messages, axis: str | None = None
) -> dict[str, str]:
    """Return the swing signals of the simulated crane by axis, where the DBC files have them."""
    moves = deployment.coordinates if deployment else {one: one for one in SWAY_SIGNALS}
    return {
        a: signal
        for a, m in moves.items()
        if axis in (None, a)
        and (signal := SWAY_SIGNALS.get(m))
        and not isinstance(messages.find(signal.partition(".")[0]), str)
    }
