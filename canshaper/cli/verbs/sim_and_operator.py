"""``canshaper sim`` and ``operator``: the machine, and the operator's hand, simulated on CAN."""

import typer

from canshaper.cli.common import (
    CHANNEL,
    CRANE,
    EXIT_INTERRUPTED,
    FILE,
    INTERFACE,
    NETWORK,
    SET,
    buses_line,
    echo,
    loader,
)

GROUP = "look"


def sim(
    file: str = FILE,
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    changes: list[str] | None = SET,
    machine: str | None = typer.Option(
        None,
        "--machine",
        help="tip: a valve for each coordinate of the tip; tip-controller: a tip controller drives"
        " the joints; joints: a valve for each joint. Default: joints if the deployment has joint"
        " axes, else tip.",
    ),
    crane: str | None = CRANE,
    show: bool = typer.Option(False, "--show", help="Print all parameters and exit."),
) -> None:
    """Simulate valves, crane and swinging grapple behind the valve messages of a deployment.

    It reads valve frames and publishes sway, position and velocity of the tip, and of the joints if
    the machine has them. It prints the buses that it uses, and ends on SIGTERM or Ctrl-C.

    Examples:

      canshaper sim config/forwarder-robust.yaml

      canshaper sim config/forwarder-robust.yaml --set grapple.l2_m=1.5 --set near_far.lag_s=0.15

      canshaper sim forwarder-robust.yaml --machine tip-controller --set joints.main_boom_m=4.2

      canshaper sim config/forwarder-joints.yaml

      canshaper sim config/forwarder-robust.yaml --show
    """
    from canshaper_sim.cranes import one_crane
    from canshaper_sim.parameters import changed_parameters, parameter_names
    from canshaper_sim.realtime import run_plant

    deployment = loader(file, interface, channel, network=network)()
    parameters = changed_parameters(changes or [], deployment)
    if show:
        for name, value in parameter_names(parameters).items():
            echo(f"{name}={value:g}")
        return
    driven = one_crane(deployment, crane) if crane else deployment
    echo(f"the crane of {', '.join(driven.axes)} is on {buses_line(deployment)}; Ctrl-C ends it")
    run_plant(driven, parameters, machine)


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
