"""``canshaper operator``: the hand, simulated on CAN."""

import typer

from canshaper.cli.common import (
    CHANNEL,
    CRANE,
    EXIT_INTERRUPTED,
    FILE,
    INTERFACE,
    NETWORK,
    buses_line,
    echo,
    loader,
)

GROUP = "look"


def operator(
    file: str = FILE,
    script: str = typer.Option("demo", "--script", help="Script of the operator; see --list."),
    bypass: bool = typer.Option(False, "--bypass", help="Drive with anti-sway off."),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    crane: str | None = CRANE,
    show: bool = typer.Option(False, "--list", help="List the scripts and exit."),
) -> None:
    """Play a scripted operator: joystick frames with the enable switch held.

    It prints the script and the buses, and ends with the script, or on SIGTERM or Ctrl-C.

    Examples:

      canshaper operator config/forwarder-robust.yaml --script loading

      canshaper operator config/forwarder-robust.yaml --script random-7 --bypass

      canshaper operator config/forwarder-joints.yaml --script loading-joints

      canshaper operator config/forwarder-robust.yaml --list
    """
    from canshaper_sim.cranes import one_crane
    from canshaper_sim.operator import SCRIPTS, script_for
    from canshaper_sim.realtime import run_operator

    if show:
        for item in SCRIPTS.values():
            echo(f"{item.name:19} {item.duration_s:5.1f} s  {', '.join(item.axes)}")
        echo("random-<seed>        30.0 s  any number, always the same strokes")
        return
    deployment = loader(file, interface, channel, network=network)()
    if crane:
        deployment = one_crane(deployment, crane)
    played = script_for(deployment, script)
    filters = "off" if bypass else "on"
    echo(
        f"script {played.name}, {played.duration_s:g} s, moves {', '.join(played.axes)} with"
        f" anti-sway {filters} on {buses_line(deployment)}"
    )
    if not run_operator(deployment, played, bypass=bypass):
        echo("interrupted", err=True)
        raise typer.Exit(EXIT_INTERRUPTED)
