"""``canshaper gateway``: the kernel's forwarding rules (can-gw) between two buses."""

from typing import TYPE_CHECKING, Literal

import typer

from canshaper.cli.common import CHANNEL, FILE, INTERFACE, echo, loader
from canshaper.errors import BusError, UsageError

if TYPE_CHECKING:
    from canshaper.machine.deployment import Deployment

GROUP = "setup"

EXIT_OTHER_RULES = 1


def gateway(
    file: str = FILE,
    state: Literal["running", "away", "down", "show"] = typer.Argument(
        "show",
        help="running: forward the frames that are not ours; away: those, and joysticks by the"
        " deployment's fallback; down: forward nothing; show: list the rules.",
    ),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
) -> None:
    """Set up, show or remove the rules of can-gw that pass frames between the buses of a gateway.

    Except with show it removes other rules between the two interfaces, and lists them. The service
    calls it before the daemon starts (running) and after it has ended for any reason (away).

    Exit code 0 when the rules are set, or with show when they are those of running or away; 1 when
    show finds others; 2 when the file is wrong; 3 when the kernel refuses.

    Examples:

      canshaper gateway config/gateway-forwarder.yaml

      sudo canshaper gateway config/gateway-forwarder.yaml running
    """
    from canshaper.protocols.gateway.cangw import between, load_module, make, rules
    from canshaper.protocols.gateway.rules import channels, fallback_rules, passing_rules

    deployment = loader(file, interface, channel)()
    if deployment.config.gateway is None:
        raise UsageError(f"{deployment.path}: expected a section gateway, got none")
    kernel = deployment.config.gateway.forwarding == "kernel"
    passing = passing_rules(deployment) if kernel else []
    fallback = fallback_rules(deployment) if kernel else []
    rules_of = {"running": passing, "away": passing + fallback, "down": []}
    ends = channels(deployment)
    if state == "show":
        present = between(ends, rules())
        states = [name for name, those in rules_of.items() if sorted(present) == sorted(those)]
        echo(f"{' '.join(ends)}: {len(present)} rules, {' or '.join(states) or 'others'}")
        for rule in present:
            echo(f"  {rule}")
        if not {"running", "away"} & {*states}:
            raise typer.Exit(EXIT_OTHER_RULES)
        return
    if rules_of[state]:
        _look_at_devices(deployment)
        load_module()
    removed, added = make(ends, rules_of[state])
    echo(f"{' '.join(ends)}: {state}, {len(added)} rules added, {len(removed)} removed")
    for rule in (rule for rule in removed if rule not in passing + fallback):
        echo(f"  removed {rule}")


def _look_at_devices(deployment: "Deployment") -> None:
    """Check that the interfaces of the gateway are the devices that ``match`` of their buses names.

    Raises:
        BusError: one is another device, or cannot be examined.
    """
    from canshaper.bus.device import match_fault

    assert deployment.config.gateway is not None  # only such deployments have rules
    for name in deployment.config.gateway.between:
        bus = deployment.config.buses[name]
        try:
            named = bus.match and bus.interface == "socketcan"  # not so with --interface
            why = match_fault(bus) if named else None
        except OSError as error:
            why = f"{bus.channel} cannot be looked at: {error.strerror}"
        if why:
            raise BusError(str(deployment.source.problem(("buses", name, "match"), why)))
