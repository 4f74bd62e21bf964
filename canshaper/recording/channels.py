"""Which bus a channel of a log is, and what a frame is to a deployment."""

from collections.abc import Collection, Mapping
from enum import Enum

from canshaper.codec.identifier import group_of
from canshaper.errors import LogError
from canshaper.machine.deployment import Deployment

Key = tuple[str, int, bool]


class Kind(Enum):
    """What a frame is to the daemon of a deployment."""

    RECEIVED = "received"
    """It waits in the first socket, and is read before the valves have their frames."""
    OTHER = "other"
    """It is seen too, after the valves have their frames."""
    SENT = "sent"
    """The daemon sends such frames."""
    IGNORED = "ignored"
    """The daemon does not see it."""


def bus_of_channel(
    deployment: Deployment, channels: Collection[str], given: Mapping[str, str]
) -> dict[str, str]:
    """Names of the buses by the channels of a log.

    Args:
        deployment: the machine.
        channels: those of the log.
        given: channels by bus, as the command line says; else the deployment's own channel counts,
            then the name of the bus, then the only one that there is.

    Raises:
        LogError: a bus has no channel in the log, or two have the same.
    """
    buses = deployment.config.buses
    chosen: dict[str, str] = {}
    for name, bus in buses.items():
        named = given.get(name)
        tries = [named] if named is not None else [bus.channel, name]
        if named is None and len(channels) == 1 and len(buses) == 1:
            tries += channels
        channel = next((c for c in tries if c in channels), None)
        names = ", ".join(repr(c) for c in sorted(channels)) or "none"
        if channel is None:
            text = f"bus {name}: expected the channel {tries[0]!r}, got {names} in the log"
            raise LogError(f"{text}; choose one of them with --channel {name}=CHANNEL")
        if channel in chosen:
            text = f"bus {name}: expected a channel of its own, got {channel!r}, that of bus"
            raise LogError(f"{text} {chosen[channel]}; choose one with --channel {name}=CHANNEL")
        chosen[channel] = name
    return chosen


class Sorter:
    """Says what frames are to a deployment; each kind of frame is looked at once."""

    def __init__(self, deployment: Deployment) -> None:
        self._buses = deployment.routing.buses
        # Other interfaces hand out all there is before the valves have their frames.
        self._raw = {n: b.interface == "socketcan" for n, b in deployment.config.buses.items()}
        # It carries the digest of the program that ran, which need not be this one.
        identity = deployment.identity_status
        self._kinds = {identity.message.key: Kind.IGNORED} if identity else {}

    def kind(self, key: Key) -> Kind:
        """What a frame is, by bus, id and whether that is extended."""
        kind = self._kinds.get(key)
        if kind is None:
            kind = self._kinds[key] = self._judge(key)
        return kind

    def _judge(self, key: Key) -> Kind:
        bus, message = key[0], key[1:]
        ids = self._buses[bus]
        if message in ids.sent or message in ids.claims:
            return Kind.SENT
        group = group_of(message[0]) if message[1] else -1
        if message in ids.received or group in ids.received_groups:
            return Kind.RECEIVED
        if group not in ids.sent_groups and (message in ids.known or (message[1] and ids.j1939)):
            return Kind.IGNORED
        return Kind.OTHER if self._raw[bus] else Kind.RECEIVED
