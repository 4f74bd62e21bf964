"""``canshaper replay``: drive the controller again with the frames of a log."""

import gc
import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import (
    EXIT_INTERRUPTED,
    EXPORT,
    PICTURE,
    PROCESSES,
    REPORT,
    SCHEDULER,
    channels_of,
    echo,
    engine,
    loader,
    names_of,
    os_errors,
)
from canshaper.errors import UsageError
from canshaper.shipped import deployment_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.cli.results import Results
    from canshaper.machine.deployment import Deployment
    from canshaper.recording.replay import Drive
    from canshaper.recording.report import Replayed

GROUP = "measure"

EXIT_DIFFERENT = 1
# Events on the terminal; the folder has all of them.
MOST_EVENTS = 12


def replay(
    log: Path = typer.Argument(..., help="A black box or another bundle (.zip), or"
    " a log of CAN frames such as .log, .asc, .blf: all formats are in docs/replay.md."),
    configs: list[str] | None = typer.Option(
        None, "--config", metavar="FILE", help="Deployment; twice for two side by side. A bundle"
        " has its own."
    ),
    channel: list[str] | None = typer.Option(
        None, "--channel", metavar="BUS=CHANNEL", help="Which channel of the log is this bus."
    ),
    out: Path = typer.Option(Path("out/replay"), "--out", help="Folder for the results."),
    export: Path | None = EXPORT,
    verify: bool = typer.Option(
        False, "--verify", help="With a black box: exit code 1 when a frame differs."
    ),
    begin_s: float = typer.Option(0.0, "--from", metavar="S", help="Begin of table and picture."),
    end_s: float | None = typer.Option(None, "--to", metavar="S", help="End of table and picture."),
    processes: int | None = PROCESSES,
    scheduler: str | None = SCHEDULER,
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:  # fmt: skip
    """Drive the controller with a black box or a log, at full speed.

    It writes a log (candump) of the frames that the controller would have sent, the events, a
    picture and all numbers, and prints a table. It sends nothing on any bus.

    A black box has every tick of the daemon and all that it received: every computed frame is
    compared with the frame that was sent. With other files (--config), and with any other log, the
    joystick frames drive the controller at the ticks of a clock.

    Of a folder, it replays every log in it and below, and prints one table of all; each folder in
    it is a machine.

    Exit code 0; 1 when a log of a folder cannot be read, or with --verify when a frame differs; 2
    when log or deployment are wrong.

    Examples:

      canshaper replay drive.log --config config/forwarder-robust.yaml

      canshaper replay drive.blf --config machine.yaml --channel crane=1

      canshaper replay drive.asc --config machine.yaml --config robust.yaml --out out/compare

      canshaper replay recording.zip --verify

      canshaper replay recording.zip --export drive.mcap

      canshaper replay logs/ --config old.yaml --config new.yaml
    """
    from canshaper.cli.log_folders import check_only_folders
    from canshaper.cli.results import Results
    from canshaper.recording.record import unpack

    results = Results(f"Replay of {log.name}", None, report, picture)
    if log.is_dir():
        of_one = {"--verify": verify, "--from": begin_s, "--to": end_s, "--picture": picture}
        of_one |= {"--export": export}
        check_only_folders([log], of_one)
        _fleet(log, tuple(configs or ()), channel or [], out, (processes, scheduler), results)
        return
    with os_errors(out), tempfile.TemporaryDirectory() as folder:
        try:
            inside = None
            if log.suffix.lower() == ".zip":
                log, own = unpack(log, Path(folder))
                if not configs:  # somebody else wrote its deployment: read no file outside
                    configs, inside = [str(own)], Path(folder)
            if not configs:
                raise typer.BadParameter("--config is missing: which deployment?")
            if export and len(configs) > 1:
                raise UsageError(f"--export: expected one --config, got {len(configs)}")
            window = begin_s, end_s
            replays = _run(log, configs, channels_of(channel or []), window, out, inside, export)
            for one in replays:
                one.measure()
        except KeyboardInterrupt:
            echo("interrupted; what was written so far stays", err=True)
            raise typer.Exit(EXIT_INTERRUPTED) from None
    if not all(one.trace.rows for one in replays):
        lasts_s = (replays[0].trace.end_ns - (replays[0].trace.start_ns or 0)) / 1e9
        raise UsageError(f"--from, --to: expected a part of {lasts_s:.1f} s of log, got none of it")
    if verify and not all(one.replay.exact for one in replays):
        text = f"--verify: expected a black box of these files, without --config, got {log}"
        raise UsageError(text)
    results.deployment = replays[0].deployment
    different = _show(replays, out, results)
    results.write(EXIT_DIFFERENT if verify and different else 0)


def _fleet(
    folder: Path,
    configs: tuple[str, ...],
    channel: list[str],
    out: Path,
    workers: tuple[int | None, str | None],
    results: "Results",
) -> None:
    """Replay every log in a folder and below with each deployment, and print tables of all."""
    from canshaper.cli.log_folders import replayed, run_fleet, show_replays

    if not configs:
        raise typer.BadParameter("--config is missing: which deployment?")
    channels = channels_of(channel)
    deployments = [
        loader(config)() for config in configs
    ]  # here a fault is reported once, not for each log
    _check_buses(deployments, channels)
    results.deployment = deployments[0]
    work = partial(replayed, configs, channels)
    run_fleet(engine(*workers), work, [folder], show_replays, out, results)


def _run(
    log: Path,
    configs: list[str],
    channels: dict[str, str],
    window: tuple[float, float | None],
    out: Path,
    inside: Path | None,
    export: Path | None = None,
) -> "list[Replayed]":
    """Replay the log with every deployment, one after the other.

    ``inside``: folder of an unpacked bundle, whose deployment reads no DBC file elsewhere.
    """
    from canshaper.recording.replay import look
    from canshaper.recording.report import Replayed
    from canshaper.report.console import progress_bar

    names = names_of([deployment_path(config) for config in configs])
    deployments = [loader(config, inside=inside)() for config in configs]
    _check_buses(deployments, channels)
    drives = [look(one, log, channels, own=inside is not None) for one in deployments]
    out.mkdir(parents=True, exist_ok=True)
    replays: list[Replayed] = []
    for name, deployment, drive in zip(names, deployments, drives, strict=True):
        with progress_bar(name) as on_progress, _without_collector():
            replays.append(_one(name, deployment, drive, window, out, export, on_progress))
    return replays


def _one(
    name: str,
    deployment: "Deployment",
    drive: "Drive",
    window: tuple[float, float | None],
    out: Path,
    export: Path | None,
    on_progress: Callable[[float], None],
) -> "Replayed":
    """Replay the log with one deployment; write the frames it sends and its events into ``out``."""
    from canshaper.recording.export import exporting
    from canshaper.recording.replay import Replay
    from canshaper.recording.report import Replayed, Trace
    from canshaper.recording.tables import LogWriter

    replay = Replay(deployment, drive)
    done = Replayed(name, deployment, replay, Trace(deployment, *window))
    channel_of = {bus: channel for channel, bus in drive.channels.items()}
    number = None
    with (
        (out / f"{name}.log").open("w", encoding="ascii") as log,
        (out / f"{name}.events.txt").open("w", encoding="utf-8") as events,
        exporting(export, deployment) as exported,
    ):
        writer = LogWriter(log, channel_of, deployment.fd)
        for tick, result in replay.run(on_progress):
            done.ticks += 1
            if number is not None and tick.number > number:
                done.missed += tick.number - number - 1
            number = tick.number
            writer.write(tick, result)
            if exported:
                exported.tick(tick, result)
            done.trace.add(tick, result)
            for text in result.events:
                done.events.append((tick.now_ns, text))
                events.write(f"{(tick.now_ns - (done.trace.start_ns or 0)) / 1e9:.3f} {text}\n")
    replay.check_joysticks()
    return done


def _show(replays: "list[Replayed]", out: Path, results: "Results") -> bool:
    """Print and write the results; return whether a frame differs from the log."""
    from canshaper.recording.report import print_replays, verdict_lines

    first = replays[0]
    seconds = (first.trace.end_ns - (first.trace.start_ns or 0)) / 1e9
    results.print(f"{seconds:.1f} s of driving.")
    for one in replays:
        results.print(f"{one.name}: {one.replay.ticks_of()}", soft_wrap=True)
        for warning in one.replay.warnings():
            results.print(f"WARNING: {one.name}: {warning}", style="yellow")
        if one.trace.full:
            results.print(f"{one.name}: table and picture are of the first {one.trace.rows} ticks.")
    print_replays(replays, results)
    for one in replays:
        for time_ns, text in one.events[:MOST_EVENTS]:
            after_s = (time_ns - (one.trace.start_ns or 0)) / 1e9
            results.print(f"{after_s:9.3f} s {one.name} {text}", soft_wrap=True)
        if len(one.events) > MOST_EVENTS:
            more = len(one.events) - MOST_EVENTS
            results.print(f"  and {more} more in {out / one.name}.events.txt")
        for line in verdict_lines(one, examples=len(replays) == 1):
            results.print(line, soft_wrap=True)
    data = {one.name: one.as_dict() for one in replays}
    (out / "replay.json").write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    made = [f"{one.name}.log" for one in replays] + ["replay.json"]
    if all(one.trace.rows > 1 for one in replays):

        def figure() -> "Figure":
            from canshaper.recording.plot import figure as of_replays

            return of_replays(replays)

        path = results.picture(out / "replay.png", figure)
        if path and path.parent == out:
            made.append(path.name)
        else:
            results.picture_line(path)
    results.print(f"Written to {out}: {', '.join(made)}", soft_wrap=True)
    return any(one.replay.verdict.different for one in replays)


def _check_buses(deployments: "list[Deployment]", channels: dict[str, str]) -> None:
    for deployment in deployments:
        if unknown := channels.keys() - deployment.config.buses.keys():
            buses = ", ".join(deployment.config.buses)
            text = f"--channel: expected a bus, got {', '.join(unknown)}; there are {buses}"
            raise UsageError(text)


@contextmanager
def _without_collector() -> Iterator[None]:
    """Pause the garbage collector: a replay makes no reference cycles, and it costs a tenth."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
