"""Input of ``canshaper identify``, logs and tables or a stopwatch, to findings."""

import math
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from canshaper.commissioning.calibration.write import pair_of, pump_lines, speed_signal
from canshaper.commissioning.identification.canlog import is_simulated, read_can
from canshaper.commissioning.identification.phone import series_of
from canshaper.commissioning.identification.series import Series, Value
from canshaper.commissioning.identification.table import is_table, read_table
from canshaper.commissioning.identification.verdict import Finding, identify
from canshaper.config.origin import written_by
from canshaper.errors import ConfigError, IdentificationError, UsageError
from canshaper.machine.database import Messages, load_dbc
from canshaper.machine.deployment import Deployment
from canshaper.report.console import OnProgress
from canshaper.shipped import data_directory

# Swing of each axis as `canshaper sim` sends it.
_PARALLEL = ("near_far", "lift_cylinder", "knuckle", "extension")
SIMULATED = {
    "slew": "GrappleSway.SwayPerpendicular",
    **dict.fromkeys(_PARALLEL, "GrappleSway.SwayParallel"),
}
# Name of the axis where neither a deployment nor an option names one.
UNNAMED = "swing"
# What a hand adds at either end, and an eye to an angle, as standard deviations.
_HAND_S = 0.15
_EYE_PART = 0.1
_FACTOR = 1.96


def stopwatch(
    swings: float, seconds: float, first_deg: float, last_deg: float
) -> tuple[Value, Value]:
    """Period of small swings in s, and damping ratio.

    Of full swings (there and back) that were counted, and the seconds that they took; amplitudes at
    the start and at the end are from rest to one side, in degrees.

    Raises:
        IdentificationError: a number makes no swing, or too few swings were counted.
    """
    if not swings >= 3:
        raise IdentificationError(f"--swings: expected 3 or more, better 10, got {swings:g}")
    if not 0.15 <= seconds / swings <= 12.0:
        text = f"{seconds / swings:g} s, of {seconds:g} s for {swings:g} swings"
        raise IdentificationError(f"--seconds: expected 0.15 to 12 s a swing, got {text}")
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


def timed_by_hand(timed: dict[str, float | None], logs: Sequence[str], axis: str) -> Finding:
    """Return the finding of a stopwatch."""
    missing = [name for name, value in timed.items() if value is None]
    if missing or logs:
        got = f"none of {', '.join(missing)}" if missing else f"the log {logs[0]}"
        raise UsageError(f"expected {', '.join(timed)} together, and no log, got {got}")
    period, ratio = stopwatch(*(v for v in timed.values() if v is not None))
    return Finding(axis, "", None, [], period_s=period, damping_ratio=ratio)


def axis_named(axis: str | None, deployment: Deployment | None) -> str:
    """The axis of data that names none."""
    if deployment is None:
        return axis or UNNAMED
    if axis not in deployment.axes:
        got = repr(axis) if axis else "none"
        names = ", ".join(deployment.axes)
        raise UsageError(f"--axis: expected an axis, got {got}; there are {names}")
    return axis


def signals_named(pairs: Sequence[str], deployment: Deployment | None) -> dict[str, str]:
    """Name of the signal of each axis."""
    signals: dict[str, str] = {}
    for pair in pairs:
        axis, _, name = pair.partition("=")
        if not (axis and name):
            raise UsageError(f"--signal: expected AXIS=NAME, got {pair!r}")
        if axis in signals:
            raise UsageError(f"--signal: expected one signal of {axis}, got two")
        signals[axis_named(axis, deployment)] = name
    return signals


def messages_of(files: Sequence[Path], deployment: Deployment | None) -> Messages:
    """Messages that name the signals."""
    if not files and deployment:
        return deployment.messages
    loaded, problems = [], []
    for path in files or [data_directory() / "dbc" / "forwarder.dbc"]:
        one, faults = load_dbc(path, ())
        problems += faults
        loaded += [one] if one else []
    if problems:
        raise ConfigError(problems)
    return Messages(loaded)


def logged(
    logs: Sequence[str],
    signals: dict[str, str],
    deployment: Deployment | None,
    messages: Messages,
    *,
    axis: str | None,
    channel: str | None,
    about_s: float | None,
    on_progress: OnProgress,
) -> list[Finding]:
    """Return the findings of logs, by axis and label."""
    if not logs:
        text = "expected a log or a stopwatch, got neither"
        raise UsageError(f"{text}; see canshaper identify --help")
    series: dict[tuple[str, str], list[Series]] = {}
    for label, path in map(_labelled, logs):
        report = partial(on_progress, what=path.name)
        if is_table(path):
            table = read_table(path, report)
            columns: dict[str, str | None] = {**signals}
            columns = columns or {axis_named(axis, deployment): None}
            shown = {a: series_of(table, label, c, about_s) for a, c in columns.items()}
        else:
            names = signals or _simulated(deployment, messages, axis)
            known: dict[str, Any] = {"deployment": deployment, "channel": channel}
            shown = read_can(path, label, names, messages, **known, on_progress=report)
        for name, one in shown.items():
            series.setdefault((name, label), []).append(one)
    findings = []
    for (name, label), parts in series.items():
        on_progress(0.5, f"{name} {label}")
        finding = identify(name, label, parts, about_s)
        if finding.at is None:
            with suppress(ValueError):
                finding.at = float(label)
        findings.append(finding)
    return findings


def pump_in(
    deployment: Deployment, logs: Sequence[str], signals: Sequence[str], *, write: bool, **of: Any
) -> str:
    """Measure what the pump delivers by logs with the speeds of two axes; see ``pump_lines``."""
    speeds, drives = signals_named(signals, deployment), []
    axes = pair_of(deployment, [*speeds])
    names = {axis: ".".join(speed_signal(deployment, axis, speeds.get(axis))) for axis in axes}
    for _, path in map(_labelled, logs):
        shown = read_can(path, "", names, deployment.messages, deployment=deployment, **of)
        columns = [time_s := shown[axes[0]].time_s]
        for name, one in shown.items():
            if one.command is None or not len(one.time_s):
                raise IdentificationError(f"{path}: expected commands and speeds of {name}")
            columns.append(np.interp(time_s, one.command.time_s, one.command.speed))
            columns.append(np.interp(time_s, one.time_s, one.value))
        drives.append(np.stack(columns, axis=1).tolist())
    origin = measured_in(logs, deployment.messages) if write else None
    return "\n".join(pump_lines(deployment, axes, drives, origin))


def measured_in(logs: Sequence[str], messages: Messages) -> dict[str, Any]:
    """Origin of values from logs or a stopwatch; whether those are simulated may be unknown."""
    if not logs:
        return written_by("identify", simulated=None, log="stopwatch")
    paths = [path for _, path in map(_labelled, logs)]
    simulated = any(is_simulated(path, messages) for path in paths)
    return written_by("identify", simulated=simulated, log=", ".join(path.name for path in paths))


def _labelled(text: str) -> tuple[str, Path]:
    """Label and path of "LABEL=LOG"; a file that is there has its name."""
    label, equals, rest = text.partition("=")
    if not equals or Path(text).exists():
        return "", Path(text)
    return label, Path(rest)


def _simulated(
    deployment: Deployment | None, messages: Messages, axis: str | None
) -> dict[str, str]:
    """Signals of the simulated crane, where no others are named."""
    axes = list(deployment.axes) if deployment else list(SIMULATED)
    there = {a: s for a, s in SIMULATED.items() if a in axes and axis in (None, a)}
    if not there or isinstance(messages.find("GrappleSway"), str):
        text = "expected --signal AXIS=MESSAGE.SIGNAL with what shows the swing, got none"
        raise UsageError(text)
    return there
