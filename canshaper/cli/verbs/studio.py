"""``canshaper studio``: serve the page with the cranes."""

import contextlib
import secrets
import signal
import socket
import sys
import tempfile
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import (
    CHANNEL,
    CRANE,
    DEFAULT,
    INTERFACE,
    SENSOR,
    SET,
    control_socket,
    echo,
    fail,
    loader,
    refuse_shipped,
    sensed,
)
from canshaper.errors import UsageError
from canshaper.shipped import deployment_path

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.types import ASGIApp

    from canshaper.design.processes import Transport
    from canshaper.studio.access import Access
    from canshaper.studio.stage import Stage

GROUP = "look"

EXIT_NO_ADDRESS = 1
LINUX = sys.platform == "linux"
LOOPBACK = ("127.0.0.1", "localhost", "::1")


def studio(
    file: str = typer.Argument(
        DEFAULT,
        help="Deployment file, by default a shipped one; or a log, black box or recording.",
    ),
    sensor: bool = SENSOR,
    shadow: bool = typer.Option(
        False, "--shadow", help="Show a real machine: listen to the file's buses, never send."
    ),
    adjust: bool = typer.Option(
        False,
        "--adjust",
        help="With --shadow: let the page change numbers as `canshaper set` does.",
    ),
    control: Path | None = typer.Option(
        None,
        "--control",
        metavar="PATH",
        help="Control socket for --adjust, instead of the file's.",
    ),
    others: list[str] | None = typer.Option(
        None, "--with", metavar="FILE", help="Replay the log or drive with this deployment too."
    ),
    seeds: list[int] | None = typer.Option(
        None, "--seed", min=0, help="Show this drive of `canshaper campaign FILE`; repeatable."
    ),
    folder: Path | None = typer.Option(
        None,
        "--campaign",
        metavar="FOLDER",
        help="Offer the worst drives of the campaign in this folder.",
    ),
    begin_s: float = typer.Option(0.0, "--from", metavar="S", help="Show the log from this time."),
    end_s: float | None = typer.Option(
        None, "--to", metavar="S", help="Show the log up to this time."
    ),
    host: str = typer.Option(
        "127.0.0.1", "--host", help="Address to serve at; others than loopback need a token."
    ),
    port: int = typer.Option(8377, "--port", help="Port to serve at; 0 takes a free one."),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    changes: list[str] | None = SET,
    crane: str | None = CRANE,
) -> None:
    """Serve a page with a crane to drive: raw and shaped side by side under one joystick.

    It starts the daemon and the simulated crane twice, each pair on a bus of its own. It sends only
    joystick frames; all that the page shows is read from the buses. Without --channel the buses are
    python-can's udp_multicast; with two channels (vcan0 and vcan1) SocketCAN, the first for the
    shaped crane. Outside Linux, and for a deployment with several buses, both cranes and their
    controllers run in this process, without a bus.

    With --shadow it starts nothing and sends nothing. With --shadow --adjust the page may also
    change numbers of the running daemon on the same PC, within the file's section "control".

    It replays a log, a black box or a recording, and drives again a drive of a campaign; the page
    then has a time bar. For a log --channel is BUS=CHANNEL.

    Examples:

      canshaper studio

      canshaper studio forwarder-gff.yaml --set grapple.l2_m=1.5

      canshaper studio --sensor --set log.grip_s=20

      canshaper studio --channel vcan0 --channel vcan1

      canshaper studio machine.yaml --shadow --host 0.0.0.0

      canshaper studio machine.yaml --shadow --adjust

      canshaper studio harvester-0007.zip --with new.yaml

      canshaper studio drive.log --with machine.yaml --with new.yaml

      canshaper studio forwarder.yaml --seed 34
    """
    from canshaper.cli.finished_drives import is_drive, opened_drives
    from canshaper_sim.parameters import changed_parameters

    # A service manager ends it with SIGTERM; uvicorn raises the signal again when it is done.
    signal.signal(signal.SIGTERM, interrupt)
    with contextlib.suppress(KeyboardInterrupt), contextlib.ExitStack() as stack:
        file = sensed(file, sensor)
        drawn = [] if seeds is None else seeds
        if is_drive(file) or drawn or folder:
            if shadow or adjust or control:
                text = "expected with a machine's deployment, got a drive of the past"
                raise UsageError(f"--shadow, --adjust, --control: {text}")
            choices = opened_drives(
                file, others or [], drawn, folder,
                channels=channel or [], window=(begin_s, end_s), changes=changes or [],
            )  # fmt: skip
            from canshaper.studio.playback_app import playback_app

            serve(stack, host, port, lambda access: playback_app(Path(file).name, choices, access))
            return
        if others:
            raise UsageError("--with: expected with a log, a black box, --seed or --campaign")
        if (adjust or control) and not (adjust and shadow):
            raise UsageError("--adjust, --control: expected with --shadow --adjust")
        if crane and shadow:
            raise UsageError("--crane: expected without --shadow, which shows all")
        if not LINUX and (shadow or interface or channel):
            raise UsageError(f"studio with a bus: expected Linux, got {sys.platform}")
        from canshaper.studio.commission import Commission
        from canshaper.studio.server import build_app

        if shadow:
            stage = _machine(file, interface, channel, (control,) if adjust else None)
        else:
            stage = _cranes(stack, file, interface, channel or [], changes or [], crane)
        parameters = changed_parameters(changes or [], stage.deployment)
        own = deployment_path(file) == Path(file)
        commission = Commission(Path(file) if own else None, changes or [], machine=shadow)
        stack.callback(commission.close)

        def page(access: "Access") -> "ASGIApp":
            return build_app(stage, access, parameters, commission)

        serve(stack, host, port, page, stage)


def _machine(
    file: str, interface: str | None, channel: list[str] | None, adjust: tuple[Path | None] | None
) -> "Stage":
    """Return a stage that listens to a machine; ``adjust`` lets the page change its numbers.

    ``adjust`` has one member, the path of the control socket, None for that of the file.
    """
    from canshaper.studio.stage import Stage

    deployment = loader(file, interface, channel)()
    if adjust:
        refuse_shipped(file, "--adjust")
    stage = Stage(deployment)
    stage.watch((adjust[0] or control_socket(deployment)) if adjust else None)
    return stage


def _cranes(
    stack: contextlib.ExitStack,
    file: str,
    interface: str | None,
    channel: list[str],
    changes: list[str],
    crane: str | None,
) -> "Stage":
    """Return a stage with simulated cranes; of a file with several, ``crane`` or the first."""
    from canshaper.studio.crane import copied
    from canshaper.studio.stage import Stage
    from canshaper_sim.cranes import cranes
    from canshaper_sim.parameters import changed_parameters

    directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    transports = _transports(interface, channel) if LINUX else []
    _, deployment = copied(deployment_path(file), directory)
    changed_parameters(changes, deployment)  # a wrong one is reported before anything starts
    stage = Stage(deployment)
    crane = crane or next(iter(cranes(deployment)), None)
    if LINUX and len(deployment.config.buses) == 1 and not crane:
        stage.drive(transports, directory, changes)
    elif interface or channel:
        raise UsageError("--interface, --channel: expected a deployment with one bus and crane")
    else:
        stage.drive_here(changes, crane)
    return stage


def serve(
    stack: contextlib.ExitStack,
    host: str,
    port: int,
    make: "Callable[[Access], ASGIApp]",
    stage: "Stage | None" = None,
) -> None:
    """Print the address of a page, and serve it until Ctrl-C or until the stage ends.

    ``make`` builds the page from the rules of access. A host beyond loopback, and a stage whose
    numbers may change, need a token. ``stage`` starts here and ends with ``stack``. An address
    that is taken ends the verb.
    """
    from canshaper.commissioning.doctor.processes import before_the_rest
    from canshaper.studio.access import Access, qr_code, reachable
    from canshaper.studio.server import address, listening, server

    try:
        one = stack.enter_context(listening(host, port))
    except OSError as error:
        text = f"cannot serve at {host} port {port}: {error.strerror or error}; try --port 0"
        raise fail(UsageError(text), EXIT_NO_ADDRESS) from None
    port = one.getsockname()[1]
    away = host not in LOOPBACK
    # Without a token every user of the PC could open the page and act with the rights of this one.
    token = secrets.token_urlsafe(16) if away or (stage and stage.numbers) else None
    names = (host, socket.gethostname()) if away else ()
    web = server(make(Access(port, names, token)))

    def end() -> None:
        web.should_exit = True

    if stage:
        stack.callback(stage.stop)
        stage.start(end)
    url = address(reachable(host), port, token)
    echo(f"open {url} in a browser; Ctrl-C ends")
    if away:
        echo("anybody on the network path can read the token: plain HTTP")
    if away and sys.stdout.isatty():
        typer.echo(qr_code(url) or "with the package segno it stands here as a QR code, too")
    if stage:
        # A thread that waits for the processor with Python's lock held would stop all others.
        before_the_rest()
    web.run(sockets=[one])


def _transports(interface: str | None, channels: list[str]) -> list["Transport"]:
    """Return the buses of the simulated cranes: the first two channels, else two of udp_multicast.

    Raises:
        UsageError: the interface would not be used, there is no such channel, or the joysticks
            might move a real machine on it.
    """
    from canshaper.commissioning.doctor.devices import read_link
    from canshaper.design.processes import Transport
    from canshaper.studio.crane import groups

    if interface and interface not in ("udp_multicast", channels and "socketcan"):
        text = "expected udp_multicast, or socketcan with --channel"
        raise UsageError(f"--interface: {text}, got {interface!r}")
    if interface == "udp_multicast" and channels:
        return [Transport(interface, one, one) for one in channels[:2]]
    if not channels:
        return groups(2)
    for one in channels:
        link = read_link(one)
        if link is None:
            raise UsageError(f"there is no interface {one}")
        if link.kind not in ("vcan", "vxcan"):
            text = f"{one} is no virtual bus; the joysticks of the page would move a real machine"
            raise UsageError(f"{text}. --shadow shows it")
    return [Transport("socketcan", one, f"{one} (SocketCAN)") for one in channels[:2]]


def interrupt(_number: int, _frame: FrameType | None) -> None:
    """Handle a signal as Ctrl-C: raise KeyboardInterrupt."""
    raise KeyboardInterrupt
