"""``canshaper replay``: what would canshaper have done with this drive?"""

import gc
import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import (
    echo,
    loader,
    os_errors,
    picture,
    picture_line,
)
from canshaper.errors import UsageError
from canshaper.shipped import deployment_path

if TYPE_CHECKING:
    from rich.console import Console

    from canshaper.machine.deployment import Deployment
    from canshaper.recording.replay import Drive
    from canshaper.recording.report import Replayed

EXIT_DIFFERENT = 1
# Lines on standard output; all of them are in the folder.
MOST_EVENTS = 12


def replay(
    log: Path = typer.Argument(..., help="A black box or another bundle (.zip);"
    " candump .log, .asc, .blf, .mf4, .csv, each also .gz."),
    configs: list[str] | None = typer.Option(
        None, "--config", metavar="FILE", help="Deployment; twice for two side by side. Of a bundle"
        " its own by default."
    ),
    channel: list[str] | None = typer.Option(
        None, "--channel", metavar="BUS=CHANNEL", help="Channel of the log that is a bus."
    ),
    out: Path = typer.Option(Path("out/replay"), "--out", help="Folder for what is made."),
    verify: bool = typer.Option(
        False, "--verify", help="Of a black box: exit code 1 when a frame is not the same."
    ),
    begin_s: float = typer.Option(0.0, "--from", metavar="S", help="Table and picture from here."),
    end_s: float | None = typer.Option(None, "--to", metavar="S", help="And up to here."),
) -> None:  # fmt: skip
    """Drive the controller with a black box or a log, at full speed.

    Writes what would have been sent as a new log (candump), the events, a picture and all numbers;
    prints a table. Nothing is sent on any bus.

    A black box has every tick of the daemon and all that it received: every frame that is computed
    is compared with the one that was sent then. With other files (--config), and with any other
    log, the joystick frames drive the controller at the ticks of a clock.

    Exit code 0, with --verify 1 when anything is different, 2 when log or deployment are wrong.

    Examples:

      canshaper replay drive.log --config config/forwarder-robust.yaml

      canshaper replay drive.blf --config machine.yaml --channel crane=1

      canshaper replay drive.asc --config machine.yaml --config robust.yaml --out out/compare

      canshaper replay recording.zip --verify
    """
    from canshaper.recording.bundle import unpack
    from canshaper.report.console import SafeConsole

    console = SafeConsole()
    with os_errors(out), tempfile.TemporaryDirectory() as folder:
        try:
            inside = None
            if log.suffix.lower() == ".zip":
                log, own = unpack(log, Path(folder))
                if not configs:  # somebody else's, and so is what it says of files
                    configs, inside = [str(own)], Path(folder)
            if not configs:
                raise typer.BadParameter("--config is missing: which deployment?")
            replays = _run(log, configs, _channels(channel or []), (begin_s, end_s), out, inside)
            for one in replays:
                one.measure()
        except KeyboardInterrupt:
            echo("interrupted; what was written so far stays", err=True)
            raise typer.Exit(130) from None
    if verify and not all(one.replay.exact for one in replays):
        text = f"--verify: expected a black box of these files, without --config, got {log}"
        raise UsageError(text)
    different = _show(replays, out, console)
    if verify and different:
        raise typer.Exit(EXIT_DIFFERENT)


def _run(
    log: Path,
    configs: list[str],
    channels: dict[str, str],
    window: tuple[float, float | None],
    out: Path,
    inside: Path | None,
) -> "list[Replayed]":
    """Replay every deployment, one after the other."""
    from canshaper.recording.replay import look
    from canshaper.recording.report import Replayed
    from canshaper.report.console import progress_bar

    names = _names([deployment_path(config) for config in configs])
    deployments = [loader(config, inside=inside)() for config in configs]
    for deployment in deployments:
        if unknown := channels.keys() - deployment.config.buses.keys():
            buses = ", ".join(deployment.config.buses)
            text = f"--channel: expected a bus, got {', '.join(unknown)}; there are {buses}"
            raise UsageError(text)
    drives = [look(one, log, channels, own=inside is not None) for one in deployments]
    out.mkdir(parents=True, exist_ok=True)
    replays: list[Replayed] = []
    for name, deployment, drive in zip(names, deployments, drives, strict=True):
        with progress_bar(name) as on_progress, _without_collector():
            replays.append(_one(name, deployment, drive, window, out, on_progress))
    return replays


def _one(
    name: str,
    deployment: "Deployment",
    drive: "Drive",
    window: tuple[float, float | None],
    out: Path,
    on_progress: Callable[[float], None],
) -> "Replayed":
    """Replay one deployment, and write its log and its events."""
    from canshaper.recording.replay import Replay
    from canshaper.recording.report import Replayed
    from canshaper.recording.trace import Trace
    from canshaper.recording.write import LogWriter

    replay = Replay(deployment, drive)
    done = Replayed(name, deployment, replay, Trace(deployment, *window))
    channel_of = {bus: channel for channel, bus in drive.channels.items()}
    number = None
    with (
        (out / f"{name}.log").open("w", encoding="ascii") as log,
        (out / f"{name}.events.txt").open("w", encoding="utf-8") as events,
    ):
        writer = LogWriter(log, channel_of)
        for tick, result in replay.run(on_progress):
            done.ticks += 1
            if number is not None and tick.number > number:
                done.missed += tick.number - number - 1
            number = tick.number
            writer.write(tick, result)
            done.trace.add(tick, result)
            for text in result.events:
                done.events.append((tick.now_ns, text))
                events.write(f"{(tick.now_ns - (done.trace.start_ns or 0)) / 1e9:.3f} {text}\n")
    replay.check_joysticks()
    return done


def _show(replays: "list[Replayed]", out: Path, console: "Console") -> bool:
    """Print and write everything; whether anything was not the same as in the log."""
    from canshaper.recording.report import print_replays, verdict_lines

    first = replays[0]
    seconds = (first.trace.end_ns - (first.trace.start_ns or 0)) / 1e9
    console.print(f"{seconds:.1f} s of driving.")
    for one in replays:
        console.print(f"{one.name}: {one.replay.ticks_of()}", soft_wrap=True)
        for warning in one.replay.warnings():
            console.print(f"WARNING: {one.name}: {warning}", style="yellow")
        if one.trace.full:
            console.print(f"{one.name}: table and picture are of the first {one.trace.rows} ticks.")
    print_replays(replays, console)
    for one in replays:
        for time_ns, text in one.events[:MOST_EVENTS]:
            after_s = (time_ns - (one.trace.start_ns or 0)) / 1e9
            console.print(f"{after_s:9.3f} s {one.name} {text}", soft_wrap=True)
        if len(one.events) > MOST_EVENTS:
            more = len(one.events) - MOST_EVENTS
            console.print(f"  and {more} more in {out / one.name}.events.txt")
        for line in verdict_lines(one, examples=len(replays) == 1):
            console.print(line, soft_wrap=True)
    data = {one.name: one.as_dict() for one in replays}
    (out / "replay.json").write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    made = [f"{one.name}.log" for one in replays] + ["replay.json"]
    if all(one.trace.rows > 1 for one in replays):

        def draw(path: Path) -> None:
            from canshaper.recording.plot import draw as draw_replays

            draw_replays(replays, path)

        if picture(out / "replay.png", draw):
            made.append("replay.png")
        else:
            console.print(picture_line(None))
    console.print(f"Written to {out}: {', '.join(made)}", soft_wrap=True)
    return any(one.replay.verdict.different for one in replays)


def _names(paths: list[Path]) -> list[str]:
    """A name for each deployment, different ones for different files."""
    stems = [path.stem for path in paths]
    return [
        stem if stems.count(stem) == 1 else f"{stem}-{stems[: i + 1].count(stem)}"
        for i, stem in enumerate(stems)
    ]


def _channels(given: list[str]) -> dict[str, str]:
    """Channels by bus from BUS=CHANNEL."""
    found = {}
    for item in given:
        bus, mark, channel = item.partition("=")
        if not mark:
            raise typer.BadParameter(f"expected BUS=CHANNEL, got {item!r}", param_hint="--channel")
        found[bus] = channel
    return found


@contextmanager
def _without_collector() -> Iterator[None]:
    """A replay makes no rings of objects; to look for them takes a tenth of the time."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
