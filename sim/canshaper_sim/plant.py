"""The crane as a node on CAN: valve frames in, feedback frames out. No clock, no sockets."""

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from canshaper.codec.frame import Frame, MessageKey
from canshaper.codec.message import UNPROTECTED, Sender, SentMessage, SequenceChecker
from canshaper.codec.signals import find_signal
from canshaper.errors import ConfigError, Problem
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundValue
from canshaper_sim.axes import JOINTS, LUFFING, OVERHEAD, ROTATOR, SLEW, TIP, TOWER
from canshaper_sim.canopen import CanopenSide
from canshaper_sim.crane import Crane, CraneParameters, CraneState
from canshaper_sim.grapple import Sway
from canshaper_sim.joints import JointBoom
from canshaper_sim.machines import AXES_OF, Machine, ValveDrivenCrane, build_machine, machine_for
from canshaper_sim.overhead import OverheadBoom
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.sensor_messages import sensor_messages
from canshaper_sim.unit import Unit
from canshaper_sim.valve_frames import CommandReader

# Feedback messages and their signals, in the order they are sent; they close with the sway.
FEEDBACK: Mapping[str, tuple[str, ...]] = {
    "TipPosition": ("SlewAngle", "Radius", "Height"),
    "TipVelocity": ("SlewRate", "RadialSpeed", "VerticalSpeed"),
    "GrappleSway": ("SwayPerpendicular", "SwayParallel"),
}
# Sent first by machines that have joints. The lift joint is measured from the horizontal, the
# knuckle joint from the straight arm, negative when folded in (see `kinematics`).
JOINT_FEEDBACK: Mapping[str, tuple[str, ...]] = {
    "JointPosition": ("SlewAngle", "LiftAngle", "KnuckleAngle", "Extension"),
    "JointVelocity": ("SlewRate", "LiftRate", "KnuckleRate", "ExtensionSpeed"),
}
# Feedback of an overhead crane, whose sway is in the directions of its axes.
OVERHEAD_FEEDBACK: Mapping[str, tuple[str, ...]] = {
    "CranePosition": ("Bridge", "Trolley", "RopeLength"),
    "CraneVelocity": ("BridgeSpeed", "TrolleySpeed", "HoistSpeed"),
    "LoadSway": ("SwayBridge", "SwayTrolley"),
}
# Sent first by one whose DBC has it: how the sling hangs below the hook.
SLING_FEEDBACK: Mapping[str, tuple[str, ...]] = {"SlingSway": ("SlingBridge", "SlingTrolley")}

# Sent first by other cranes with a rope: how far down it hangs.
HOOK_FEEDBACK: Mapping[str, tuple[str, ...]] = {
    "HookPosition": ("RopeLength",),
    "CraneVelocity": ("HoistSpeed",),
}
BOOM_FEEDBACK: Mapping[str, tuple[str, ...]] = {
    "JointVelocity": ("SlewRate", "LiftRate", "ExtensionSpeed"),
}
# Feedback by machine; every other machine has joints.
_FEEDBACK_OF: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    TIP: FEEDBACK,
    OVERHEAD: OVERHEAD_FEEDBACK,
    TOWER: {**HOOK_FEEDBACK, **FEEDBACK},
    LUFFING: {**BOOM_FEEDBACK, **HOOK_FEEDBACK, **FEEDBACK},
}

# Frames of a valve that are kept once read.
MOST_KNOWN = 4096

# Source address of the valves on J1939; 0x80 to 0x8F are what a maker uses.
VALVE_ADDRESS = 0x80


class _ValveInput:
    """Commands for one valve, and the age in s of the last one.

    A frame with wrong protection is ignored: the valve closes when no correct frame comes in time.
    """

    def __init__(self, axis: str, deployment: Deployment) -> None:
        bound = deployment.axes[axis]
        self.axis = axis
        self.moves = deployment.coordinates.get(axis, axis)
        self._length = bound.valve_message.length
        self._reader = CommandReader(deployment, axis)
        self._sequence = SequenceChecker(bound.valve.message.protection, None, qualify=1)
        self.timeout_s = bound.config.valve.timeout_ms / 1000.0
        self.command = 0.0
        self.age_s = 0.0
        self._known: dict[bytes, tuple[int, float]] = {}

    def receive(self, data: bytes) -> None:
        """Take a valve frame; one of a wrong length or without a velocity closes the valve."""
        command = 0.0
        if len(data) == self._length:
            known = self._known.get(data) or self._read(data)
            if self.age_s >= self.timeout_s:
                self._sequence.resync()
            if self._sequence.check(data, known[0]):
                return
            command = known[1]
        self.age_s = 0.0
        self.command = command

    def _read(self, data: bytes) -> tuple[int, float]:
        """Return alive counter and command of a frame, cached by the bytes of the frame."""
        if len(self._known) >= MOST_KNOWN:
            self._known.clear()
        reader = self._reader
        known = self._known[data] = reader.count(data), reader.command(data)
        return known


class _Measurement:
    """A message with one number that the deployment reads, sent each cycle.

    Args:
        bound: the message and its signal.
        value: returns the number for a crane.
        first_s: time of the first message, s.
    """

    def __init__(
        self, bound: BoundValue[Any], value: Callable[[Crane], float], first_s: float = 0.0
    ) -> None:
        source = VALVE_ADDRESS if bound.any_source else bound.key[1] & 0xFF
        self._signal, self._value = bound.signal.name, value
        self._sender = SentMessage(
            bound.config.bus, bound.message, source, bound.protection
        ).sender()
        self._cycle_s = cycle_s(bound)
        self._left_s = first_s

    def frames(self, crane: Crane, passed_s: float) -> Iterator[Frame]:
        """Let passed_s seconds pass; yield the frame, once, if it is due."""
        self._left_s -= passed_s
        if self._left_s <= 1e-9:
            self._left_s += self._cycle_s
            raw = self._sender.fields.raw(self._signal, self._value(crane))
            yield self._sender.frame({self._signal: raw})


def cycle_s(bound: BoundValue[Any]) -> float:
    """Return the time between two messages in s, from the file or the DBC; by default 0.1 s."""
    return (bound.config.cycle_ms or bound.message.cycle_time or 100) / 1000.0


def _measurements(deployment: Deployment, sent: Mapping[str, Sender]) -> Iterator[_Measurement]:
    """Yield the numbers that the deployment reads and `sent` lacks: valves, load and rope."""
    for axis, bound in deployment.axes.items():
        if valve := bound.feedback:
            moves = deployment.coordinates.get(axis, axis)
            full = valve.config.full or float(valve.signal.maximum or 0.0)
            yield _Measurement(valve, partial(_opening, moves, full), cycle_s(valve))
    load = deployment.load_state
    if load and load.message.name not in sent:
        yield _Measurement(load, partial(_load, kg=load.signal.unit == "kg"))
    ropes = {one.rope.key: one.rope for one in deployment.axes.values() if one.rope}
    for rope in ropes.values():
        if rope.message.name not in sent:
            yield _Measurement(rope, partial(_rope_m, rope.config.offset_m))


def _opening(moves: str, full: float, crane: Crane) -> float:
    return full * crane.opening(moves)


def _load(crane: Crane, *, kg: bool) -> float:
    """Return the load in kg, or 1 for a load and 0 for none if the unit is not kg."""
    return crane.gripped_kg if kg else float(crane.gripped_kg > 0.0)


def _rope_m(offset_m: float, crane: Crane) -> float:
    assert isinstance(crane.boom, OverheadBoom)  # no other crane has an axis on a rope
    return crane.boom.signal_m - offset_m


class PlantNode:
    """Valves, crane and grapple behind the valve messages of a deployment.

    Args:
        deployment: names the valve messages; its axes choose the machine where ``machine`` is None.
        parameters: the crane; by default the nominal one with ``crane.simulated`` of the file.
        machine: one of `machines.MACHINES`.
        sway: swing of the grapple at the start; by default it hangs still.
        unit: an FMU in place of our crane; machine and sway do not count then.
        listeners: nodes other than the controller listen; without them pose, speeds and sway are
            sent only if the controller receives them.

    Raises:
        ConfigError: the machine lacks an axis of the deployment, or the DBC files lack a feedback
            message.
        DesignError: no such machine, a joint starts out of its range, or the unit does not fit.
        ValueError: the joints do not reach the start pose.
    """

    def __init__(
        self,
        deployment: Deployment,
        parameters: CraneParameters | None = None,
        machine: str | None = None,
        sway: Sway | None = None,
        *,
        unit: Unit | None = None,
        listeners: bool = True,
    ) -> None:
        parameters = parameters or changed_parameters([], deployment)
        name = machine_for(deployment.coordinates.values(), machine)
        problems = _axis_problems(deployment, name, named=machine is not None)
        bus = next(iter(deployment.axes.values())).config.valve.bus
        self._feedback = _FEEDBACK_OF.get(name, {**JOINT_FEEDBACK, **FEEDBACK})
        if name == OVERHEAD and not isinstance(deployment.messages.find("SlingSway"), str):
            self._feedback = {**SLING_FEEDBACK, **self._feedback}
        self._senders: dict[str, Sender] = {}
        # A feedback message that the deployment reads is sent where and as it asks.
        read = {i.message.name: (i.config.bus, i.protection) for i in deployment.inputs()}
        for message, signals in self._feedback.items():
            entry = deployment.messages.find(message)
            if isinstance(entry, str):
                problems.append(Problem(str(deployment.path), None, "dbc", entry))
            elif missing := [s for s in signals if not find_signal(entry[1], s)]:
                problems.append(entry[0].problem(entry[1], f"lacks {', '.join(missing)}"))
            else:
                where, protection = read.get(message, (bus, UNPROTECTED))
                sent = SentMessage(where, entry[1], protection=protection)
                self._senders[message] = sent.sender()
        if problems:
            raise ConfigError(problems)
        if not listeners:
            received = deployment.routing.received
            self._feedback = {
                message: signals
                for message, signals in self._feedback.items()
                if received(self._senders[message].key)
            }
        if unit:
            tick_s = deployment.config.tick_ms / 1000.0
            crane = unit.crane(deployment.by_coordinate, tick_s, parameters)
            self._machine: Machine = ValveDrivenCrane(crane)
        else:
            self._machine = build_machine(name, parameters, sway)
        self._measurements = [*_measurements(deployment, self._senders)]
        sensors = parameters.sway_sensor
        self._sway_sensors = sensor_messages(deployment, sensors)
        self._canopen = CanopenSide(deployment)
        self._passed_s = 0.0
        self._inputs = {axis: _ValveInput(axis, deployment) for axis in deployment.axes}
        self._valves: dict[MessageKey, list[_ValveInput]] = {}
        for valve in self._inputs.values():
            key = deployment.axes[valve.axis].valve.message.key
            self._valves.setdefault(key, []).append(valve)

    @property
    def crane(self) -> Crane:
        """Crane and grapple."""
        return self._machine.crane

    def command(self, axis: str) -> float:
        """Return the command in the last frame of a valve, -1 .. 1; 0 once the valve timed out."""
        return self._inputs[axis].command

    def receive(self, frame: Frame) -> None:
        """Take a frame from a bus; frames that are no command of this plant are ignored."""
        for valve in self._valves.get(frame[:3], ()):
            valve.receive(frame.data)
        if self._canopen.present:
            self._canopen.receive(frame)

    def advance(self, dt_s: float) -> None:
        """Let dt_s seconds pass; a valve holds its last command until its timeout, then 0."""
        self._passed_s += dt_s
        commands, canopen = {}, self._canopen
        for valve in self._inputs.values():
            if valve.age_s >= valve.timeout_s:
                valve.command = 0.0
            valve.age_s += dt_s
            closed = canopen.present and canopen.closed(valve.axis)
            commands[valve.moves] = 0.0 if closed else valve.command
        self._machine.step(dt_s, commands)

    def feedback(self) -> list[Frame]:
        """Return pose, speeds and sway, and the due frames of valves, load, sensors and nodes."""
        state = self.crane.state
        frames = self._measured(state) if self._feedback else []
        for one in self._measurements:
            frames += one.frames(self.crane, self._passed_s)
        for sensors in self._sway_sensors:
            due = sensors.frames(state, self._passed_s)
            frames += [frame for frame in due if self._canopen.works(frame.bus, sensors.node)]
        if self._canopen.present:
            frames += self._canopen.frames(self._passed_s)
        self._passed_s = 0.0
        return frames

    def _measured(self, state: CraneState) -> list[Frame]:
        """Return pose, speeds and sway as frames."""
        frames = []
        for name, signals in self._feedback.items():
            sender = self._senders[name]
            values = self._values(name, state)
            raw = {s: sender.fields.raw(s, v) for s, v in zip(signals, values, strict=True)}
            frames.append(sender.frame(raw))
        return frames

    def _values(self, name: str, state: CraneState) -> tuple[float, ...]:
        """Return the values of a feedback message, in its order: deg, m; speeds in rad/s, m/s."""
        if name == "TipPosition":
            return _heading_deg(state.theta1_rad), state.radius_m, state.height_m
        if name == "TipVelocity":
            return state.theta1_rate_rad_s, state.radius_rate_m_s, state.height_rate_m_s
        if name == "GrappleSway":
            return math.degrees(state.theta5_rad), math.degrees(state.theta6_rad)
        boom = self.crane.boom
        if isinstance(boom, OverheadBoom):
            return _rope_values(name, boom)
        assert isinstance(boom, JointBoom)
        if name == "JointVelocity":
            return boom.joint_rates
        slew, lift, knuckle, extension = boom.joints
        return math.degrees(slew), math.degrees(lift), math.degrees(knuckle), extension


def _rope_values(name: str, boom: OverheadBoom) -> tuple[float, ...]:
    """Return the values of a feedback message of a crane with a rope, in the order of its signals.

    An overhead crane sends messages of its own, see ``OVERHEAD_FEEDBACK``.
    """
    if name == "HookPosition":
        return (boom.signal_m,)
    axes = boom.axes.values()
    if name == "CraneVelocity":
        return tuple(axis.speed for axis in ([*axes][-1:] if SLEW in boom.axes else axes))
    if name == "JointVelocity":
        return tuple(axis.speed for axis in axes)[:-1]
    bridge, trolley, _ = axes
    if name == "CranePosition":
        return bridge.position, trolley.position, boom.signal_m
    angles = boom.sling_angles if name == "SlingSway" else boom.angles[:2]
    return tuple(math.degrees(angle) for angle in angles)


def _heading_deg(theta1_rad: float) -> float:
    return math.degrees(math.remainder(theta1_rad, 2.0 * math.pi))


def _axis_problems(deployment: Deployment, machine: str, *, named: bool) -> list[Problem]:
    """Return a problem for each axis of the deployment that the machine does not have."""
    has = f"the crane has {', '.join(AXES_OF[machine])}"
    if deployment.config.crane:
        has = f"the section crane names no coordinate of it; {has}"
    elif named:
        has = f"machine {machine} has {', '.join(AXES_OF[machine])}"
    elif machine == TIP:
        has += f", or joint by joint {', '.join(AXES_OF[JOINTS])}"
    return [
        Problem(str(deployment.path), None, f"axes.{name}", has)
        for name in deployment.axes
        if deployment.coordinates.get(name, name) not in (*AXES_OF[machine], ROTATOR)
    ]
