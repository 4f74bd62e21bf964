"""Makes the record of a machine, once: from the numbers of its file and cantools' signals.

Only this module and ``signals.py`` read anything outside the gate, and they read data only.
"""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from canshaper.gate.checks import HEADERS
from canshaper.gate.fields import Field, openings_of
from canshaper.gate.record import Axis, Joystick, Key, Message, Record, Switch, Valve
from canshaper.gate.signals import (
    bits_of,
    command_of,
    field_of,
    protection_of,
    rest_of,
    start_of,
    stick_of,
)

if TYPE_CHECKING:  # see signals.py
    from cantools.database.can import Message as DbcMessage

    from canshaper.config import crane, inputs, schema
    from canshaper.machine.deployment import Deployment
    from canshaper.machine.inputs import Bound
    from canshaper.machine.valves import BoundAxis

SLACK, SWING_SLACK = 0.4, 1.5
"""Slack of a filter that only spreads the demand, and of one that runs ahead of it, s of full
speed: taps at the swing's period add up, which a G_FF needs 1.04 s to damp, a robust shaper .9 s
after a bypass (gate/test_distance.py). For a swing of more than 3 s it is half a period."""
# J1939-21, -81 and -73: requests, address claims, acknowledgements, active faults, transport.
REQUEST, CLAIMED, FREE = 0x18EAFF00, 0x18EEFF00, 0xFE
SENT = (0x18E8FF00, 0x18FECA00, 0x1CECFF00, 0x1CEBFF00)
# CiA 301 and CiA 408: heartbeat, NMT start; init, disabled, hold, active, reset of a fault.
HEARTBEAT, NMT, START, WORDS = 0x700, 0x000, 1, frozenset((0x8, 0x9, 0xB, 0xF, 0x3))


def record_of(deployment: "Deployment") -> Record:
    """Return the gate's record of a deployment (``machine.Deployment``)."""
    config = deployment.config
    messages = {name: _message(name, one, config) for name, one in deployment.joysticks.items()}
    switches: dict[str, Switch] = {}
    for bound in deployment.switches:
        name = "switch " + " and ".join(bound.switches)
        messages[name] = _message(name, bound, config)
        for switch, (signal, on) in bound.switches.items():
            switches[switch] = Switch(name, field_of(bound.message, signal), on)
    stop = None
    if pressed := deployment.emergency_stop:
        messages["emergency stop"] = _message("emergency stop", pressed, config)
        stop = Switch("emergency stop", field_of(pressed.message, pressed.config.signal), 0)
    axes = {name: _axis(bound, deployment) for name, bound in deployment.axes.items()}
    for motion in config.motion.values():
        _add_motion(axes, motion, deployment)
    keys = dict.fromkeys(axis.valve for axis in axes.values())
    names = {key: tuple(n for n, axis in axes.items() if axis.valve == key) for key in keys}
    valves = {key: _valve(names[key], deployment) for key in keys}
    return Record(
        messages,
        {name: _joystick(name, deployment, switches) for name in deployment.joysticks},
        axes,
        valves,
        stop,
        {key: one for key, one in _others(deployment) if key not in valves},
        {name: (bus.interface, bus.channel) for name, bus in config.buses.items()},
        deployment.listen_only,
    )


def _message(
    name: str, bound: "Bound[inputs.InputSection]", config: "schema.DeploymentConfig"
) -> Message:
    section, message = bound.config, bound.message
    can_id = _from(message.frame_id, section.source)
    ids, group = frozenset((can_id,)), None
    if message.protocol == "j1939":
        mask = _group(can_id)
        if can_id & 0xFF == FREE:
            ids, group = frozenset(), (mask, can_id & mask)
        else:
            ids = frozenset(priority << 26 | can_id & 0x03FFFFFF for priority in range(8))
    protection = protection_of(section, message, can_id)
    page, alone = None, False
    if (chosen := bound.chosen) is not None:
        page, alone = (field_of(message, chosen.signal), chosen.value), chosen.alone
    node, most = config.buses[section.bus].j1939, min(3, protection.counts // 2)
    return Message(
        name=name,
        bus=section.bus,
        ids=ids,
        extended=message.is_extended_frame,
        length=message.length,
        timeout_ns=section.timeout_ms * 1_000_000,
        protection=protection,
        most_step=section.alive_max_step or most,
        qualify=section.qualify,
        page=page,
        alone=alone,
        group=group,
        own=node.address if node else -1,
    )


def _from(can_id: int, source: int | None) -> int:
    """Return a J1939 identifier with this source address; None leaves it as it is."""
    return can_id if source is None else can_id & ~0xFF | source


def _group(can_id: int) -> int:
    """Return the mask of a J1939 identifier's group; below PF 240 a destination follows it."""
    return 0x03FF0000 if (can_id >> 16) & 0xFF < 240 else 0x03FFFF00


def _joystick(name: str, deployment: "Deployment", switches: dict[str, Switch]) -> Joystick:
    bound = deployment.joysticks[name]
    enabling = []
    for number, (of, signal) in enumerate(bound.conditions):
        if of is None:
            enabling.append(switches[signal])
            continue
        field = field_of(deployment.joysticks[of].message, signal)
        enabling.append(Switch(of, field, 1, only_zero=number == 0 and of == name))
    pressed, *others = enabling
    config, message = bound.config, bound.message
    reset = field_of(message, config.reset) if config.reset else None
    bypass = field_of(message, config.anti_sway_off) if config.anti_sway_off else None
    return Joystick(name, pressed, tuple(others), reset, bypass, round(config.stuck_s * 1e9))


def _axis(bound: "BoundAxis", deployment: "Deployment") -> Axis:
    config, limits = bound.config, bound.config.limits
    period_s = deployment.config.tick_ms * 1e-3 * bound.period_ticks
    joystick, valve = deployment.joysticks[config.command.joystick], config.valve
    forwarded = _forwarded(config, deployment)
    rewritten, in_dbc = config.command if forwarded else None, _in_dbc(deployment, valve.message)
    command = command_of(bound.valve_message, valve, rewritten, in_dbc)
    control, start = deployment.config.control, f"axes.{bound.name}."
    curve, tip = (limits.curve_command_pct, limits.curve_speed_pct), config.slewing
    ranges = (control.adjustable if control else {}).items()
    return Axis(
        name=bound.name,
        joystick=config.command.joystick,
        signal=config.command.signal,
        stick=stick_of(
            joystick.message, config.command, _in_dbc(deployment, joystick.config.message)
        ),
        valve=_valve_key(bound, deployment),
        command=command,
        openings=openings_of(limits.deadband_pct, curve, command.size.full),
        period=bound.period_ticks,
        period_s=period_s,
        maximum=limits.max_pct / 100.0,
        rise=limits.rise_per_s * period_s,
        fall=limits.fall_per_s * period_s,
        tail=round(limits.tail_s / period_s),
        stop=max(1, round(limits.stop_s / period_s)),
        silent=valve.timeout_ms // deployment.config.tick_ms,
        faster=limits.allow_faster,
        reverse=limits.allow_reverse,
        reversal=0 if limits.reversal == "stop" else round(limits.reversal_s / period_s),
        slack=slack_of(config),
        forwarded=forwarded,
        full_m_s=config.sway.full_speed_m_s if config.sway else 1.0,
        stop_m=limits.stop_distance_m or math.inf,
        tip_m_s=tip.full_speed_rad_s * tip.largest_radius_m if tip else 0.0,
        ranges={k.removeprefix(start): (v[0], v[1]) for k, v in ranges if k.startswith(start)},
    )


def _in_dbc(deployment: "Deployment", name: str) -> "DbcMessage":
    """Return a message as the DBC has it, without the corrections of the file."""
    result = deployment.messages.find(name)
    assert not isinstance(result, str)  # checked with the deployment
    return result[1]


def slack_of(config: "schema.AxisSection") -> float:
    """Return how far a filter may run ahead of the demand, full speed times seconds, or inf."""
    if config.limits.allow_faster or config.limits.allow_reverse:
        return math.inf
    one = not (config.gain_schedule or config.profiles or config.sway_sensor)
    swings = [config.sway.mode(), *config.sway.ends()] if config.sway else []
    slow = max([SWING_SLACK, *(0.5 * swing.period_s for swing in swings)])
    return SLACK if one and not config.filter.runs_ahead else float(slow)


def _forwarded(axis: "schema.AxisSection", deployment: "Deployment") -> bool:
    """Return whether the command of an axis leaves in the frames of its own joystick."""
    gateway = deployment.config.gateway
    joystick = deployment.config.joysticks[axis.command.joystick]
    other = gateway.other(axis.valve.bus) if gateway else None
    return bool(other) and (joystick.bus, joystick.message) == (other, axis.valve.message)


def _valve_key(bound: "BoundAxis", deployment: "Deployment") -> Key:
    bus, message = bound.config.valve.bus, bound.valve_message
    can_id, node = message.frame_id, deployment.config.buses[bus].j1939
    if message.protocol == "j1939":
        source = node.address if node else None
        if _forwarded(bound.config, deployment):
            source = deployment.joysticks[bound.config.command.joystick].config.source
        can_id = _from(can_id, source)
    return bus, can_id, message.is_extended_frame


def _add_motion(axes: dict[str, Axis], motion: "crane.Motion", deployment: "Deployment") -> None:
    slew, near_far = axes[motion.slew], axes[motion.near_far] if motion.near_far else None
    for axis in filter(None, (slew, near_far)):
        axis.added = motion.max_pct / 100.0
        axis.most_periods = round(motion.max_s / axis.period_s)
    if near_far is not None:
        slew.partner, near_far.partner = near_far.name, slew.name
        sensor = deployment.axes[near_far.name].config.sway_sensor
        damps = sensor is not None and sensor.use == "damp"
        near_far.path_m = motion.max_path_m * (2.0 if damps else 1.0)
        near_far.path = near_far.path_m / near_far.full_m_s


def _valve(names: tuple[str, ...], deployment: "Deployment") -> Valve:
    bound = [deployment.axes[name] for name in names]
    first, message = bound[0], bound[0].valve_message
    valve, forwarded = first.config.valve, _forwarded(first.config, deployment)
    j1939 = message.protocol == "j1939"
    protection = protection_of(valve, message, _valve_key(first, deployment)[1])
    moving = {valve.alive_counter, valve.checksum.signal if valve.checksum else None}
    words = []
    for one in bound:
        of, command = one.config.valve, one.config.command
        moving |= {of.signal, *of.also, of.direction.signal if of.direction else None}
        if of.cia408:
            moving.add(of.cia408.control)
            words.append((field_of(message, of.cia408.control), WORDS))
        if forwarded:
            flags = command.flags.model_dump().values() if command.flags else ()
            moving |= {command.negative, *flags}
    header = 8 * HEADERS.get(valve.e2e.profile, 2) if valve.e2e else 0
    ours, known, value = (1 << header) - 1, 0, 0
    own: list[tuple[Field, frozenset[float]]] = []
    enable = deployment.joysticks[first.config.command.joystick].conditions[0].name
    for signal in message.signals:
        field = field_of(message, signal.name)
        known |= (bits := bits_of(field, message.length))
        if signal.name in moving:
            ours |= bits
            continue
        start = start_of(signal, j1939=j1939)
        value |= bits_of(field, message.length, start)
        if not bits & ours:
            rest = {1} if signal.name == enable else rest_of(signal)
            own.append((field, frozenset({start, *rest})))
    fixed = 0 if forwarded else (1 << 8 * message.length) - 1 & ~ours
    value = (value | ~known if j1939 else value) & fixed
    group = _group(message.frame_id) if j1939 and not forwarded else 0
    frame = message.length, names, fixed, value, ours, protection, tuple(words)
    if not forwarded:
        return Valve(*frame, group=group)
    return Valve(*frame, tuple(own), field_of(message, enable))


def _others(
    deployment: "Deployment",
) -> Iterator[tuple[Key, tuple[frozenset[int], frozenset[bytes]]]]:
    """Yield (key, (lengths, contents; empty: any)) of status messages and those of our nodes."""
    anything, config = frozenset[bytes](), deployment.config
    of_axes = (one.status for one in config.axes.values())
    aims = (one.aim for one in config.motion.values())
    for status in filter(None, (config.status, config.identity, *of_axes, *aims)):
        message, node = _in_dbc(deployment, status.message), config.buses[status.bus].j1939
        source = node.address if message.protocol == "j1939" and node else None
        key = status.bus, _from(message.frame_id, source), message.is_extended_frame
        yield key, (frozenset(range(message.length, 65)), anything)
    for name, bus in config.buses.items():
        if bus.j1939:
            address = bus.j1939.address
            for can_id in (CLAIMED | address, CLAIMED | FREE, *(one | address for one in SENT)):
                yield (name, can_id, True), (frozenset((8,)), anything)
            yield (name, REQUEST | FREE, True), (frozenset((3,)), anything)
        if bus.canopen:
            alive = frozenset((b"\0", b"\5"))
            yield (name, HEARTBEAT + bus.canopen.node, False), (frozenset((1,)), alive)
            if bus.canopen.master:
                starts = frozenset(bytes((START, one.id)) for one in bus.canopen.nodes.values())
                yield (name, NMT, False), (frozenset((2,)), starts)
