"""The text of a first deployment file."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace

from canshaper.cli.interview.first import (
    FIRST_MAX_PCT,
    FIRST_TAIL_S,
    PERIOD_RANGE,
    RADIUS_TIMEOUT_MS,
    TEN_SWINGS_S,
    FirstAxis,
    FirstCanopen,
    FirstCia408,
    FirstJoystick,
    FirstLoad,
    FirstMachine,
    FirstMotion,
    FirstScaling,
    Stopwatch,
    rounded,
    stop_distance_m,
)
from canshaper.edit.edit import plain


def first_deployment(machine: FirstMachine) -> str:
    """The deployment file, with a filter to begin with and reduced speed."""
    return "\n".join(_lines(machine)) + "\n"


def _lines(machine: FirstMachine) -> Iterator[str]:
    yield "# Written by canshaper init. Every key: docs/deployment.md."
    yield from (f"# {note}" for note in machine.notes)
    yield ""
    yield "version: 1 # of the file's format"
    yield "tick_ms: 20 # period of the control loop"
    yield ""
    yield "buses:"
    channel = plain(machine.channel)
    bus = f"interface: {machine.interface}, channel: {channel}, bitrate: {machine.bitrate}"
    if machine.data_bitrate:
        bus += f", fd: true, data_bitrate: {machine.data_bitrate}"
    if machine.canopen:
        yield from _canopen(bus, machine.canopen)
    else:
        yield f"  crane: {{ {bus} }}"
    yield ""
    yield f"dbc: [{', '.join(plain(path) for path in machine.dbc)}] # relative to this file"
    yield ""
    yield "joysticks:"
    for joystick in machine.joysticks:
        yield from _joystick(joystick)
    yield ""
    yield from _switches(machine)
    yield "axes:"
    timeouts_ms = {joystick.name: joystick.timeout_ms for joystick in machine.joysticks}
    for axis in machine.axes:
        yield from _axis(axis, timeouts_ms[axis.joystick], machine.load)
        yield ""
    if machine.motion:
        yield from _motion(machine.motion)
        yield ""
    if machine.load and machine.load.message:
        yield from _load(machine.load)
        yield ""
    for key in ("status", "identity"):
        if (message := getattr(machine, key)) is not None:
            yield f"{key}: {{ bus: crane, message: {message} }}"
            yield ""
    if assumed := [key for axis in machine.axes for key in axis.assumed()]:
        yield "# Guesses that no one has measured or typed: a verb with --write takes out what it"
        yield "# measures. What stands in a manual: correct it above, and take it out here."
        yield "assumed:"
        yield from (f"  - {key}" for key in assumed)
        yield ""
    yield from _adjustable(machine)


def _adjustable(machine: FirstMachine) -> Iterator[str]:
    by_load = bool(machine.load and machine.load.message)  # it chooses the numbers of those
    if not (settable := [axis for axis in machine.axes if not (axis.swing and by_load)]):
        return
    yield "# What `canshaper set` may change while the machine works."
    yield "control:"
    yield "  adjustable:"
    for axis in settable:
        yield f"    axes.{axis.name}.limits.max_pct: [20, 100]"
        if axis.swing:
            low, high = (rounded(share * axis.swing.period_s) for share in PERIOD_RANGE)
            yield f"    axes.{axis.name}.sway.period_s: [{low}, {high}]"


def _canopen(bus: str, canopen: FirstCanopen) -> Iterator[str]:
    yield "  crane:"
    yield from (f"    {part}" for part in bus.split(", "))
    yield "    canopen:"
    yield f"      node: {canopen.node} # ours"
    yield f"      master: {str(canopen.master).lower()} # false where another one starts the nodes"
    if canopen.nodes:
        yield "      nodes: # heartbeat_ms: silence after which one is lost"
    for name, (number, heartbeat_ms) in canopen.nodes.items():
        yield f"        {name}: {{ id: {number}, heartbeat_ms: {heartbeat_ms} }}"


def _cia408(valve: str, cia408: FirstCia408) -> Iterator[str]:
    yield "    valve:"
    yield from (f"      {part}" for part in ("bus: crane", *valve.split(", ")))
    yield "      cia408:"
    yield f"        control: {cia408.control}"
    status = f"message: {cia408.message}, signal: {cia408.signal}, timeout_ms: {cia408.timeout_ms}"
    yield f"        status: {{ bus: crane, {status} }}"
    if cia408.node:
        yield f"        node: {cia408.node}"


def _joystick(joystick: FirstJoystick) -> Iterator[str]:
    yield f"  {joystick.name}:"
    yield "    bus: crane"
    yield f"    message: {joystick.message}"
    yield f"    timeout_ms: {joystick.timeout_ms} # five lost messages"
    if joystick.cycle_ms:
        yield f"    cycle_ms: {joystick.cycle_ms}"
    if joystick.node:
        yield f"    node: {joystick.node}"
    if joystick.multiplexor is not None:
        yield f"    multiplexor: {joystick.multiplexor}"
    if joystick.enable_of:
        yield f"    enable_of: {joystick.enable_of}"
    elif joystick.enable:
        yield f"    enable: {f'{joystick.name}_enable' if joystick.switch else joystick.enable}"
    else:
        yield "    # enable: the switch that is held; without one this file is refused"
    for key in ("reset", "anti_sway_off", "alive_counter"):
        if (signal := getattr(joystick, key)) is not None:
            yield f"    {key}: {signal}"


def _switches(machine: FirstMachine) -> Iterator[str]:
    """Enable switches in messages of their own, which come as often as the joystick."""
    having = [joystick for joystick in machine.joysticks if joystick.switch]
    if not having:
        return
    yield "switches:"
    for joystick in having:
        yield f"  {joystick.name}_enable:"
        yield "    bus: crane"
        yield f"    message: {joystick.switch}"
        yield f"    signal: {joystick.enable}"
        if joystick.code is not None:
            yield f"    code: {joystick.code} # the only value that enables"
        yield f"    timeout_ms: {joystick.timeout_ms}"
        if joystick.cycle_ms:
            yield f"    cycle_ms: {joystick.cycle_ms}"
    yield ""


def _axis(axis: FirstAxis, joystick_timeout_ms: int, load: FirstLoad | None) -> Iterator[str]:
    counter = f", alive_counter: {axis.alive_counter}" if axis.alive_counter else ""
    valve = f"message: {axis.valve}, signal: {axis.signal}, timeout_ms: {axis.timeout_ms}{counter}"
    yield f"  {axis.name}:"
    command = f"joystick: {axis.joystick}, signal: {axis.command_signal}"
    command += _scaling(axis.scaling) + _codes(axis.codes)
    valve += _scaling(axis.valve_scaling)
    valve += f", cycle_ms: {axis.cycle_ms}" if axis.cycle_ms else ""
    valve += f", node: {axis.node}" if axis.node else ""
    yield f"    command: {{ {command}, neutral_pct: 2 }}"
    if axis.cia408:
        yield from _cia408(valve, axis.cia408)
    else:
        yield f"    valve: {{ bus: crane, {valve} }}"
    if axis.status:
        yield f"    status: {{ bus: crane, message: {axis.status} }}"
    limits = f"max_pct: {FIRST_MAX_PCT}, deadband_pct: 0, rise_per_s: 5, fall_per_s: 5"
    if axis.swing is None:
        yield "    filter: { kind: off } # it makes nothing swing"
        yield f"    limits: {{ {limits}, tail_s: 0.5, stop_s: 0.5 }}"
        return
    swing = axis.swing
    if slewing := axis.slewing:
        speeds = f"full_speed_rad_s: {slewing.full_speed_rad_s:g}"
        yield f"    slewing: {{ {speeds}, largest_radius_m: {slewing.largest_radius_m:g} }}"
    guess = " Assumed: no one has measured it." if swing.ten_swings_s == TEN_SWINGS_S else ""
    ten_s = f"Ten swings in {swing.ten_swings_s:g} s"
    yield f"    # {ten_s}, from {swing.first:g} to {swing.last:g}.{guess}"
    sway = swing.sway
    yield f"    {_sway(swing)}"
    if sensor := axis.sensor:
        fusion = "" if sensor.fusion_s is None else f", fusion_s: {sensor.fusion_s:g}"
        keys = f"message: {sensor.message}, signal: {sensor.signal}, kind: {sensor.kind}{fusion}"
        keys += _codes(sensor.codes)
        yield "    # Sign, delay and noise: `canshaper sensor FILE --live --write`. Then use: damp."
        timeout = f"timeout_ms: {sensor.timeout_ms}"
        timeout += f", node: {sensor.node}" if sensor.node else ""
        yield f"    sway_sensor: {{ bus: crane, {keys}, use: watch, {timeout} }}"
    yield "    # When the swing is measured: `canshaper robust FILE --axis NAME --write`."
    yield f"    {_filter(swing)}"
    if load and load.message:
        yield from _schedule(swing, load, load.ten_swings_s[axis.name])
    yield "    # First motion at reduced speed: raise max_pct when all is well."
    speed = axis.slewing.full_speed_m_s if axis.slewing else swing.full_speed_m_s
    # One response for a range of pendulums runs on a third longer.
    longest_s = load.ten_swings_s[axis.name] / 7.5 if load else sway.mode().period_s
    distance = stop_distance_m(speed, longest_s, joystick_timeout_ms, axis.timeout_ms)
    yield "    # stop_distance_m: write how far the tip may travel when it stops from full speed."
    yield "    # It is a limit, here a guess; `canshaper check` shows what the filter needs."
    tail = f"reversal: brake_shaped, tail_s: {FIRST_TAIL_S:g}, stop_s: {FIRST_TAIL_S:g}"
    yield f"    limits: {{ {limits}, {tail}, stop_distance_m: {distance:g} }}"


def _schedule(swing: Stopwatch, load: FirstLoad, ten_swings_s: float) -> Iterator[str]:
    """The swing and filter of an empty grapple and of a log."""
    yield f"    gain_schedule: # with a log ten swings in {ten_swings_s:g} s"
    with_log = replace(swing, ten_swings_s=ten_swings_s)
    for value, one in sorted([(load.empty, swing), (load.log, with_log)], key=lambda pair: pair[0]):
        yield f"      - breakpoint: {value:g}"
        yield f"        {_sway(one)}"
        yield f"        {_filter(one)}"


def _sway(swing: Stopwatch) -> str:
    sway = swing.sway
    shape = f"period_s: {sway.period_s:g}, decay_per_swing: {sway.decay_per_swing:g}"
    return f"sway: {{ {shape}, full_speed_m_s: {sway.full_speed_m_s:g} }}"


def _filter(swing: Stopwatch) -> str:
    poles = ", ".join(f"{pole:g}" for pole in swing.filter.parameters()["poles_rad_s"])
    return f"filter: {{ kind: gff, poles_rad_s: [{poles}] }}"


def _load(load: FirstLoad) -> Iterator[str]:
    yield "# What the grapple holds; silent for so long, and the axes' own filters hold."
    keys = f"message: {load.message}, signal: {load.signal}, timeout_ms: {load.timeout_ms}"
    yield f"load_state: {{ bus: crane, {keys}{_codes(load.codes)} }}"


def _scaling(scaling: FirstScaling) -> str:
    """Its keys, each after a comma."""
    text = "" if scaling.full is None else f", full: {scaling.full:.12g}"
    text += "" if scaling.zero is None else f", zero: {scaling.zero:.12g}"
    text += ", invert: true" if scaling.invert else ""
    text += f", negative: {scaling.negative}" if scaling.negative else ""
    if scaling.flags:
        names = zip(("neutral", "negative", "positive"), scaling.flags, strict=True)
        text += f", flags: {{ {', '.join(f'{key}: {name}' for key, name in names)} }}"
    return text


def _codes(codes: Mapping[str, str]) -> str:
    """Key ``codes`` of a section, after a comma."""
    means = ", ".join(f"{json.dumps(n, ensure_ascii=False)}: {m}" for n, m in codes.items())
    return f", codes: {{ {means} }}" if means else ""


def _motion(motion: FirstMotion) -> Iterator[str]:
    yield f"# While the crane slews, {motion.near_far} moves in a little and out again by itself."
    yield "# It waits until the first motion is done: the step motion of commission takes that out."
    yield "motion:"
    yield "  crane:"
    yield "    waits: true"
    yield f"    slew: {motion.slew}"
    yield f"    near_far: {motion.near_far}"
    if motion.radius:
        message, _, signal = motion.radius.partition(".")
        where = f"bus: crane, message: {message}, signal: {signal}{_codes(motion.radius_codes)}"
        yield f"    radius: {{ {where}, timeout_ms: {RADIUS_TIMEOUT_MS} }}"
