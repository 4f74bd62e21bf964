"""What the buses and the gateway of a deployment file say against each other."""

from itertools import takewhile

from canshaper.codec.kernel_check import neutral_fault
from canshaper.codec.rewrite import RewrittenMessage
from canshaper.codec.sent import SentMessage
from canshaper.config.bus import LAST_SPN, Bus, Gateway, J1939Name
from canshaper.config.schema import DeploymentConfig
from canshaper.machine.diagnostics import Diagnostics
from canshaper.machine.interface_options import option_faults
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
        _check_fd(diagnostics, name, bus)
        if bus.network and bus.interface != "udp_multicast":
            text = f"expected true with udp_multicast only, got it with {bus.interface}"
            add(("buses", name, "network"), text)
        for place, text in option_faults(bus):
            add(("buses", name, *place), text)
        if bus.j1939 is None:
            continue
        # Behind a gateway both may meet, and no one would know which is meant.
        if (other := names.setdefault(bus.j1939.name, name)) != name:
            text = f"is the NAME of bus {other}; each node needs one of its own:"
            add(("buses", name, "j1939", "name"), f"{text} another ecu_instance will do")
        last = bus.j1939.first_spn + 2 * len(config.axes) - 1
        if last > LAST_SPN:
            text = f"expected the last SPN up to {LAST_SPN}, got {last}"
            add(("buses", name, "j1939", "first_spn"), f"{text} from {bus.j1939.first_spn} on")


def _check_match(diagnostics: Diagnostics, config: DeploymentConfig, name: str, bus: Bus) -> None:
    """What can be known of a device without it."""
    if bus.match is None:
        return
    place = ("buses", name, "match")
    if bus.interface != "socketcan":
        text = f"expected the interface socketcan with it, got {bus.interface}"
        diagnostics.add(place, text)
    rate = bus.match.bitrate
    if rate and bus.bitrate and rate != bus.bitrate:
        text = f"expected the bitrate of the bus, {bus.bitrate}, got {rate}"
        diagnostics.add((*place, "bitrate"), text)
    for other, before in takewhile(lambda item: item[0] != name, config.buses.items()):
        if before.match and bus.match.may_be(before.match):
            text = f"expected another serial, path or port than bus {other}"
            diagnostics.add(place, f"{text}, got what may be its device")


def _check_fd(diagnostics: Diagnostics, name: str, bus: Bus) -> None:
    """CAN FD has a data bit rate that is none below the other, and no protocol on top."""
    place = ("buses", name)
    if bus.data_bitrate is not None and not bus.fd:
        diagnostics.add((*place, "data_bitrate"), "expected it with fd: true, got it without")
    elif bus.data_bitrate is not None and bus.data_bitrate < (bus.bitrate or 0):
        text = f"expected the bitrate of the bus, {bus.bitrate}, or more, got {bus.data_bitrate}"
        diagnostics.add((*place, "data_bitrate"), text)
    for protocol in ("j1939", "canopen"):
        if bus.fd and getattr(bus, protocol):
            text = f"expected none on a bus of {protocol}, whose frames are classical, got true"
            diagnostics.add((*place, "fd"), text)


def _check_node_ids(diagnostics: Diagnostics, name: str, bus: Bus) -> None:
    """Ids of nodes of CANopen are used once."""
    if bus.canopen is None:
        return
    owners = {bus.canopen.node: "node"}
    for node, config in bus.canopen.nodes.items():
        if config.id in owners:
            text = f"expected a node id of its own, got {config.id}, that of {owners[config.id]}"
            diagnostics.add(("buses", name, "canopen", "nodes", node, "id"), text)
        owners.setdefault(config.id, f"nodes.{node}")


def check_gateway(lookup: Lookup, gateway: Gateway, valves: list[SentMessage]) -> None:
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
            add(("gateway", "between", i), f"expected a bus, got {bus!r}; there are {names}")
    fd = [buses[bus].fd for bus in gateway.between if bus in buses]
    if len({*fd}) > 1:
        add(("gateway", "between"), "expected fd: true of both buses or of none, got it of one")
    elif any(fd) and gateway.forwarding == "kernel":
        text = "expected daemon with fd: true: our rules of can-gw pass classical frames only"
        add(("gateway", "forwarding"), f"{text}; got kernel")
    for i, name in enumerate(gateway.blocked):
        if isinstance(result := lookup.messages.find(name), str):
            add(("gateway", "blocked", i), result)
    if gateway.fallback == "stop":
        return
    rewritten = [one for one in valves if isinstance(one, RewrittenMessage)]
    if not rewritten:
        text = "expected stop where no valve has the message of a joystick on the other bus"
        add(("gateway", "fallback"), f"{text}, got {gateway.fallback}")
    faults = {neutral_fault(s.protection, s.fields.message.length): s for s in rewritten}
    for fault, sender in faults.items():
        if fault and gateway.fallback == "neutral":
            name = sender.fields.message.name
            add(
                ("gateway", "fallback"),
                f"expected stop or pass, got neutral: {fault}, which {name} has",
            )
