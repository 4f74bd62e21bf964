"""``canshaper monitor`` and ``metrics``: a running daemon, in the terminal and for Prometheus."""

import time
from pathlib import Path

import typer

from canshaper.cli.common import (
    CHANNEL,
    FILE,
    INTERFACE,
    NETWORK,
    Stop,
    control_socket,
    echo,
    loader,
)
from canshaper.errors import UsageError

GROUP = "drive"


def monitor(
    file: str = FILE,
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    refresh_hz: float = typer.Option(
        5.0, "--refresh", metavar="HZ", min=0.2, max=10.0, help="How often the screen is drawn."
    ),
    plain: bool = typer.Option(
        False, "--plain", help="Print lines: every event, and one line a second."
    ),
) -> None:
    """Show a running daemon: states, reasons, joystick and valve, predicted sway, rates, counters.

    It only listens to the frames on the buses of the deployment: the daemon does not notice. It can
    run on the machine's PC, over ssh, or on another computer on the same bus. Values that are stale
    or missing are marked. Ctrl-C ends it.

    Without a terminal, as in a pipe, the output is that of --plain.

    Exit code 0, 2 when the deployment is wrong, 3 when a bus cannot be opened.

    Examples:

      canshaper monitor config/forwarder-robust.yaml

      canshaper monitor machine.yaml --refresh 2

      canshaper monitor machine.yaml --plain | tee monitor.txt
    """
    from canshaper.commissioning.monitor.run import run_live, run_plain
    from canshaper.report.console import SafeConsole

    stop = Stop()
    console = SafeConsole()
    deployment = loader(file, interface, channel, network=network)()
    try:
        if plain or not console.is_terminal:
            run_plain(deployment, echo, lambda: not stop.requested)
        else:
            run_live(deployment, console, refresh_hz, lambda: not stop.requested)
    except BrokenPipeError:  # the reader of the pipe has ended
        raise typer.Exit(0) from None


def metrics(
    file: str = FILE,
    port: int = typer.Option(
        9797, "--port", min=1, max=65535, help="TCP port, on the loopback only."
    ),
    control: Path | None = typer.Option(
        None, "--control", metavar="PATH", help="Control socket instead of the file's."
    ),
    dashboard: bool = typer.Option(
        False, "--dashboard", help="Print the Grafana dashboard (JSON) and exit."
    ),
) -> None:
    """Serve the state of a running daemon to Prometheus, on this computer only.

    It serves axes, buses, counters and lateness at http://127.0.0.1:9797/metrics. Every scrape asks
    the daemon on its control socket; without an answer it returns canshaper_up 0 and nothing else.
    Ctrl-C ends it.

    Exit code 0, 2 when the file is wrong or the port is taken.

    Examples:

      canshaper metrics machine.yaml

      canshaper metrics machine.yaml --dashboard > dashboard.json
    """
    if dashboard:
        from canshaper.shipped import PACKAGE

        echo((PACKAGE / "commissioning" / "grafana.json").read_text(encoding="utf-8"))
        return
    from prometheus_client import start_http_server

    from canshaper.commissioning.metrics import registry_of

    path = control or control_socket(loader(file)())
    stop = Stop()
    try:
        server, _ = start_http_server(port, "127.0.0.1", registry_of(path))
    except OSError as error:
        raise UsageError(f"--port: expected a free one, got {port}: {error.strerror}") from None
    echo(f"http://127.0.0.1:{port}/metrics", err=True)
    while not stop.requested:
        time.sleep(0.2)
    server.shutdown()
