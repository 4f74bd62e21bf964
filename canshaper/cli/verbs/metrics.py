"""``canshaper metrics``: a running daemon for Prometheus."""

import time
from pathlib import Path

import typer

from canshaper.cli.common import FILE, Stop, control_socket, echo, loader
from canshaper.errors import UsageError

GROUP = "drive"


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
