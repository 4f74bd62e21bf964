"""Joysticks of a deployment, bound to the DBC: the velocities that the axes take from them."""

from canshaper.codec.flags import FlaggedVelocity, RockerVelocity
from canshaper.codec.signals import VelocitySignal, magnitude_range, symmetrical_range
from canshaper.config.enable import conditions
from canshaper.config.schema import Command, Joystick, Scaling
from canshaper.config.source import Place
from canshaper.machine.enable import signals_of
from canshaper.machine.inputs import BoundJoystick, bind_input
from canshaper.machine.lookup import Lookup
from canshaper.machine.used_message import UsedMessage


def bind_joystick(lookup: Lookup, name: str, config: Joystick) -> BoundJoystick | None:
    """A joystick; its velocities are those that the axes name."""
    place: Place = ("joysticks", name)
    switches = ("reset", "anti_sway_off", "next_profile")
    enable = signals_of(lookup, name)
    result = bind_input(lookup, place, config, switches, enable=enable)
    if result is None:
        return None
    used, bound = result
    for key in switches:
        used.check_switch((*place, key), getattr(config, key), {1: key}, f"no {key}")
    lookup.check_node(place, config.bus, config.node)
    of_axes = {n: a.command for n, a in lookup.config.axes.items() if a.command.joystick == name}
    _check_scaling(used, of_axes)
    moves = {s.signal: f"the joystick of {axis}" for axis, s in reversed(of_axes.items())}
    velocities = [
        (_bind_rocker if command.negative else _bind_velocity)(used, axis, command, moves)
        for axis, command in of_axes.items()
    ]
    return BoundJoystick(
        **vars(bound),
        name=name,
        velocities=tuple(v for v in velocities if v),
        conditions=conditions(lookup.config, name),
    )


def _check_scaling(used: UsedMessage, commands: dict[str, Command]) -> None:
    """A signal means the same to every axis that reads it."""
    first: dict[str, str] = {}
    for axis, command in commands.items():
        before = first.setdefault(command.signal, axis)
        text = f"axes.{before}.command, which reads {command.signal} too, got another"
        place = ("axes", axis, "command")
        keys = (*Scaling.model_fields, "codes")
        used.diagnostics.check_same(place, command, keys, commands[before], text)


def _bind_velocity(
    used: UsedMessage, axis: str, command: Command, moves: dict[str, str]
) -> VelocitySignal | FlaggedVelocity | None:
    """A signal that is positive one way and negative the other way, or with a flag for each.

    Args:
        used: the message.
        axis: name of the axis.
        command: what it names.
        moves: what the signals are that move an axis, by name.
    """
    place: Place = ("axes", axis, "command")
    flags = command.flags.model_dump() if command.flags else {}
    for key, name in flags.items():
        at: Place = (*place, "flags", key)
        if flag := used.find(at, name):
            used.check_integer(at, flag, signed=False)
            used.check_unused(at, flag, moves)
            used.check_switch(at, name, {0: f"not {key}", 1: key}, "fault")
            used.uses[name] = f"the {key} flag of {axis}"
    signal = used.find((*place, "signal"), command.signal)
    if signal is None:
        return None
    if fault := magnitude_range(signal) if flags else symmetrical_range(signal):
        if not flags and not magnitude_range(signal):
            fault += "; with direction flags it is right"
        used.add_fault(fault)
        return None
    used.check_unused((*place, "signal"), signal)
    velocity = VelocitySignal.of(signal)
    if not flags:
        return velocity
    used.uses[signal.name] = moves[signal.name]  # with other flags it would be another one
    return FlaggedVelocity(velocity, **flags)


def _bind_rocker(
    used: UsedMessage, axis: str, command: Command, moves: dict[str, str]
) -> RockerVelocity | None:
    """A rocker with a signal for each direction; arguments as for ``_bind_velocity``."""
    velocities = []
    for key, name, also in (
        ("signal", command.signal, {}),
        ("negative", command.negative, moves),
    ):
        place: Place = ("axes", axis, "command", key)
        signal = used.find(place, name)
        if signal is None:
            continue
        if fault := magnitude_range(signal):
            used.add_fault(fault)
            continue
        used.check_unused(place, signal, also)
        velocities.append(VelocitySignal.of(signal))
    if len(velocities) < 2:
        return None
    positive, negative = velocities
    used.uses[negative.name] = f"the negative direction of {axis}"
    used.uses[positive.name] = moves[positive.name]
    return RockerVelocity(positive, negative)
