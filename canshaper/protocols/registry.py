"""Every protocol that a machine may speak."""

from collections.abc import Mapping, Sequence

from canshaper.inputs.input import MessageInput
from canshaper.inputs.joystick import JoystickInput
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.protocols.canopen.network import CanopenNetwork
from canshaper.protocols.gateway.forwarding import Gateway
from canshaper.protocols.interface import BusProtocol, DrivenAxis
from canshaper.protocols.j1939.network import J1939Network


def protocols(
    deployment: Deployment,
    axes: Mapping[str, DrivenAxis],
    joysticks: Mapping[str, JoystickInput],
    inputs: Sequence[tuple[BoundInput, MessageInput]],
) -> list[BusProtocol]:
    """Those that this machine speaks, in the order in which they send.

    Args:
        deployment: the machine.
        axes: its axes; protocols add their interlocks to them.
        joysticks: its joysticks.
        inputs: its inputs with their messages.
    """
    spoken: list[BusProtocol] = []
    canopen = CanopenNetwork(deployment, axes)  # its interlocks are asked first
    if any(routes.j1939 for routes in deployment.routing.buses.values()):
        spoken.append(J1939Network(deployment, axes, [*inputs, *canopen.bound]))
    if canopen.inputs or canopen.nodes:
        spoken.append(canopen)
    if deployment.config.gateway:
        spoken.append(Gateway(deployment, axes, joysticks))
    return spoken
