"""``canshaper shift``: the work of a crane in numbers, from its logs."""

import csv
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from canshaper.cli.common import REPORT, channels_of, echo, loader, os_errors
from canshaper.errors import CanshaperError, UsageError

if TYPE_CHECKING:
    from canshaper.recording.shift import LogOfWork

GROUP = "measure"

EXIT_NOT_READ = 1
SUFFIXES = (".csv", ".parquet")
_WORDS, _UNSHOWN = ("machine", "shift", "crane", "profile", "anti_sway"), "logged_s"


def shift(
    logs: list[Path] = typer.Argument(
        ..., metavar="LOG...", help="Logs, black boxes, recordings, or folders of them."
    ),
    config: str | None = typer.Option(
        None, "--config", metavar="FILE", help="Deployment; a bundle has its own."
    ),
    channel: list[str] | None = typer.Option(
        None, "--channel", metavar="BUS=CHANNEL", help="Which channel of the log is this bus."
    ),
    by: Literal["gap", "day", "file"] = typer.Option(
        "gap", "--by", help="What begins a new shift."
    ),
    gap_h: float = typer.Option(
        1.0, "--gap", metavar="HOURS", min=0.01, help="Time without a frame that ends a shift."
    ),
    out: list[Path] | None = typer.Option(
        None,
        "--out",
        metavar="FILE",
        help="Write the table to this file, .csv or .parquet; repeatable.",
    ),
    report: Path | None = REPORT,
) -> None:
    """Count the work of a crane by shift, by profile, and by anti-sway on or off.

    It counts cycles, metres of the tip, time waited for the grapple to calm, taps, reversals and
    the largest swing. It needs no sensor: without one the swing is that of the model, and the table
    says so. Valve frames of any sender count. docs/monitor.md explains each number. Of a folder,
    every log in it and below counts; each folder in it is a machine.

    Exit code 0; 1 when one of several logs cannot be used; 2 when none can, or the deployment is
    wrong.

    Examples:

      canshaper shift monday.blf tuesday.blf --config machine.yaml

      canshaper shift logs/ --config machine.yaml --by day --out work.csv --out work.parquet

      canshaper shift recording.zip
    """
    from canshaper.cli.log_folders import logs_below
    from canshaper.cli.results import Results
    from canshaper.recording.shift import Shifts
    from canshaper.report.console import NOTHING, new_table, progress_bar

    if wrong := [one for one in out or () if one.suffix not in SUFFIXES]:
        raise UsageError(f"--out: expected a file with {' or '.join(SUFFIXES)}, got {wrong[0]}")
    results = Results("Work by shifts", loader(config)() if config else None, report)
    opened: list[LogOfWork] = []
    faults: list[CanshaperError] = []
    shifts, notes = Shifts(by, 3600.0 * gap_h), []
    with tempfile.TemporaryDirectory() as folder, progress_bar("logs") as on_progress:
        for path in logs:
            for machine, log in logs_below(path, ".zip") if path.is_dir() else [("", path)]:
                try:
                    opened.append(_opened(machine, log, config, channel or [], folder))
                except CanshaperError as error:
                    faults.append(error)
        for number, one in enumerate(sorted(opened, key=lambda one: one.start_ns)):

            def progress(part: float, number: int = number) -> None:
                on_progress((number + part) / len(opened))

            on_progress(number / len(opened), one.name)
            try:
                notes += [f"{one.name}: {note}" for note in shifts.add(one, progress)]
            except CanshaperError as error:
                faults.append(error)
    rows = shifts.rows()
    if not rows:
        text = f"{', '.join(map(str, logs))}: expected a log, got none"
        raise faults[0] if faults else UsageError(text)
    shown = [key for key in rows[0] if key not in (*_WORDS, _UNSHOWN)]
    table = new_table("shift, anti_sway", *(key.replace("_", "_\n", 1) for key in shown))
    for row in rows:
        cells = (row[key] for key in shown)
        numbers = (NOTHING if one is None else f"{one:.1f}".removesuffix(".0") for one in cells)
        table.add_row(" ".join(row[key] for key in _WORDS if row[key]), *numbers)
    results.print(table)
    results.print("Swing that is not measured is that of the model, driven by the valve commands.")
    for note in notes:
        results.print(f"note: {note}", soft_wrap=True)
    for path in out or ():
        _write(path, rows)
        results.print(f"Written: {path}", soft_wrap=True)
    results.write()
    for fault in faults:
        echo(f"not read: {fault}", err=True)
    if faults:
        raise typer.Exit(EXIT_NOT_READ)


def _opened(
    machine: str, path: Path, config: str | None, channel: list[str], folder: str
) -> "LogOfWork":
    from canshaper.recording.record import unpack
    from canshaper.recording.replay import look
    from canshaper.recording.shift import LogOfWork, first_ns

    with os_errors(path):
        log, file, inside = path, config, None
        if path.suffix.lower() == ".zip":
            place = Path(tempfile.mkdtemp(dir=folder))
            log, own = unpack(path, place)
            if config is None:
                file, inside = str(own), place
        if file is None:
            raise UsageError(f"{path}: --config is missing: which deployment?")
        deployment = loader(file, inside=inside)()
        drive = look(deployment, log, channels_of(channel), own=inside is not None)
        return LogOfWork(machine, path.name, first_ns(drive), deployment, drive)


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    with os_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".parquet":
            import pyarrow as pa
            import pyarrow.parquet as pq

            pq.write_table(pa.Table.from_pylist(rows), path)
            return
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, [*rows[0]])
            writer.writeheader()
            writer.writerows(rows)
