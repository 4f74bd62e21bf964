"""Folders of logs: one row for each log and axis; a log that cannot be read is reported.

The folder of a log, relative to the folder on the command line, names its machine.
"""

import json
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from canshaper.blackbox.file import SUFFIX
from canshaper.campaign.engine import Engine
from canshaper.cli.common import loader, os_errors
from canshaper.cli.results import Results
from canshaper.errors import CanshaperError, UsageError
from canshaper.recording.log import FORMATS, LogFile
from canshaper.recording.shift import day_of
from canshaper.report.console import NOTHING, new_table, progress_bar

EXIT_NOT_READ = 1
_HEADS = ("min", "raw deg", "left deg", "dip %", "stops", "trips")
Row = dict[str, Any]


@dataclass(frozen=True)
class Log:
    """One log of a fleet.

    Attributes:
        path: the file.
        machine: its folder, relative to the folder on the command line; "." is that folder.
        rows: one row for each axis and deployment; none of a log that could not be read.
        fault: why the log could not be read; empty if it could.
    """

    path: Path
    machine: str
    rows: list[Row] = field(default_factory=list)
    fault: str = ""


def logs_below(folder: Path, *bundles: str) -> list[tuple[str, Path]]:
    """Return (machine, path) of each log in a folder and below, sorted by path.

    Files with a suffix of ``bundles`` count too. A .txt file does not, though it may be a log.
    """
    known = {*FORMATS, SUFFIX, *bundles} - {".txt"}  # most of them are notes
    logs = [
        path
        for path in sorted(folder.rglob("*"))
        if path.is_file() and Path(path.name.lower().removesuffix(".gz")).suffix in known
    ]
    return [(path.parent.relative_to(folder).as_posix(), path) for path in logs]


def check_only_folders(paths: Sequence[Path], options: Mapping[str, object]) -> None:
    """Refuse single logs, and options for a single log, next to a folder.

    Raises:
        UsageError: a path is no folder like the first, or one of ``options`` has a value.
    """
    if others := [str(path) for path in paths if not path.is_dir()]:
        raise UsageError(f"{others[0]}: expected a folder like {paths[0]}, got none")
    if given := [name for name, value in options.items() if value]:
        raise UsageError(f"{', '.join(given)}: expected one log, got the folder {paths[0]}")


def run_fleet(
    engine: Engine,
    work: Callable[[Path], list[Row]],
    folders: Sequence[Path],
    show: Callable[[Sequence[Log], Results], None],
    out: Path,
    results: Results,
) -> None:
    """Work on every log below the folders; print tables and faults, and write all numbers.

    Args:
        engine: runs the work in parallel.
        work: returns the rows of a log; its CanshaperError or OSError becomes the log's fault.
        folders: folders of the logs.
        show: prints the tables; it gets all logs, sorted by machine and path.
        out: folder for ``fleet.json``.
        results: console of the verb.

    Raises:
        UsageError: the folders have no log.
        typer.Exit: a log could not be read.
    """
    logs = [log for folder in folders for log in logs_below(folder)]
    if not logs:
        names = ", ".join(map(str, folders))
        raise UsageError(f"{names}: expected a folder with logs, got one without")
    done: list[Log] = []
    with progress_bar("logs") as on_progress, os_errors(out):
        for one in engine.run(partial(_one, work), logs):
            done.append(one[1])
            on_progress(len(done) / len(logs))
    done.sort(key=lambda log: (log.machine, log.path))
    show(done, results)
    results.write(_finish(done, out, results))


def _one(work: Callable[[Path], list[Row]], log: tuple[str, Path]) -> Log:
    machine, path = log
    try:
        return Log(path, machine, work(path))
    except (CanshaperError, OSError) as error:
        return Log(path, machine, fault=str(error).splitlines()[0])


def replayed(configs: tuple[str, ...], channels: Mapping[str, str], path: Path) -> list[Row]:
    """Drive the controller of each deployment with a log; return a row for each of its axes.

    ``channels`` are those of the log, by bus. A log that is shorter than two ticks has no rows.
    """
    from canshaper.recording.replay import Replay, look
    from canshaper.recording.report import Replayed, Trace

    rows: list[Row] = []
    for config in configs:
        deployment = loader(config)()
        drive = look(deployment, path, channels, own=False)
        replay, trace = Replay(deployment, drive), Trace(deployment, 0.0, None)
        done = Replayed(Path(config).stem, deployment, replay, trace)
        for tick, result in done.replay.run(lambda _part: None):
            done.trace.add(tick, result)
            done.events += [(tick.now_ns, text) for text in result.events]
        done.replay.check_joysticks()
        done.measure()
        start_ns, notes = done.trace.start_ns or 0, [*replay.warnings()]
        for axis, measures in done.measures.items():
            rows.append(
                {
                    "day": day_of(start_ns),
                    "minutes": (done.trace.end_ns - start_ns) / 60e9,
                    "deployment": done.name,
                    "axis": axis,
                    "straight_deg": done.straight[axis].residual_deg,
                    "residual_deg": measures.residual_deg,
                    "dip_pct": None if measures.dip is None else 100.0 * measures.dip,
                    "stops": done.count(axis, "STOPPING"),
                    "trips": done.count(axis, "TRIPPED"),
                    "notes": notes,
                }
            )
    return rows


def identified(
    file: str | None,
    signals: Sequence[str],
    dbc: Sequence[Path],
    options: Mapping[str, Any],
    path: Path,
) -> list[Row]:
    """Identify period and damping in a log; return a row for each axis, also of too little data.

    ``signals`` are AXIS=NAME; ``options`` are axis, channel and about_s of the command line.
    """
    from canshaper.commissioning.identification.canlog import messages_of
    from canshaper.commissioning.identification.data import logged, signals_named

    deployment = loader(file)() if file else None
    findings = logged(
        [str(path)],
        signals_named(signals, deployment),
        deployment,
        messages_of(dbc, deployment),
        on_progress=lambda _done, what=None: None,
        **options,
    )
    rows: list[Row] = []
    for one in findings:
        row: Row = {"day": day_of(_start_ns(path)), "axis": one.axis}
        for name in ("period_s", "damping_ratio"):
            value = getattr(one, name)
            row[name] = value.value if value else None
            row[f"{name}_half"] = value.half if value else None
        rows.append(
            {**row, "usable": one.usable, "why": "; ".join(one.problems), "notes": [*one.notes]}
        )
    return rows


def _start_ns(path: Path) -> int:
    """Return the time of a log's first frame, ns since 1970; 0 without one, as of a table."""
    try:
        return next((frame.time_ns for frame in LogFile(path)), 0)
    except CanshaperError:
        return 0


def period_drifts(logs: Sequence[Log]) -> Iterator[str]:
    """Yield a line for each axis of a machine whose period has drifted.

    Of the logs with enough data the first day is compared with the last one: the period has drifted
    if it changed by more than both half intervals (95 %) together.
    """
    by_axis: dict[tuple[str, str], list[Row]] = {}
    for log in logs:
        for row in log.rows:
            if row["usable"]:
                by_axis.setdefault((log.machine, row["axis"]), []).append(row)
    for (machine, axis), rows in by_axis.items():
        rows.sort(key=lambda row: str(row["day"]))
        first, last = rows[0], rows[-1]
        change_s = last["period_s"] - first["period_s"]
        if abs(change_s) > first["period_s_half"] + last["period_s_half"]:
            begin, end = (row["day"] or "an unknown day" for row in (first, last))
            yield (
                f"{machine} {axis}: period {first['period_s']:.3f} s on {begin},"
                f" {last['period_s']:.3f} s on {end}"
            )


_REPLAY = {
    "minutes": "{:.1f}",
    "straight_deg": "{:.2f}",
    "residual_deg": "{:.2f}",
    "dip_pct": "{:.0f}",
    "stops": "{}",
    "trips": "{}",
}
_PERIODS = {"period_s": "{:.3f}", "damping_ratio": "{:.4f}"}


def show_replays(logs: Sequence[Log], results: Results) -> None:
    """Print a table for each deployment, a row for each log and axis; then a table of all logs.

    Log and axis share the first column, because a table that is too wide repeats that column.
    """
    by_deployment: dict[str, list[tuple[Log, Row]]] = {}
    for log, row in _rows(logs):
        by_deployment.setdefault(row["deployment"], []).append((log, row))
    whole = new_table("all logs", "logs", "median left, deg", "stops", "trips")
    for deployment, rows in by_deployment.items():
        table = new_table(deployment, "day", *_HEADS)
        for log, row in rows:
            cells = (_cell(form, row[key]) for key, form in _REPLAY.items())
            table.add_row(f"{_name(log)} {row['axis']}", row["day"], *cells)
        results.print(table)
        for axis in dict.fromkeys(row["axis"] for _, row in rows):
            of_axis = [row for _, row in rows if row["axis"] == axis]
            left = [row["residual_deg"] for row in of_axis if row["residual_deg"] is not None]
            median = _cell("{:.2f}", statistics.median(left) if left else None)
            sums = (str(sum(row[key] for row in of_axis)) for key in ("stops", "trips"))
            whole.add_row(f"{deployment} {axis}", str(len(of_axis)), median, *sums)
    results.print(whole)


def show_periods(logs: Sequence[Log], results: Results) -> None:
    """Print a table with a row for each log and axis, then a line for each drifted period."""
    table = new_table("machine, log", "day", "period, s", "damping ratio", "usable")
    for log, row in _rows(logs):
        cells = []
        for key, form in _PERIODS.items():
            value, half = (_cell(form, row[part]) for part in (key, f"{key}_half"))
            cells.append(value if value == NOTHING else f"{value} ± {half}")
        usable = "yes" if row["usable"] else "no"
        table.add_row(f"{_name(log)} {row['axis']}", row["day"], *cells, usable)
    results.print(table)
    for line in period_drifts(logs):
        results.print(f"DRIFT: {line}", soft_wrap=True)


def _finish(logs: Sequence[Log], out: Path, results: Results) -> int:
    """Print notes and faults, write ``fleet.json``; return 1 if a log was not read, else 0."""
    for log in logs:
        for note in dict.fromkeys(text for row in log.rows for text in row["notes"]):
            results.print(f"note: {_name(log)}: {note}", soft_wrap=True)
    faults = [log for log in logs if log.fault]
    for log in faults:
        results.print(f"not read: {log.fault}", soft_wrap=True)
    path = out / "fleet.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    data = [
        {"machine": log.machine, "log": str(log.path), "fault": log.fault, "rows": log.rows}
        for log in logs
    ]
    path.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    results.print(f"{len(logs) - len(faults)} of {len(logs)} logs; all numbers in {path}")
    return EXIT_NOT_READ if faults else 0


def _rows(logs: Sequence[Log]) -> Iterator[tuple[Log, Row]]:
    return ((log, row) for log in logs for row in log.rows)


def _name(log: Log) -> str:
    return log.path.name if log.machine == "." else f"{log.machine}/{log.path.name}"


def _cell(form: str, value: float | None) -> str:
    return NOTHING if value is None else form.format(value)
