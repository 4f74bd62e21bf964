"""``canshaper sim`` and ``canshaper operator``: the machine and the hand, simulated on CAN."""

import typer

from canshaper.cli.common import CHANNEL, FILE, INTERFACE, NETWORK, fail, loader
from canshaper.cli.console import echo

SET = typer.Option(
    None, "--set", metavar="NAME=VALUE", help="Change a parameter, such as grapple.l2_m=1.5."
)
CRANE = typer.Option(
    None,
    "--crane",
    help="Which one, where the deployment has several: the first part of axis names.",
)


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
        " the joints; joints: a valve for each joint. By default tip, or joints where the"
        " deployment has joint axes.",
    ),
    crane: str | None = CRANE,
    show: bool = typer.Option(False, "--show", help="Print all parameters and exit."),
) -> None:
    """Simulate valves, crane and swinging grapple behind the valve messages of a deployment.

    Reads valve frames, publishes sway, position and velocity of the tip, and of its joints where
    the machine has them. Ends on SIGTERM or Ctrl-C.

    Examples:

      canshaper sim config/forwarder.yaml

      canshaper sim config/forwarder.yaml --set grapple.l2_m=1.5 --set near_far.lag_s=0.15

      canshaper sim config/forwarder.yaml --machine tip-controller --set joints.main_boom_m=4.2

      canshaper sim config/forwarder-joints.yaml

      canshaper sim config/forwarder.yaml --show
    """
    from canshaper.errors import BusError, ConfigError
    from canshaper_sim.cranes import one_crane
    from canshaper_sim.parameters import changed_parameters, parameter_names
    from canshaper_sim.realtime import run_plant

    try:
        parameters = changed_parameters(changes or [])
        if show:
            for name, value in parameter_names(parameters).items():
                echo(f"{name}={value:g}")
            return
        deployment = loader(file, interface, channel, network=network)()
        driven = one_crane(deployment, crane) if crane else deployment
        run_plant(driven, parameters, machine)
    except (ConfigError, BusError, ValueError) as error:
        raise fail(error) from None


def operator(
    file: str = FILE,
    script: str = typer.Option("demo", "--script", help="What the operator does; see --list."),
    bypass: bool = typer.Option(False, "--bypass", help="Drive with anti-sway switched off."),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    crane: str | None = CRANE,
    show: bool = typer.Option(False, "--list", help="List the scripts and exit."),
) -> None:
    """Play a scripted operator: joystick frames with the enable switch held.

    Examples:

      canshaper operator config/forwarder.yaml --script loading

      canshaper operator config/forwarder.yaml --script random-7 --bypass

      canshaper operator config/forwarder-joints.yaml --script loading-joints

      canshaper operator config/forwarder.yaml --list
    """
    from canshaper.errors import BusError, ConfigError
    from canshaper_sim.axes import ALL_AXES
    from canshaper_sim.cranes import one_crane
    from canshaper_sim.operator import SCRIPTS, script_named
    from canshaper_sim.realtime import run_operator

    if show:
        for item in SCRIPTS.values():
            echo(f"{item.name:19} {item.duration_s:5.1f} s  {', '.join(item.axes)}")
        echo("random-<seed>        30.0 s  any number, always the same strokes")
        return
    try:
        deployment = loader(file, interface, channel, network=network)()
        if crane:
            deployment = one_crane(deployment, crane)
        axes = [axis for axis in ALL_AXES if axis in deployment.axes]
        run_operator(deployment, script_named(script, axes), bypass=bypass)
    except (ConfigError, BusError, ValueError) as error:
        raise fail(error) from None
