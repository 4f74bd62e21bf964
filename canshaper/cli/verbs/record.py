"""``canshaper record``: a log of the buses, and a bundle to attach to a report."""

import tempfile
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import (
    CHANNEL,
    EXIT_INTERRUPTED,
    FILE,
    INTERFACE,
    NETWORK,
    Stop,
    control_socket,
    echo,
    fail,
    loader,
)
from canshaper.errors import BusError, CanshaperError, UsageError

if TYPE_CHECKING:
    from canshaper.machine.deployment import Deployment
    from canshaper.recording.record import Recording

GROUP = "measure"

EXIT_NOT_WRITTEN = 1
LOGS = (".log", ".mcap", ".mf4")  # .mcap and .mf4 also hold signals and states
ASK_AGAIN_S = 0.2


def record(
    file: str = FILE,
    seconds: float | None = typer.Option(
        None, "--seconds", min=0.1, help="How long to record; by default until Ctrl-C."
    ),
    out: Path | None = typer.Option(
        None,
        "--out",
        metavar="FILE",
        help="File to write: a bundle (.zip), or only the log (.log, .mcap, .mf4).",
    ),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    last: bool = typer.Option(
        False, "--last", help="Let the running daemon write its black box: the last minute."
    ),
    control: Path | None = typer.Option(
        None, "--control", metavar="PATH", help="With --last: control socket instead of the file's."
    ),
) -> None:
    """Record every frame on the buses of a deployment; nothing is sent.

    It makes a bundle for a bug report: the log, the deployment file with its DBC files, versions,
    and the content of the status messages. `canshaper replay BUNDLE` replays it.

    With --last the running daemon writes its black box, the last minute tick by tick, as soon as
    every axis is in neutral. After a trip the daemon does so by itself.

    Ctrl-C or SIGTERM end it. Exit code 0, even when nothing was received, which it reports; 1 when
    the bundle or the log cannot be written, or no daemon answers; 2 when the deployment is wrong; 3
    when a bus cannot be opened or read.

    Examples:

      canshaper record config/forwarder-robust.yaml

      canshaper record machine.yaml --seconds 600 --out stop-at-the-tree.zip

      canshaper record machine.yaml --out drive.mcap

      canshaper record machine.yaml --last
    """
    from rich.live import Live

    from canshaper.recording.record import Recording
    from canshaper.report.console import SafeConsole

    if last:
        _last(file, control)
        return
    out = out or Path(f"recording-{datetime.now():%Y%m%d-%H%M%S}.zip")
    if out.suffix not in (".zip", *LOGS):
        expected = f"expected .zip, {', '.join(LOGS)}, got {out}"
        raise typer.BadParameter(expected, param_hint="--out")
    deployment = loader(file, interface, channel, network=network)()
    console = SafeConsole(stderr=True)
    recording = Recording(deployment)
    failure: CanshaperError | None = None
    code: int | None = None
    stop = Stop()
    log = out
    try:
        log = out if out.suffix in LOGS else _log_of(out)
        with Live(console=console, refresh_per_second=4) as live:

            def report(so_far: "Recording") -> bool:
                live.update(_line(so_far, out))
                return not stop.requested

            recording.run(log, seconds, report)
            live.update(_line(recording, out))
    except BusError as error:
        failure = error
    except OSError as error:
        failure, code = UsageError(f"{log}: {error.strerror or error}"), EXIT_NOT_WRITTEN
    if out != log:
        if recording.frames or failure is None:  # a partial log is useful even after an error
            _bundle(deployment, recording, log, out, failure)
        log.unlink()
    if failure is not None:
        raise fail(failure, code)
    if not recording.frames:
        text = f"nothing was received, {out} is without frames: is the bus up, and the machine on?"
        echo(text, err=True)
    echo(f"{out}: {recording}")


def _last(file: str, control: Path | None) -> None:
    """Let the running daemon write its black box, wait for that, and print where it is."""
    from canshaper.commissioning.control_client import write_black_box

    try:
        path = control or control_socket(loader(file)())
        folder = write_black_box(path, lambda: time.sleep(ASK_AGAIN_S))
    except KeyboardInterrupt:
        echo("the daemon writes it when every axis is neutral", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None
    echo(f"written in {folder}")


def _log_of(out: Path) -> Path:
    """Make an empty log with a new name next to a bundle, such as drive.x2k9.log; return it."""
    with tempfile.NamedTemporaryFile(
        dir=out.parent, prefix=f"{out.stem}.", suffix=".log", delete=False
    ) as log:
        return Path(log.name)


def _bundle(
    deployment: "Deployment",
    recording: "Recording",
    log: Path,
    out: Path,
    failure: CanshaperError | None,
) -> None:
    """Pack log, deployment and facts into ``out``; if that fails, print where the log is and exit.

    ``failure`` is what ended the recording early, if anything.
    """
    from canshaper.recording.record import pack

    facts = {
        "seconds": round(recording.seconds, 3),
        "frames": {kind or "data": count for kind, count in recording.frames.items()},
        "lost_by_the_kernel": recording.lost,
        "errors_of_the_interface": recording.errors,
        "ended": str(failure) if failure else "as asked",
    }
    try:
        pack(out, log, deployment, recording.history, facts)
    except OSError as error:
        text = f"{error.filename or out}: {error.strerror or error}; the log is {log}"
        raise fail(UsageError(text), EXIT_NOT_WRITTEN) from None


def _line(recording: "Recording", out: Path) -> str:
    return f"recording to {out}: {recording} (Ctrl-C ends it)"
