"""The open buses of a daemon, from one deployment to the next."""

import logging
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from canshaper.bus.port import ListeningPort, Port, open_port
from canshaper.codec.frame import Frame, FrameFault
from canshaper.config.bus import Bus
from canshaper.daemon.notify import ServiceManager
from canshaper.errors import BusError, WrongBusError
from canshaper.machine.deployment import Deployment

if TYPE_CHECKING:
    from canshaper.daemon.gateway import InlineGateway

log = logging.getLogger("canshaper")

# How often buses are tried that cannot be opened at the start.
WAIT_S = 0.5
# How long the last neutral frames are tried when a queue is full: two ticks of the slowest loop.
NEUTRAL_TRIES_S = 0.1
# Until what was sent last has left a queue of some frames, also on a bus with other traffic.
ON_THE_BUS_S = 0.1


def open_ports(
    deployment: Deployment, opened: Mapping[Bus, Port], on_fault: Callable[[FrameFault], None]
) -> dict[str, Port]:
    """Ports of a deployment by name, those among them that are open already included.

    Args:
        deployment: one that only listens gets ports that send no valve frame.
        opened: what is open.
        on_fault: called with every fault of a bus.

    Raises:
        BusError: a bus cannot be opened, or is another device; what is open stays as it is.
    """
    ports: dict[str, Port] = {}
    try:
        for name, bus in deployment.config.buses.items():
            ids = deployment.routing.buses[name]
            listens = deployment.listen_only and bus not in opened
            if listens:
                ids = replace(ids, valves=frozenset())
            port = opened.get(bus) or open_port(name, bus, on_fault, ids)
            ports[name] = ListeningPort(port, ids) if listens else port
    except BusError as error:
        close_ports(new_ports(ports, opened))
        if isinstance(error, WrongBusError):
            place = ("buses", error.bus, "match")
            raise BusError(str(deployment.source.problem(place, error.why))) from error
        raise
    return ports


def opened_ports(
    deployment: Deployment, on_fault: Callable[[FrameFault], None], manager: ServiceManager
) -> dict[str, Port]:
    """Open the buses of a deployment at the start; under a service manager, wait for them.

    A restart for each try would load the program each time, and take the processor from the
    instance of another machine.
    """
    said = ""
    while True:
        try:
            return open_ports(deployment, {}, on_fault)
        except BusError as error:
            if not manager.present:
                raise
            if str(error) != said:
                said = str(error)
                log.error("waiting for a bus: %s", said)
            manager.waiting(f"waiting: {said.splitlines()[0]}")
            time.sleep(WAIT_S)


def new_ports(ports: Mapping[str, Port], opened: Mapping[Bus, Port]) -> list[Port]:
    """Return the ports that were not open before."""
    return [port for port in ports.values() if port not in opened.values()]


def waiting(ports: Iterable[Port]) -> list[Frame]:
    """Return the frames that wait in ports."""
    return [frame for port in ports for frame in (*port.frames(), *port.background())]


def taken_over(
    ports: Mapping[str, Port],
    opened: Mapping[Bus, Port],
    deployment: Deployment,
    read: Callable[[list[Frame]], None],
) -> list[Frame] | None:
    """Go over to the ports of another deployment: those that it does not have are closed.

    Args:
        ports: its ports by name.
        opened: the ports before.
        deployment: the other deployment.
        read: gets what waits in ports that are closed.

    Returns:
        What waits in new ports, without our own frames from the ports before: they cannot know
        them for ours, and they would look like a second sender of every valve's id. None where no
        port is new.
    """
    if closed := [port for port in opened.values() if port not in ports.values()]:
        read(waiting(closed))
        close_ports(closed)
    new, ours = new_ports(ports, opened), deployment.routing.buses
    if new:
        time.sleep(ON_THE_BUS_S)
    waited = [
        frame
        for frame in waiting(new)
        if frame[1:3] not in ours[frame.bus].sent | ours[frame.bus].claims
    ]
    for name, port in ports.items():
        port.watch(name, ours[name])
    return waited if new else None


def opened_line(
    deployment: Deployment, on_fault: Callable[[FrameFault], None]
) -> "InlineGateway | None":
    """Open the gateway that forwards frames, if this machine stands in a line.

    Raises:
        BusError: an interface cannot be opened.
    """
    if not deployment.config.gateway or deployment.listen_only:
        return None
    from canshaper.daemon.gateway import InlineGateway

    return InlineGateway(deployment, on_fault)


def close_ports(ports: Iterable[Port]) -> None:
    """Close them."""
    for port in ports:
        port.close()


def send_neutral(ports: Mapping[str, Port], frames: list[Frame]) -> bool:
    """Send neutral frames, for a while again where a queue is full; what was not sent is logged.

    Returns:
        Whether all were sent.
    """
    until = time.monotonic() + NEUTRAL_TRIES_S
    while frames:
        frames = [f for f in frames if not ports[f.bus].send(f)]
        if time.monotonic() > until:
            break
        if frames:
            time.sleep(0.005)
    for frame in frames:
        log.error("neutral=not-sent bus=%s id=%#x", frame.bus, frame.can_id)
    return not frames


def seen_sent(ports: Iterable[Port], receive: Callable[[Frame], object]) -> str:
    """Wait a moment for valve frames that were all sent to be confirmed.

    Args:
        ports: the buses.
        receive: called with what comes meanwhile.

    Returns:
        ``neutral`` where each frame is on its bus, ``not-confirmed`` where one is not, ``sent``
        where a bus does not say so.
    """
    until = time.monotonic() + ON_THE_BUS_S
    while True:
        for port in ports:
            for frame in port.background():
                receive(frame)
        known = [port.confirmed for port in ports]
        if False not in known:
            return "sent" if None in known else "neutral"
        if time.monotonic() > until:
            return "not-confirmed"
        time.sleep(0.002)
