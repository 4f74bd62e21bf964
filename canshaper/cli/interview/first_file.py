"""Text of the first deployment file, from the answers."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace

from canshaper.cli.interview.first import (
    FIRST_MAX_PCT,
    FIRST_TAIL_S,
    PERIOD_RANGE,
    RADIUS_TIMEOUT_MS,
    TEN_SWINGS_S,
    FirstAxis,
    FirstCanopen,
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
    """Return the text of the deployment file, at reduced speed, with G_FF for axes that swing."""
    return "\n".join(_lines(machine)) + "\n"


def _text(value: object) -> str:
    """Return a value as YAML in one line, a float with six digits; a text must already be YAML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    return _flow(**value) if isinstance(value, Mapping) else str(value)


def _flow(**values: object) -> str:
    """Return a section as YAML in one line, without keys whose value is None."""
    texts = (f"{key}: {_text(value)}" for key, value in values.items() if value is not None)
    return f"{{ {', '.join(texts)} }}"


def _block(indent: int, **values: object) -> Iterator[str]:
    """Yield a section as YAML, a key a line, without keys whose value is None."""
    for key, value in values.items():
        if value is not None:
            yield f"{' ' * indent}{key}: {_text(value)}"


def _lines(machine: FirstMachine) -> Iterator[str]:
    yield "# Written by canshaper init. Every key: docs/deployment.md."
    yield from (f"# {note}" for note in machine.notes)
    yield ""
    yield "version: 1 # of the file's format"
    yield "tick_ms: 20 # period of the control loop"
    yield ""
    yield "buses:"
    bus: dict[str, object] = {"interface": machine.interface, "channel": plain(machine.channel)}
    bus["bitrate"] = machine.bitrate
    if machine.data_bitrate:
        bus |= {"fd": True, "data_bitrate": machine.data_bitrate}
    if machine.canopen:
        yield from _canopen(bus, machine.canopen)
    else:
        yield from _block(2, crane=bus)
    yield ""
    yield f"dbc: [{', '.join(plain(path) for path in machine.dbc)}] # relative to this file"
    yield ""
    yield "joysticks:"
    for joystick in machine.joysticks:
        yield from _joystick(joystick)
    yield ""
    yield from _switches(machine)
    yield "axes:"
    longest_ms = {one.name: max(one.timeout_ms, one.switch_ms[0]) for one in machine.joysticks}
    for one in machine.joysticks:
        longest_ms[one.name] = max(one.timeout_ms, longest_ms[one.enable_of or one.name])
    for axis in machine.axes:
        yield from _axis(axis, longest_ms[axis.joystick], machine.load)
        yield ""
    if machine.motion:
        yield from _motion(machine.motion)
        yield ""
    if (load := machine.load) and load.message:
        keys = {"message": load.message, "signal": load.signal, "cycle_ms": load.cycle_ms}
        keys |= {"timeout_ms": load.timeout_ms}
        yield "# Load of the grapple. After timeout_ms of silence the axes use their own filters."
        yield f"load_state: {_flow(bus='crane', **keys, codes=_codes(load.codes))}"
        yield ""
    for key in ("status", "identity"):
        if (message := getattr(machine, key)) is not None:
            yield f"{key}: {_flow(bus='crane', message=message)}"
            yield ""
    if assumed := [key for axis in machine.axes for key in axis.assumed()]:
        yield "# Guesses that no one has measured or typed. A verb with --write removes those it"
        yield "# measures. If a manual has the number, write it above and remove its key here."
        yield "assumed:"
        yield from (f"  - {key}" for key in assumed)
        yield ""
    yield from _adjustable(machine)


def _adjustable(machine: FirstMachine) -> Iterator[str]:
    by_load = bool(
        machine.load and machine.load.message
    )  # then the load chooses the numbers of axes that swing
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


def _canopen(bus: Mapping[str, object], canopen: FirstCanopen) -> Iterator[str]:
    yield "  crane:"
    yield from _block(4, **bus)
    yield "    canopen:"
    yield f"      node: {canopen.node} # ours"
    yield f"      master: {_text(canopen.master)} # false where another one starts the nodes"
    if canopen.nodes:
        yield "      nodes: # heartbeat_ms: silence after which one is lost"
    for name, (number, heartbeat_ms) in canopen.nodes.items():
        yield f"        {name}: {_flow(id=number, heartbeat_ms=heartbeat_ms)}"


def _joystick(joystick: FirstJoystick) -> Iterator[str]:
    enable = f"{joystick.name}_enable" if joystick.switch else joystick.enable
    yield f"  {joystick.name}:"
    yield from _block(
        4,
        bus="crane",
        message=joystick.message,
        timeout_ms=f"{joystick.timeout_ms} # five lost messages",
        cycle_ms=joystick.cycle_ms,
        node=joystick.node,
        multiplexor=joystick.multiplexor,
        enable_of=joystick.enable_of,
        enable=None if joystick.enable_of else enable,
    )
    if not (joystick.enable_of or enable):
        yield "    # enable: the switch that is held; without one this file is refused"
    keys = ("reset", "anti_sway_off", "alive_counter")
    yield from _block(4, **{key: getattr(joystick, key) for key in keys})


def _switches(machine: FirstMachine) -> Iterator[str]:
    """Yield the section ``switches``: enable switches in another message than their joystick's.

    Without such a switch there is no section.
    """
    having = [joystick for joystick in machine.joysticks if joystick.switch]
    if not having:
        return
    yield "switches:"
    for one in having:
        code = None if one.code is None else f"{one.code} # the only value that enables"
        times = dict(zip(("timeout_ms", "cycle_ms"), one.switch_ms, strict=True))
        yield f"  {one.name}_enable:"
        yield from _block(4, bus="crane", message=one.switch, signal=one.enable, code=code, **times)
    yield ""


def _axis(axis: FirstAxis, joystick_timeout_ms: int, load: FirstLoad | None) -> Iterator[str]:
    command = {"joystick": axis.joystick, "signal": axis.command_signal, **_scaling(axis.scaling)}
    valve: dict[str, object] = {"bus": "crane", "message": axis.valve, "signal": axis.signal}
    valve |= {"timeout_ms": axis.timeout_ms, "alive_counter": axis.alive_counter}
    valve |= _scaling(axis.valve_scaling) | {"cycle_ms": axis.cycle_ms, "node": axis.node}
    yield f"  {axis.name}:"
    yield f"    command: {_flow(**command, codes=_codes(axis.codes), neutral_pct=2)}"
    if cia408 := axis.cia408:
        status = {"bus": "crane", "message": cia408.message, "signal": cia408.signal}
        status["timeout_ms"] = f"{cia408.timeout_ms}"
        yield "    valve:"
        yield from _block(6, **valve)
        yield "      cia408:"
        yield from _block(8, control=cia408.control, status=status, node=cia408.node)
    else:
        yield from _block(4, valve=valve)
    if axis.status:
        yield f"    status: {_flow(bus='crane', message=axis.status)}"
    limits = {"max_pct": FIRST_MAX_PCT, "deadband_pct": 0, "rise_per_s": 5, "fall_per_s": 5}
    if axis.swing is None:
        yield "    filter: { kind: off } # it makes nothing swing"
        yield f"    limits: {_flow(**limits, tail_s=0.5, stop_s=0.5)}"
        return
    swing = axis.swing
    yield from _block(4, slewing=axis.slewing and asdict(axis.slewing))
    guess = " Assumed: no one has measured it." if swing.ten_swings_s == TEN_SWINGS_S else ""
    ten_s = f"Ten swings in {swing.ten_swings_s:g} s"
    yield f"    # {ten_s}, from {swing.first:g} to {swing.last:g}.{guess}"
    yield f"    {_sway(swing)}"
    if sensor := axis.sensor:
        keys: dict[str, object] = {"message": sensor.message, "signal": sensor.signal}
        keys |= {"kind": sensor.kind, "fusion_s": sensor.fusion_s, "codes": _codes(sensor.codes)}
        keys |= {"use": "watch", "timeout_ms": sensor.timeout_ms, "node": sensor.node}
        yield "    # Sign, delay and noise: `canshaper sensor FILE --live --write`. Then use: damp."
        yield f"    sway_sensor: {_flow(bus='crane', **keys)}"
    yield "    # After the swing is measured: `canshaper robust FILE --axis NAME --write`."
    yield f"    {_filter(swing)}"
    if load and load.message:
        yield from _schedule(swing, load, load.ten_swings_s[axis.name])
    yield "    # First motion at reduced speed: raise max_pct when all is well."
    speed = axis.slewing.full_speed_m_s if axis.slewing else swing.full_speed_m_s
    # One response for a range of pendulums runs on a third longer.
    longest_s = load.ten_swings_s[axis.name] / 7.5 if load else swing.sway.mode().period_s
    distance_m = stop_distance_m(speed, longest_s, joystick_timeout_ms, axis.timeout_ms)
    yield "    # stop_distance_m: write how far the tip may travel when it stops from full speed."
    yield "    # It is a limit, here a guess; `canshaper check` shows what the filter needs."
    tail = {"reversal": "brake_shaped", "tail_s": FIRST_TAIL_S, "stop_s": FIRST_TAIL_S}
    yield f"    limits: {_flow(**limits, **tail, stop_distance_m=distance_m)}"


def _schedule(swing: Stopwatch, load: FirstLoad, ten_swings_s: float) -> Iterator[str]:
    """Yield the gain schedule: sway and filter of empty grapple and log, by value of the load."""
    yield f"    gain_schedule: # with a log ten swings in {ten_swings_s:g} s"
    with_log = replace(swing, ten_swings_s=ten_swings_s)
    for value, one in sorted([(load.empty, swing), (load.log, with_log)], key=lambda pair: pair[0]):
        yield f"      - breakpoint: {value:g}"
        yield f"        {_sway(one)}"
        yield f"        {_filter(one)}"


def _sway(swing: Stopwatch) -> str:
    keys = ("period_s", "decay_per_swing", "full_speed_m_s")
    return f"sway: {_flow(**{key: getattr(swing.sway, key) for key in keys})}"


def _filter(swing: Stopwatch) -> str:
    poles = ", ".join(f"{pole:g}" for pole in swing.filter.parameters()["poles_rad_s"])
    return f"filter: {{ kind: gff, poles_rad_s: [{poles}] }}"


def _scaling(scaling: FirstScaling) -> dict[str, object]:
    """Return the keys of a scaling, by name; None for a key that is left out."""
    full, zero = (v if v is None else f"{v:.12g}" for v in (scaling.full, scaling.zero))
    names = ("neutral", "negative", "positive")
    return {
        "full": full,
        "zero": zero,
        "invert": scaling.invert or None,
        "negative": scaling.negative,
        "flags": scaling.flags and dict(zip(names, scaling.flags, strict=True)),
    }


def _codes(codes: Mapping[str, str]) -> dict[str, str] | None:
    """Return the value of a key ``codes``: meanings by quoted name; None without a code."""
    return {json.dumps(name, ensure_ascii=False): means for name, means in codes.items()} or None


def _motion(motion: FirstMotion) -> Iterator[str]:
    yield f"# While the crane slews, {motion.near_far} moves in a little and out again by itself."
    yield "# waits: true keeps it off; the step motion of commission removes that key."
    yield "motion:"
    yield "  crane:"
    yield from _block(4, waits=True, slew=motion.slew, near_far=motion.near_far)
    if motion.radius:
        message, _, signal = motion.radius.partition(".")
        keys = {"message": message, "signal": signal, "codes": _codes(motion.radius_codes)}
        yield f"    radius: {_flow(bus='crane', **keys, timeout_ms=RADIUS_TIMEOUT_MS)}"
