"""Warnings about a valid deployment file whose numbers are likely to be wrong."""

from collections.abc import Iterator

from canshaper.codec.sense import turned
from canshaper.codec.signals import find_signal
from canshaper.commissioning.origins import assumptions
from canshaper.config.source import Place, Source
from canshaper.design.tuning.verdict import verdicts
from canshaper.errors import Problem
from canshaper.machine.deployment import Deployment
from canshaper.machine.filters import unfit
from canshaper.machine.stop_distance import rehearsed, unstated
from canshaper.machine.valves import BoundAxis

# Full deflection, part of the DBC range of a joystick; ratio of two speeds of one crane; radius of
# a tip at which its speed is stated, part of the largest.
LEAST_FULL, MOST_RATIO, LEAST_REACH = 0.2, 10.0, 0.1

Mistakes = Iterator[tuple[Place, str]]


def warnings_of(deployment: Deployment) -> list[Problem]:
    """Return warnings: unfit filters, travel or oil not stated, guesses, likely mistakes."""
    source = Source(deployment.path)
    config = deployment.config
    poor = ((place, str(one)) for place, one in verdicts(deployment) if one.word != "good")
    numbers = (*unfit(config), *unstated(deployment), *rehearsed(config), *assumptions(config))
    every = (*_pump(deployment), *poor, *numbers, *likely_mistakes(deployment))
    return [source.problem(*one) for one in every]


def _pump(deployment: Deployment) -> Mistakes:
    """Yield that the file does not say whether the pump has oil for two filtered axes at once."""
    axes = deployment.config.axes
    shaped = [name for name, axis in axes.items() if axis.filter.kind != "off"]
    crane = deployment.config.crane
    electric = crane is not None and crane.kind == "cartesian"
    if len(shaped) > 1 and not electric and not deployment.config.hydraulics:
        text = f"missing: where the pump lacks oil for {' and '.join(shaped[:2])} at once, swing is"
        cure = f"left; measure flow (canshaper calibrate {deployment.path} --together), or write"
        yield ("hydraulics",), f"{text} {cure} {{ flow: {len(axes)} }} where the oil is enough"


def likely_mistakes(deployment: Deployment) -> Mistakes:
    """Yield likely mistakes: the place, the effect, and what to write instead."""
    first: dict[tuple[str, str], str] = {}
    for name, axis in deployment.axes.items():
        command = axis.config.command
        for signal in filter(None, (command.signal, command.negative)):
            if (other := first.setdefault((command.joystick, signal), name)) != name:
                text = f"{signal} of joystick {command.joystick} also moves {other}"
                yield ("axes", name, "command", "signal"), f"{text}; write the signal of {name}"
        yield from _full(deployment, axis)
        yield from _turned(axis)
        yield from _resolutions(deployment, axis)
    yield from _senders(deployment)
    yield from _speeds(deployment)
    yield from _ids(deployment)


def _full(deployment: Deployment, axis: BoundAxis) -> Mistakes:
    """Yield a joystick that asks for full speed long before its end."""
    command = axis.config.command
    in_dbc = deployment.messages.find(deployment.joysticks[command.joystick].message.name)
    signal = None if isinstance(in_dbc, str) else find_signal(in_dbc[1], command.signal)
    most = signal.maximum if signal else None
    if command.full and command.zero is None and most and command.full < LEAST_FULL * most:
        part = 100.0 * command.full / most
        text = f"{axis.name} gets full speed at {part:.0f} % of its range in the DBC, {most:g}"
        yield ("axes", axis.name, "command", "full"), f"{text}; write the value at the end stop"


def _turned(axis: BoundAxis) -> Mistakes:
    """Yield directions whose names say that they are exchanged."""
    command, direction = axis.config.command, axis.config.valve.direction
    pairs: dict[tuple[str, str], tuple[str, str]] = {}
    if flags := command.flags:
        pairs["command", "flags"] = flags.positive, flags.negative
    if command.negative:
        pairs["command", "negative"] = command.signal, command.negative
    if direction and (signal := find_signal(axis.valve_message, direction.signal)):
        names = {raw: str(text) for raw, text in (signal.choices or {}).items()}
        both = names.get(direction.positive, ""), names.get(direction.negative, "")
        pairs["valve", "direction"] = both
    for place, (positive, negative) in pairs.items():
        if turned(positive, negative):
            text = f"{axis.name} is turned round: positive is {positive}, negative is {negative}"
            yield ("axes", axis.name, *place), f"{text}; exchange them where it is not meant"


def _resolutions(deployment: Deployment, axis: BoundAxis) -> Mistakes:
    """Yield constant signals of a valve message that look like its command, finer or coarser."""
    command = find_signal(axis.valve_message, axis.config.valve.signal)
    for one in deployment.starts:
        signal = find_signal(axis.valve_message, one.signal)
        if one.message != axis.valve_message.name or not (signal and command and command.unit):
            continue
        if (signal.unit, signal.maximum) == (command.unit, command.maximum):
            text = f"{one.signal} stays at {one.value:g} {one.unit} while {command.name} moves"
            cure = f"where both are the command of {axis.name} write also: [{one.signal}]"
            yield ("axes", axis.name, "valve"), f"{text}; {cure}"


def _senders(deployment: Deployment) -> Mistakes:
    """Yield valve messages that the DBC gives to another node than our other messages."""
    read = {node: i.message.name for i in deployment.inputs() for node in i.message.senders}
    messages = [one.fields.message for one in deployment.sent()]
    nodes = [node for one in messages for node in one.senders if node not in read]
    ours = max(nodes, key=nodes.count, default=None)
    for name, axis in deployment.axes.items():
        for node in () if axis.rewrites else axis.valve_message.senders:
            if node not in (ours, "Vector__XXX"):
                does = f", which sends {read[node]} too" if node in read else ""
                text = f"{axis.valve_message.name} is sent by {node} in the DBC{does}: where it"
                cure = "name the message that we send, or our node in its BO_"
                yield ("axes", name, "valve"), f"{text} does, two senders move the valve; {cure}"


def _speeds(deployment: Deployment) -> Mistakes:
    """Yield full speeds far below another axis' or off every radius; stop distances need them."""
    axes = {n: (a.sway.full_speed_m_s, a) for n, a in deployment.config.axes.items() if a.sway}
    fastest = max(axes, key=lambda name: axes[name][0], default="")
    for name, (speed, axis) in axes.items():
        text = ""
        if speed * MOST_RATIO < axes[fastest][0]:
            text = f"is {axes[fastest][0] / speed:.0f} times slower than {fastest}"
        elif slewing := axis.slewing:
            radius, most = speed / slewing.full_speed_rad_s, slewing.largest_radius_m
            if not LEAST_REACH * most <= radius <= 1.05 * most:
                text = f"at {slewing.full_speed_rad_s:g} rad/s (slewing) is a tip at {radius:.2g} m"
        if text:
            cure = "its way to stop may be wrong by as much; measure both, or correct the unit"
            yield ("axes", name, "sway", "full_speed_m_s"), f"{speed:g} m/s {text}: {cure}"


def _ids(deployment: Deployment) -> Mistakes:
    """Yield messages of an unused DBC file that share their id with a used message."""
    messages = [one for bus in deployment.on_bus.values() for one in bus]
    used = {(one.frame_id, one.is_extended_frame): one.name for one in messages}
    for i, file in enumerate(deployment.messages.files):
        unused = not {entry.name for entry in file.entries} & {*used.values()}
        for entry in file.entries if unused else ():
            if name := used.get(entry.key):
                text = f"{entry.name} has the id {entry.key[0]:#x} of {name}: on one bus its frames"
                yield ("dbc", i), f"{text} are taken for it; leave out the file that is not there"
