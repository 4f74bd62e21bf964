"""Every protocol that a machine may speak; only those that its file needs are imported."""

from collections.abc import Mapping, Sequence

from canshaper.inputs.input import MessageInput
from canshaper.inputs.joystick import JoystickInput
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.protocols.interface import BusProtocol, DrivenAxis


def protocols(
    deployment: Deployment,
    axes: Mapping[str, DrivenAxis],
    joysticks: Mapping[str, JoystickInput],
    inputs: Sequence[tuple[BoundInput, MessageInput]],
) -> list[BusProtocol]:
    """Return the protocols that this machine speaks, in the order in which they send.

    Args:
        deployment: the machine.
        axes: axes of the machine; protocols add interlocks to them.
        joysticks: joysticks of the machine.
        inputs: (bound message, receiver of its frames) of each input of the machine.
    """
    config = deployment.config
    canopen, bound = None, [*inputs]
    if any(bus.canopen for bus in config.buses.values()) or any(
        axis.valve.cia408 for axis in config.axes.values()
    ):
        from canshaper.protocols.canopen.network import CanopenNetwork

        canopen = CanopenNetwork(deployment, axes)  # its interlocks are asked first
        bound += canopen.bound
    spoken: list[BusProtocol] = []
    if any(routes.j1939 for routes in deployment.routing.buses.values()):
        from canshaper.protocols.j1939.network import J1939Network

        spoken.append(J1939Network(deployment, axes, bound))
    if canopen and (canopen.inputs or canopen.nodes):
        spoken.append(canopen)
    if config.gateway:
        from canshaper.protocols.gateway.forwarding import Gateway

        spoken.append(Gateway(deployment, axes, joysticks))
    return spoken
