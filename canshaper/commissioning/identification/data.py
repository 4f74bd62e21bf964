"""Input of ``canshaper identify``, logs and tables or a stopwatch, to findings."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from canshaper.commissioning.identification.canlog import read_can
from canshaper.commissioning.identification.commands import is_simulated
from canshaper.commissioning.identification.phone import series_of
from canshaper.commissioning.identification.recommend import stopwatch
from canshaper.commissioning.identification.series import Series
from canshaper.commissioning.identification.table import is_table, read_table
from canshaper.commissioning.identification.verdict import Finding
from canshaper.commissioning.identification.verdict import identify as identified
from canshaper.config.origin import written_by
from canshaper.errors import ConfigError, UsageError
from canshaper.machine.database import Messages, load_dbc
from canshaper.machine.deployment import Deployment
from canshaper.report.console import OnProgress
from canshaper.shipped import data_directory

# Swing of each axis as `canshaper sim` sends it.
SIMULATED = {
    "slew": "GrappleSway.SwayPerpendicular",
    **dict.fromkeys(
        ("near_far", "lift_cylinder", "knuckle", "extension"), "GrappleSway.SwayParallel"
    ),
}
# Name of the axis where neither a deployment nor an option names one.
UNNAMED = "swing"


def timed_by_hand(timed: dict[str, float | None], logs: list[str], axis: str) -> Finding:
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
        axis, equals, name = pair.partition("=")
        if not (axis and equals and name):
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
        raise UsageError(
            "expected a log or a stopwatch, got neither; see canshaper identify --help"
        )
    series: dict[tuple[str, str], list[Series]] = {}
    for text in logs:
        label, path = _labelled(text)
        report = partial(on_progress, what=path.name)
        if is_table(path):
            table = read_table(path, report)
            columns: dict[str, str | None] = {**signals}
            columns = columns or {axis_named(axis, deployment): None}
            shown = {a: series_of(table, label, c, about_s) for a, c in columns.items()}
        else:
            shown = read_can(
                path,
                label,
                signals or _simulated(deployment, messages, axis),
                messages,
                deployment=deployment,
                channel=channel,
                on_progress=report,
            )
        for name, one in shown.items():
            series.setdefault((name, label), []).append(one)
    findings = []
    for (name, label), parts in series.items():
        on_progress(0.5, f"{name} {label}")
        finding = identified(name, label, parts, about_s)
        if finding.at is None:
            finding.at = _number(label)
        findings.append(finding)
    return findings


def measured_in(logs: Sequence[str], messages: Messages) -> dict[str, Any]:
    """Origin of values from logs or a stopwatch; whether those are simulated may be unknown."""
    if not logs:
        return written_by("identify", simulated=None, log="stopwatch")
    paths = [_labelled(text)[1] for text in logs]
    simulated = any(is_simulated(path, messages) for path in paths)
    names = ", ".join(path.name for path in paths)
    return written_by("identify", simulated=simulated, log=names)


def _labelled(text: str) -> tuple[str, Path]:
    """Label and path of "LABEL=LOG"; a file that is there has its name."""
    label, equals, rest = text.partition("=")
    if not equals or Path(text).exists():
        return "", Path(text)
    return label, Path(rest)


def _number(label: str) -> float | None:
    try:
        return float(label)
    except ValueError:
        return None


def _simulated(
    deployment: Deployment | None, messages: Messages, axis: str | None
) -> dict[str, str]:
    """Signals of the simulated crane, where no others are named."""
    axes = list(deployment.axes) if deployment else list(SIMULATED)
    there = {a: s for a, s in SIMULATED.items() if a in axes and axis in (None, a)}
    if not there or isinstance(messages.find("GrappleSway"), str):
        raise UsageError(
            "expected --signal AXIS=MESSAGE.SIGNAL with what shows the swing, got none"
        )
    return there
