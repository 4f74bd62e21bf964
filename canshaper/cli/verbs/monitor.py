"""``canshaper monitor``: a running daemon, live in the terminal."""

import typer

from canshaper.cli.common import CHANNEL, FILE, INTERFACE, NETWORK, Stop, echo, loader

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
