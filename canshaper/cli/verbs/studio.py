"""``canshaper studio``: the live page."""

import contextlib
import secrets
import signal
import socket
import tempfile
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import (
    CHANNEL,
    INTERFACE,
    SET,
    echo,
    fail,
    loader,
)
from canshaper.errors import UsageError
from canshaper.shipped import deployment_path

if TYPE_CHECKING:
    from canshaper.design.processes import Transport

EXIT_NO_ADDRESS = 1
LOOPBACK = ("127.0.0.1", "localhost", "::1")


def studio(
    file: str = typer.Argument("forwarder.yaml", help="Deployment file; by default a shipped one."),
    shadow: bool = typer.Option(
        False, "--shadow", help="Show a real machine: listen to the file's buses, never send."
    ),
    host: str = typer.Option(
        "127.0.0.1", "--host", help="Address to serve at; others than loopback need a token."
    ),
    port: int = typer.Option(8377, "--port", help="Port to serve at; 0 takes a free one."),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    changes: list[str] | None = SET,
) -> None:
    """Serve a page with a crane to drive: raw and shaped side by side under one joystick.

    Starts the daemon and the simulated crane twice, each pair on a bus of its own, and sends
    nothing but joystick frames; everything shown is read from the buses. Without --channel the
    buses are python-can's udp_multicast; with two of them (vcan0 and vcan1) SocketCAN, the first
    for the shaped crane. With --shadow nothing is started and nothing is sent.

    Examples:

      canshaper studio

      canshaper studio forwarder-robust.yaml --set grapple.l2_m=1.5

      canshaper studio --channel vcan0 --channel vcan1

      canshaper studio machine.yaml --shadow --host 0.0.0.0
    """
    from canshaper.studio.access import Access
    from canshaper.studio.crane import copied
    from canshaper.studio.events import Events
    from canshaper.studio.server import address, build_app, listening, server
    from canshaper.studio.stage import Stage, before_the_rest
    from canshaper_sim.parameters import changed_parameters

    # As a service manager ends it; uvicorn raises the signal again when it is done.
    signal.signal(signal.SIGTERM, _interrupt)
    with contextlib.suppress(KeyboardInterrupt), contextlib.ExitStack() as stack:
        parameters = changed_parameters(changes or [])
        if shadow:
            stage = Stage(loader(file, interface, channel)(), Events())
            stage.watch()
        else:
            directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            transports = _transports(interface, channel or [])
            _, deployment = copied(deployment_path(file), directory)
            if len(deployment.config.buses) > 1:
                raise UsageError("this deployment has several buses; only --shadow shows it")
            stage = Stage(deployment, Events())
            stage.drive(transports, directory, changes or [])
        try:
            one = stack.enter_context(listening(host, port))
        except OSError as error:
            text = f"cannot serve at {host} port {port}: {error.strerror or error}; try --port 0"
            raise fail(UsageError(text), EXIT_NO_ADDRESS) from None
        port = one.getsockname()[1]
        token = None if host in LOOPBACK else secrets.token_urlsafe(16)
        names = (host, socket.gethostname()) if token else ()
        web = server(build_app(stage, Access(port, names, token), parameters))

        def end() -> None:
            web.should_exit = True

        stack.callback(stage.stop)
        stage.start(end)
        echo(f"open {address(host, port, token)} in a browser; Ctrl-C ends")
        if token:
            echo("anybody on the network path can read the token: plain HTTP")
        # The threads hold each other up: one that waits for the processor has Python's lock.
        before_the_rest()
        web.run(sockets=[one])


def _transports(interface: str | None, channels: list[str]) -> list["Transport"]:
    """Buses of the simulated cranes.

    Raises:
        ValueError: a channel on which the joysticks might move a real machine.
    """
    from canshaper.commissioning.doctor.interfaces import read_link
    from canshaper.design.processes import Transport
    from canshaper.studio.crane import groups

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


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
