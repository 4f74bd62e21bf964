"""What the buses and the gateway of a deployment file say against each other."""

from canshaper.codec.kernel_check import neutral_fault
from canshaper.codec.rewrite import RewrittenMessage
from canshaper.codec.valve import ValveMessage
from canshaper.config.bus import LAST_SPN, Bus, J1939Name
from canshaper.config.gateway import Gateway
from canshaper.config.schema import DeploymentConfig
from canshaper.machine.diagnostics import Diagnostics
from canshaper.machine.lookup import Lookup


def check_buses(diagnostics: Diagnostics, config: DeploymentConfig) -> None:
    """Channels, devices, our node on J1939 and the nodes of CANopen are distinct."""
    add = diagnostics.add
    channels: dict[tuple[str, str], str] = {}
    names: dict[J1939Name, str] = {}
    for name, bus in config.buses.items():
        key = (bus.interface, bus.channel)
        if key in channels:
            add(("buses", name), f"has the channel {bus.channel} of bus {channels[key]}")
        channels[key] = name
        _check_match(diagnostics, config, name, bus)
        _check_node_ids(diagnostics, name, bus)
        if bus.network and bus.interface != "udp_multicast":
            text = f"found true with {bus.interface}, allowed is it with udp_multicast only"
            add(("buses", name, "network"), text)
        if bus.j1939 is None:
            continue
        # Behind a gateway both may meet, and no one would know which is meant.
        if (other := names.setdefault(bus.j1939.name, name)) != name:
            text = f"is the NAME of bus {other}; each node needs one of its own:"
            add(("buses", name, "j1939", "name"), f"{text} another ecu_instance will do")
        last = bus.j1939.first_spn + 2 * len(config.axes) - 1
        if last > LAST_SPN:
            text = f"found {bus.j1939.first_spn}, which makes the last one {last};"
            add(("buses", name, "j1939", "first_spn"), f"{text} allowed is {LAST_SPN}")


def _check_match(diagnostics: Diagnostics, config: DeploymentConfig, name: str, bus: Bus) -> None:
    """What can be known of a device without it."""
    if bus.match is None:
        return
    place = ("buses", name, "match")
    if bus.interface != "socketcan":
        text = f"found it with the interface {bus.interface}, allowed is socketcan"
        diagnostics.add(place, text)
    rate = bus.match.bitrate
    if rate and bus.bitrate and rate != bus.bitrate:
        text = f"found {rate}, the bitrate of the bus is {bus.bitrate}; allowed is the same"
        diagnostics.add((*place, "bitrate"), text)
    for other, before in config.buses.items():
        if other == name:
            break
        if before.match and bus.match.may_be(before.match):
            text = f"may be the device of bus {other} too; allowed is another serial, path"
            diagnostics.add(place, f"{text} or port")


def _check_node_ids(diagnostics: Diagnostics, name: str, bus: Bus) -> None:
    """Ids of nodes of CANopen are used once."""
    if bus.canopen is None:
        return
    owners = {bus.canopen.node: "node"}
    for node, config in bus.canopen.nodes.items():
        if config.id in owners:
            text = f"found {config.id}, which is the node id of {owners[config.id]}"
            place = ("buses", name, "canopen", "nodes", node, "id")
            diagnostics.add(place, f"{text}; allowed is another one")
        owners.setdefault(config.id, f"nodes.{node}")


def check_gateway(lookup: Lookup, gateway: Gateway, valves: list[ValveMessage]) -> None:
    """The gateway against the buses, the messages and the valves that it forwards to.

    Args:
        lookup: what it is bound with.
        gateway: the gateway.
        valves: messages of the valves that are bound.
    """
    add, buses = lookup.diagnostics.add, lookup.config.buses
    for i, bus in enumerate(gateway.between):
        if bus not in buses:
            names = ", ".join(buses)
            add(("gateway", "between", i), f"found {bus!r}, buses are {names}")
    for i, name in enumerate(gateway.blocked):
        if isinstance(result := lookup.messages.find(name), str):
            add(("gateway", "blocked", i), result)
    if gateway.fallback == "stop":
        return
    rewritten = [m.sender for m in valves if isinstance(m, RewrittenMessage)]
    if not rewritten:
        text = f"found {gateway.fallback}, and no valve has the message of a joystick on the other"
        add(("gateway", "fallback"), f"{text} bus; allowed is stop")
    faults = {neutral_fault(s.protection, s.fields.message.length): s for s in rewritten}
    for fault, sender in faults.items():
        if fault and gateway.fallback == "neutral":
            name = sender.fields.message.name
            add(("gateway", "fallback"), f"found neutral; {fault}, which {name} has")
