"""``canshaper sim``: the machine, simulated on CAN."""

import typer

from canshaper.cli.common import (
    CHANNEL,
    CRANE,
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
