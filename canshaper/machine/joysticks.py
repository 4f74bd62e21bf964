"""Binds the joysticks of a deployment to the DBC: velocities, enabling switches, and the joystick
that the ticks follow."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from cantools.database.can import Signal

from canshaper.codec.sense import flag_fault
from canshaper.codec.signals import (
    few_steps,
    find_signal,
    full_scale,
    magnitude_range,
    neutral_fault,
    symmetrical_range,
)
from canshaper.codec.velocity import FlaggedVelocity, RockerVelocity, Velocity, VelocitySignal
from canshaper.config.enable import Condition, conditions, named_by
from canshaper.config.inputs import SwitchSection
from canshaper.config.schema import Command, DeploymentConfig, Joystick, Scaling
from canshaper.config.source import Diagnostics, Place
from canshaper.machine.inputs import OF_MESSAGE, Bound, bind_input, check_source
from canshaper.machine.lookup import Lookup
from canshaper.machine.used_message import SWITCH, SWITCHES, UsedMessage, flag_of
from canshaper.shaping.states import Reason


@dataclass(frozen=True)
class BoundJoystick(Bound[Joystick]):
    """A joystick with its message.

    Attributes:
        name: name of the joystick.
        velocities: readers of the velocities that its axes use.
        conditions: switches that enable it; the operator presses the first one.
    """

    name: str
    velocities: tuple[Velocity, ...]
    conditions: tuple[Condition, ...]

    @property
    def enable(self) -> str | None:
        """Signal of the switch to press, if the joystick's own message has it; else None."""
        pressed = self.conditions[0]
        return pressed.name if pressed.joystick == self.name else None

    def decode(self, data: bytes) -> tuple[dict[str, Any], dict[str, float | Reason]]:
        """Return the raw values of a frame, and command or fault by velocity, for a listener.

        Frames with another multiplexor value hold no command. The controller uses
        ``JoystickInput`` instead, which also checks protection and age.

        Raises:
            ValueError: the frame does not have the length of the message.
        """
        if len(data) != self.message.length:
            raise ValueError(f"expected {self.message.length} bytes, got {len(data)}")
        raw, chosen = self.layout.decode(data), self.chosen
        meant = chosen is None or raw[chosen.signal] == chosen.value
        return raw, {one.name: one.read(raw) for one in self.velocities if meant}


@dataclass(frozen=True)
class BoundSwitches(Bound[SwitchSection]):
    """A message with switches that enable joysticks.

    Attributes:
        switches: (signal, raw value that enables), by name of the switch.
    """

    switches: Mapping[str, tuple[str, int]]


def signals_of(lookup: Lookup, joystick: str) -> Iterator[tuple[Place, str]]:
    """Yield (place of the first mention, name) of signals in a joystick's message that enable."""
    seen: set[str] = set()
    for owner, section in lookup.config.joysticks.items():
        for i, condition in enumerate(named_by(lookup.config, owner)):
            if condition.joystick == joystick and condition.name not in seen:
                seen.add(condition.name)
                yield _place(section.enable, owner, i), condition.name


def check_conditions(lookup: Lookup) -> None:
    """Report joysticks in enable and enable_of that do not exist, and switches named twice."""
    config, add = lookup.config, lookup.diagnostics.add
    for name, section in config.joysticks.items():
        if (of := section.enable_of) is not None:
            names = [n for n, one in config.joysticks.items() if one.enable is not None]
            at: Place = ("joysticks", name, "enable_of")
            lookup.diagnostics.check_name(at, "a joystick with enable", of, names)
        for i, text in enumerate(section.enable or ()):
            joystick, dot, _ = text.partition(".")
            place = _place(section.enable, name, i)
            if dot:
                lookup.diagnostics.check_name(place, "a joystick", joystick, config.joysticks)
            if text in (section.enable or ())[:i]:
                add(place, f"expected each switch once, got {text!r} again")


def bind_switches(lookup: Lookup) -> list[BoundSwitches]:
    """Bind every message with switches; report each switch that enables no joystick."""
    readers: dict[tuple[str, str], dict[str, SwitchSection]] = {}
    config, add = lookup.config, lookup.diagnostics.add
    needed = {c for joystick in config.joysticks for c in conditions(config, joystick)}
    for name, switch in config.switches.items():
        readers.setdefault((switch.bus, switch.message), {})[name] = switch
        if (None, name) not in needed:
            add(("switches", name), f"expected a joystick that {name} enables, got none")
    return [one for switches in readers.values() if (one := _bind(lookup, switches))]


def _bind(lookup: Lookup, switches: dict[str, SwitchSection]) -> BoundSwitches | None:
    """Bind the switches of one message."""
    first, *others = switches
    config = switches[first]
    for other in others:
        text = f"switches.{first}, which reads the message too"
        place = ("switches", other)
        lookup.diagnostics.check_same(place, switches[other], OF_MESSAGE, config, text)
    result = bind_input(lookup, ("switches", first), config, ("signal",))
    if result is None:
        return None
    used, bound = result
    check_source(used, "a switch")
    for other in others:
        used.integer(("switches", other, "signal"), switches[other].signal, f"switch {other}")
    for name, one in switches.items():
        said = "code" in one.model_fields_set
        agrees, wrong = {one.code: f"{name} agrees"}, None if said else SWITCH
        at = ("switches", name, "code" if said else "signal")
        used.check_switch(at, one.signal, agrees, f"{name} does not agree", wrong)
    names = {name: (one.signal, one.code) for name, one in switches.items()}
    return BoundSwitches(**vars(bound), switches=names)


def _place(names: list[str] | None, joystick: str, i: int) -> Place:
    """Return the place of a name in ``enable``, which may be one text instead of a list."""
    place: Place = ("joysticks", joystick, "enable")
    return (*place, i) if names and len(names) > 1 else place


def bind_joystick(lookup: Lookup, name: str, config: Joystick) -> BoundJoystick | None:
    """Bind a joystick, with the velocities that its axes name; None without its message."""
    place: Place = ("joysticks", name)
    switches = ("reset", "anti_sway_off", "next_profile")
    enable = signals_of(lookup, name)
    result = bind_input(lookup, place, config, switches, enable=enable)
    if result is None:
        return None
    used, bound = result
    for key in switches:
        used.check_switch((*place, key), getattr(config, key), {1: key}, f"no {key}", SWITCHES[key])
    lookup.check_node(place, config.bus, config.node)
    for i, condition in enumerate(named_by(lookup.config, name)):
        if condition.joystick is None and find_signal(used.message, condition.name):
            text = f"expected another name for one of both: {condition.name} is a signal of"
            text += f" {used.message.name} and one of switches, which would enable instead"
            lookup.diagnostics.add(_place(config.enable, name, i), text)
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
    """Check that all axes that read a signal state the same scaling and codes for it."""
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
    """Bind a signed velocity signal, or a magnitude with a flag for each direction.

    Args:
        used: the joystick's message.
        axis: name of the axis.
        command: section ``command`` of the axis.
        moves: use of each signal that moves an axis, by signal.
    """
    place: Place = ("axes", axis, "command")
    flags = command.flags.model_dump() if command.flags else {}
    for key, name in flags.items():
        at: Place = (*place, "flags", key)
        if flag := used.find(at, name):
            used.check_integer(at, flag, signed=False)
            used.check_unused(at, flag, moves)
            if flag_fault(key, name):
                text = f"expected the flag of {key}, got {name!r}: {axis} would move by another one"
                used.diagnostics.add(at, text)
            used.check_switch(at, name, {0: f"not {key}", 1: key}, "fault", flag_of(key))
            used.uses[name] = f"the {key} flag of {axis}"
    signal = used.find((*place, "signal"), command.signal)
    if signal is None:
        return None
    if fault := magnitude_range(signal) if flags else symmetrical_range(signal):
        if not flags and not magnitude_range(signal):
            fault += "; with direction flags it is right"
        used.add_fault(fault)
        return None
    used.check_errors(signal)
    used.check_unused((*place, "signal"), signal)
    _check_neutral(used, place, signal, command)
    if command.full is not None and (fault := few_steps(signal, full_scale(signal))):
        text = f"{fault}: {axis} would jump; full is the value at the end stop"
        used.diagnostics.add((*place, "full"), text)
    velocity = VelocitySignal.of(signal)
    if not flags:
        return velocity
    used.uses[signal.name] = moves[signal.name]  # with other flags it would be another velocity
    return FlaggedVelocity(velocity, **flags)


def _check_neutral(used: UsedMessage, place: Place, signal: Signal, command: Command) -> None:
    if fault := neutral_fault(signal, command.neutral_pct / 100.0, command.codes):
        used.diagnostics.add(place, fault)


def _bind_rocker(
    used: UsedMessage, axis: str, command: Command, moves: dict[str, str]
) -> RockerVelocity | None:
    """Bind a rocker with a signal for each direction; arguments as for ``_bind_velocity``."""
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
        used.check_errors(signal)
        used.check_unused(place, signal, also)
        _check_neutral(used, place, signal, command)
        velocities.append(VelocitySignal.of(signal))
    if len(velocities) < 2:
        return None
    positive, negative = velocities
    used.uses[negative.name] = f"the negative direction of {axis}"
    used.uses[positive.name] = moves[positive.name]
    return RockerVelocity(positive, negative)


def check_following(
    diagnostics: Diagnostics,
    config: DeploymentConfig,
    joysticks: Mapping[str, BoundJoystick | None],
) -> None:
    """Check that the ticks can follow the joystick that the section ``tick`` names."""
    if config.tick is None:
        return
    name, place = config.tick.follow, ("tick", "follow")
    known = diagnostics.check_name(place, "a joystick", name, config.joysticks)
    if known and (joystick := joysticks[name]) and (fault := follow_fault(config, joystick)):
        diagnostics.add(place, f"{fault} of {name}")


def follow_fault(config: DeploymentConfig, joystick: BoundJoystick) -> str | None:
    """Return why the ticks cannot follow a joystick, to be followed by "of NAME"; or None."""
    bus = config.buses.get(joystick.config.bus)
    if bus is not None and bus.interface != "socketcan":
        return f"expected a bus of socketcan, which stamps frames, got {bus.interface}, the bus"
    cycle_ms, tick_ms = joystick.message.cycle_time or 0, config.tick_ms
    if not cycle_ms or (cycle_ms % tick_ms and tick_ms % cycle_ms):
        got = f"{cycle_ms} ms" if cycle_ms else "none"
        expected = f"expected a GenMsgCycleTime that is a multiple or a part of {tick_ms} ms"
        return f"{expected}, got {got}, that"
    return None
