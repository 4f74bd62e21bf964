"""Inputs of a machine by their messages, and the parts that a reload carries over."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from canshaper.codec.frame import MessageKey
from canshaper.codec.message import Sender
from canshaper.config.limits import Position
from canshaper.controller.axis_control import AxisControl
from canshaper.inputs.input import MessageInput, Part, PartKey, Switch, SwitchInput
from canshaper.inputs.joystick import JoystickInput
from canshaper.inputs.stops import EmergencyStopInput
from canshaper.inputs.value import (
    PositionInput,
    ProfileButtons,
    ProfileChoice,
    ProfileSwitch,
    Value,
    ValueInput,
    profile_names,
)
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput, BoundValue, Choosing
from canshaper.protocols.interface import BusProtocol

if TYPE_CHECKING:
    from canshaper.inputs.sway_sensor import SwaySensorInput

BoundHandler = tuple[BoundInput, MessageInput]


class MachineInputs:
    """Inputs of a machine, except those that an axis has of its own.

    Attributes:
        joysticks: the joysticks by name.
        stop: the emergency stop, or None.
        load_state: signal of the load state, or None.
        profile: the operator's choice of a profile, or None.
        sway_sensors: input with measurements of sway, by the name of each axis that reads it.
        radii: measured radius of the tip, by the name of its two-axis motion.
        ropes: measured length of the rope, by the name of the axis that follows it.
        positions: measured position, by the name of the axis that has ends.
        other_flow: measured flow of functions that we do not drive, or None.
        gates: switches that enable a joystick, except the one to press, by the joystick's name.
        bound: every input that receives frames, with its message.
    """

    def __init__(self, deployment: Deployment) -> None:
        self.joysticks = {name: JoystickInput(one) for name, one in deployment.joysticks.items()}
        self.bound: list[BoundHandler] = [
            (bound, self.joysticks[name]) for name, bound in deployment.joysticks.items()
        ]
        self.gates = self._enable(deployment)
        self.stop: EmergencyStopInput | None = None
        if stop := deployment.emergency_stop:
            self.stop = EmergencyStopInput(stop, stop.config.signal)
            self.bound.append((stop, self.stop))
        self.load_state = self._switch(deployment.load_state)
        self.profile = self._profile(deployment)
        self._positions: dict[MessageKey, PositionInput] = {}
        motions, axes = deployment.motions.items(), deployment.axes.items()
        self.radii = {n: self._position(one.radius) for n, one in motions if one.radius}
        self.positions = {name: self._position(one.ends) for name, one in axes if one.ends}
        self.ropes = {name: self._position(one.rope) for name, one in axes if one.rope}
        others = deployment.other_flow
        self.other_flow = self._position(others) if others else None
        self.sway_sensors = self._sway_sensors(deployment)

    def _sway_sensors(self, deployment: Deployment) -> dict[str, "SwaySensorInput"]:
        """Return ``sway_sensors``, one input for each message."""
        sensors = {n: axis.sway_sensor for n, axis in deployment.axes.items() if axis.sway_sensor}
        if not sensors:
            return {}
        from canshaper.inputs.sway_sensor import SwaySensorInput

        messages = {one.message.key: one.message for one in sensors.values()}
        inputs = {key: SwaySensorInput(message) for key, message in messages.items()}
        self.bound += [(messages[key], one) for key, one in inputs.items()]
        return {name: inputs[sensor.message.key] for name, sensor in sensors.items()}

    def _enable(self, deployment: Deployment) -> dict[str, list[Switch]]:
        """Return ``gates``; give each joystick the switch to press, if another message has it."""
        named: dict[str, Switch] = {}
        for bound in deployment.switches:
            message = SwitchInput(bound, bound.switches)
            self.bound.append((bound, message))
            named |= message.switches
        gates: dict[str, list[Switch]] = {}
        for name, joystick in deployment.joysticks.items():
            others = joystick.conditions[0 if joystick.enable is None else 1 :]
            switches = [
                self.joysticks[of].watch(switch) if of is not None else named[switch]
                for of, switch in others
            ]
            if joystick.enable is None:
                self.joysticks[name].pressed = switches.pop(0)
            if switches:
                gates[name] = switches
        return gates

    def _profile(self, deployment: Deployment) -> ProfileChoice | None:
        config = deployment.config
        value = self._switch(deployment.profile)
        if value and config.profile:
            return ProfileSwitch(value, config.profile.codes)
        having = [self.joysticks[n] for n, one in config.joysticks.items() if one.next_profile]
        return ProfileButtons(having, profile_names(config)) if having else None

    def _position(self, bound: BoundValue[Position]) -> Value:
        if (message := self._positions.get(bound.key)) is None:
            message = self._positions[bound.key] = PositionInput(bound)
            self.bound.append((bound, message))
        return message.read(bound)

    def _switch(self, bound: BoundValue[Choosing] | None) -> ValueInput | None:
        if bound is None:
            return None
        one = ValueInput(bound, bound.signal)
        self.bound.append((bound, one))
        return one

    def by_key(self) -> dict[MessageKey, MessageInput]:
        """Return the receiver of each message that has an exact identifier."""
        exact = ((message, one) for message, one in self.bound if not message.any_source)
        return {key: one for message, one in exact for key in message.keys}


def parts(
    deployment: Deployment,
    senders: Iterable[Sender],
    inputs: Mapping[MessageKey, Part],
    axes: Mapping[str, AxisControl],
    protocols: Iterable[BusProtocol],
) -> dict[PartKey, Part]:
    """Return every part that a reload carries over, by its key.

    The key of a bus is its interface and channel, that of a message its identifier: a bus or a
    message that is renamed keeps its state. A renamed axis keeps the state of its valve.

    Args:
        deployment: the machine.
        senders: senders of its messages.
        inputs: receivers of its messages, by bus and identifier.
        axes: the axes by name.
        protocols: protocols of its buses.
    """
    places = {n: (bus.interface, bus.channel) for n, bus in deployment.config.buses.items()}

    def by_key() -> Iterator[tuple[PartKey, Part]]:
        for (bus, *message), entry in inputs.items():
            yield ("input", *places[bus], *message), entry
        for sender in senders:
            bus, *message = sender.key
            yield ("sender", *places[bus], *message), sender
        for name, control in axes.items():
            bus, *message = control.valve.key
            signal = control.bound.config.valve.signal
            yield ("valve", *places[bus], *message, signal), control
            yield ("axis", name), control
        for protocol in protocols:
            yield from protocol.parts(places)

    return dict(by_key())
