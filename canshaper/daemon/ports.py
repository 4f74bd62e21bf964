"""Opens, closes and replaces the buses of a daemon, and sends their last neutral frames."""

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

# Time between two attempts to open the buses at the start.
WAIT_S = 0.5
# Longest time in which neutral frames are sent again to a full queue: two ticks of the slowest
# loop.
NEUTRAL_TRIES_S = 0.1
# Time in which a queue of some frames empties, also on a bus with other traffic.
ON_THE_BUS_S = 0.1


def open_ports(
    deployment: Deployment, opened: Mapping[Bus, Port], on_fault: Callable[[FrameFault], None]
) -> dict[str, Port]:
    """Return the ports of a deployment by name of the bus; open only those that are not open yet.

    Args:
        deployment: the deployment; if it only listens, ports opened for it send no valve frame.
        opened: open ports by section of the bus.
        on_fault: called with every fault of a bus.

    Raises:
        BusError: a bus cannot be opened, or is another device; the ports of ``opened`` stay open.
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

    Restarts instead would load the program at each attempt, and take processor time from the
    instance of another machine.

    Raises:
        BusError: a bus cannot be opened, and there is no service manager.
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
    """Return those of ``ports`` that are not in ``opened``."""
    return [port for port in ports.values() if port not in opened.values()]


def waiting(ports: Iterable[Port]) -> list[Frame]:
    """Read ports once, and return the frames that waited in them."""
    return [frame for port in ports for frame in (*port.frames(), *port.background())]


def taken_over(
    ports: Mapping[str, Port],
    opened: Mapping[Bus, Port],
    deployment: Deployment,
    read: Callable[[list[Frame]], None],
) -> list[Frame] | None:
    """Let ports serve another deployment, and close those that it does not have.

    Args:
        ports: ports of the other deployment by name of the bus.
        opened: ports so far, by section of the bus.
        deployment: the other deployment.
        read: called with the frames that wait in ports before they are closed.

    Returns:
        Frames that already wait in new ports, but for those with our ids; None without a new port.
        The ports so far sent those, but to a new port they look like those of a second sender.
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
    """Open the inline gateway of a deployment; None if it has none, or only listens.

    Raises:
        BusError: an interface cannot be opened.
    """
    if not deployment.config.gateway or deployment.listen_only:
        return None
    from canshaper.daemon.gateway import InlineGateway

    return InlineGateway(deployment, on_fault)


def close_ports(ports: Iterable[Port]) -> None:
    """Close ports."""
    for port in ports:
        port.close()


def send_neutral(ports: Mapping[str, Port], frames: list[Frame]) -> bool:
    """Send neutral frames, for ``NEUTRAL_TRIES_S`` again where one fails; log what was not sent.

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
    """Wait until the valve frames that were sent are confirmed, ``ON_THE_BUS_S`` at most.

    Args:
        ports: ports of the buses.
        receive: called with every frame that comes meanwhile.

    Returns:
        ``not-confirmed`` if a frame is not on its bus; else ``sent`` if a bus confirms no frames;
        else ``neutral``: every frame is on its bus.
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
