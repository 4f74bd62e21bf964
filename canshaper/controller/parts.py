"""The parts of a controller whose state outlives a reload, by what they are on the machine."""

from collections.abc import Iterable, Iterator, Mapping

from canshaper.codec.sent import Sender
from canshaper.controller.runner import AxisRunner
from canshaper.inputs.carry_over import Key, Part
from canshaper.machine.deployment import Deployment
from canshaper.protocols.interface import BusProtocol


def parts(
    deployment: Deployment,
    senders: Iterable[Sender],
    inputs: Mapping[tuple[str, int, bool], Part],
    axes: Mapping[str, AxisRunner],
    protocols: Iterable[BusProtocol],
) -> dict[Key, Part]:
    """Every part by its key.

    A bus is known by interface and channel, a message by its id, whatever the file calls them. An
    axis that is renamed is still that of its valve.

    Args:
        deployment: the machine.
        senders: what sends each message.
        inputs: what receives a message, by bus and id.
        axes: the axes by name.
        protocols: those of the machine.
    """
    places = {n: (bus.interface, bus.channel) for n, bus in deployment.config.buses.items()}

    def by_key() -> Iterator[tuple[Key, Part]]:
        for (bus, *message), entry in inputs.items():
            yield ("input", *places[bus], *message), entry
        for sender in senders:
            bus, *message = sender.key
            yield ("sender", *places[bus], *message), sender.protector
        for name, runner in axes.items():
            bus, *message = runner.valve.key
            signal = runner.bound.config.valve.signal
            yield ("valve", *places[bus], *message, signal), runner
            yield ("axis", name), runner
        for protocol in protocols:
            yield from protocol.parts(places)

    return dict(by_key())
