"""Constant tables of the C in ``c/`` from a deployment: numbers only, no code.

The numbers are read from the objects that the controller runs, so that no rule is computed twice.
Every key of the file that the C does not support is refused, all in one error. Status messages,
valve feedback and numbers that change at run time are left out: valve frames do not need them.
"""

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any

from cantools.database.can import Message

from canshaper.codec.frame import MessageKey
from canshaper.codec.layout import CLASSICAL_BYTES, is_fd, is_j1939
from canshaper.codec.message import SequenceChecker
from canshaper.codec.signals import find_signal, special_codes
from canshaper.codec.velocity import VelocitySignal
from canshaper.config.source import Place
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.controller import Controller
from canshaper.controller.couplings import MotionControl
from canshaper.errors import ConfigError
from canshaper.gate.cycle import longest_gap_ns
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.shapers.smoothing import FirstOrder, SCurve
from canshaper.shaping.transfer import Off

Numbers = dict[str, Any]  # a struct of the tables: values by member; an absent member is 0
Refusals = Iterator[tuple[Place, str]]
_MESSAGE = "bus message alive_counter cycle_ms timeout_ms"
EXPORTED: dict[Place, str] = {
    (): "version tick_ms tick buses dbc joysticks axes motion status identity control assumed crane"
    " still_deg uncertainty accept",
    ("buses", "*"): "interface channel bitrate fd data_bitrate options match unconfirmed network",
    ("joysticks", "*"): f"{_MESSAGE} alive_max_step qualify enable reset anti_sway_off stuck_s",
    ("axes", "*"): "command valve feedback status sway slewing filter limits",
    ("axes", "*", "command"): "signal full zero invert joystick codes neutral_pct",
    ("axes", "*", "valve"): f"{_MESSAGE} signal full zero invert",
    ("axes", "*", "sway"): "full_speed_m_s length_m damping_nms mass_kg period_s damping_ratio"
    " decay_per_swing origin",
    ("axes", "*", "limits"): "max_pct min_pct rise_per_s fall_per_s deadband_pct curve_command_pct"
    " curve_speed_pct curve_origin tail_s stop_s stop_distance_m allow_faster allow_reverse"
    " reversal reversal_s",
    ("axes", "*", "slewing"): "full_speed_rad_s largest_radius_m",
    ("motion", "*"): "slew near_far radius radius_m max_pct max_path_m max_s aim waits",
    ("motion", "*", "radius"): f"{_MESSAGE} alive_max_step qualify signal codes",
}
"""Keys of the file that the C follows, or that no valve frame hangs on, by their sections."""
KINDS: dict[type, str] = {
    Off: "CS_OFF",
    Fir: "CS_FIR",
    LimitAware: "CS_ROBUST",
    Gff: "CS_GFF",
    FirstOrder: "CS_FIRST_ORDER",
    SCurve: "CS_S_CURVE",
}
"""Filters of the C, by their classes in Python."""
MOST_BITS = 24  # most bits of a signal: more are not exact in float
UNLIMITED_TICKS = 2_000_000_000  # no limit: the C counts less


def tables(deployment: Deployment) -> Numbers:
    """Return the tables of a deployment, as the struct ``cs_config``.

    Raises:
        ConfigError: names every key that the C does not support.
    """
    controller = Controller(deployment)
    if problems := [deployment.source.problem(*one) for one in _refused(deployment, controller)]:
        raise ConfigError(problems)
    buses, joysticks = list(deployment.config.buses), list(deployment.joysticks)
    last = {control.valve.key: control for control in controller.axes.values()}
    return {
        "tick_ns": deployment.config.tick_ms * 1_000_000,
        "longest_gap_ns": longest_gap_ns(deployment),
        "joystick": [_joystick(deployment, name, buses) for name in joysticks],
        "valve": [_valve(control, buses) for control in last.values()],
        "axis": [
            {
                **_wiring(control, deployment, joysticks),
                "valve": [*last].index(control.valve.key),
                "sends": last[control.valve.key] is control,
                **_filter(control.axis),
                **_limits(control.axis),
            }
            for control in controller.axes.values()
        ],
        "motion": [
            _motion(deployment, name, one, list(controller.axes), buses)
            for name, one in zip(deployment.motions, controller.motions, strict=True)
        ],
    }


def _refused(deployment: Deployment, controller: Controller) -> Refusals:
    """Yield each place that the C does not support, and what was expected there."""
    for pattern, keys in EXPORTED.items():
        for place, section in _sections((), deployment.config, pattern):
            for key, value in section:
                default = type(section).model_fields[key].get_default(call_default_factory=True)
                if key not in keys.split() and value != default:
                    yield (*place, key), "expected none in an export, for which C has no part"
    for name, joystick in deployment.joysticks.items():
        config, place = joystick.config, ("joysticks", name)
        if len(joystick.conditions) != 1 or joystick.enable is None:
            yield (*place, "enable"), "expected one switch of its own message in an export"
        read = [config.reset, config.anti_sway_off, joystick.enable, joystick.protection.counter]
        read += [one.name for one in joystick.velocities]
        yield from _unreadable(place, joystick.message, read)
    for name, axis in deployment.axes.items():
        written = [axis.config.valve.signal, axis.valve.message.protection.counter]
        yield from _unreadable(("axes", name, "valve"), axis.valve_message, written)
        shaper = controller.axes[name].axis.transfer.shaper
        inner = shaper.shaper if isinstance(shaper, LimitAware) else shaper
        if type(shaper) not in KINDS or type(inner) not in KINDS:
            text = f"expected a filter that C has, got {axis.config.filter.kind}"
            yield ("axes", name, "filter", "kind"), text
    for name, motion in deployment.motions.items():
        if one := motion.radius:
            read = [one.signal.name, one.protection.counter]
            yield from _unreadable(("motion", name, "radius"), one.message, read)


def _sections(place: Place, section: Any, pattern: Place) -> Iterator[tuple[Place, Any]]:
    """Yield the sections that match a pattern, with their places; * matches every name."""
    if not pattern:
        yield place, section
        return
    key, rest = pattern[0], pattern[1:]
    for name, one in section.items() if key == "*" else [(key, getattr(section, str(key)))]:
        if one is not None:
            yield from _sections((*place, name), one, rest)


def _unreadable(place: Place, message: Message, names: Iterable[str | None]) -> Refusals:
    """Yield why the C cannot read or write a message or these of its signals."""
    if is_j1939(message) or is_fd(message) or message.length > CLASSICAL_BYTES:
        text = "expected classical CAN without J1939 in an export"
        yield (*place, "message"), f"{text}, got {message.name}"
    for name in filter(None, names):
        signal = find_signal(message, name)
        if signal is None or signal.is_float or signal.length > MOST_BITS:
            text = f"expected a whole signal of up to {MOST_BITS} bits in an export, got {name}"
            yield (*place, "message"), text


def _field(message: Message, name: str | None) -> Numbers:
    if not name or (signal := find_signal(message, name)) is None:
        return {}
    numbers = {n: getattr(signal, n) for n in ("start", "length", "is_signed")}
    return {**numbers, "motorola": signal.byte_order == "big_endian"}


def _key(key: MessageKey, length: int, buses: list[str]) -> Numbers:
    return {"bus": buses.index(key[0]), "id": key[1], "extended": key[2], "length": length}


def _message(bound: BoundInput, buses: list[str]) -> Numbers:
    """Return the members of ``cs_message_config``."""
    config, protection = bound.config, bound.protection
    return {
        **_key(bound.key, bound.message.length, buses),
        "counter": _field(bound.message, protection.counter),
        "counts": protection.counts,
        "max_step": SequenceChecker(protection, config.alive_max_step, config.qualify).max_step,
        "qualify": config.qualify,
        "timeout_ns": config.timeout_ms * 1_000_000,
    }


def _number(message: Message, one: VelocitySignal) -> Numbers:
    """Return the members of ``cs_number_config``."""
    codes = [{"code": int(code), "reason": int(reason)} for code, reason in one.special.items()]
    numbers = {n: float(getattr(one, n)) for n in ("scale", "offset", "full", "low", "high")}
    return {"field": _field(message, one.name), **numbers, "codes": codes, "codes_n": len(codes)}


def _joystick(deployment: Deployment, name: str, buses: list[str]) -> Numbers:
    bound = deployment.joysticks[name]
    message, config = bound.message, bound.config
    numbers = [_number(message, one) for one in _velocities(deployment, name).values()]
    return {
        "message": _message(bound, buses),
        "enable": _field(message, bound.enable),
        "reset": _field(message, config.reset),
        "off": _field(message, config.anti_sway_off),
        "frozen_ns": round(config.stuck_s * 1e9),
        "number": numbers,
        "numbers_n": len(numbers),
    }


def _velocities(deployment: Deployment, joystick: str) -> dict[str, VelocitySignal]:
    """Return the velocity signals of a joystick, each once though several axes may read it."""
    every = deployment.joysticks[joystick].velocities
    return {one.name: one for one in every if isinstance(one, VelocitySignal)}


def _valve(control: AxisControl, buses: list[str]) -> Numbers:
    sent = control.bound.valve.message
    data = sent.fields.layout.encode(dict(sent.start))
    return {
        **_key(sent.key, len(data), buses),
        "start": [*data],
        "counter": _field(sent.fields.message, sent.protection.counter),
        "counts": sent.protection.counts,
    }


def _wiring(control: AxisControl, deployment: Deployment, joysticks: list[str]) -> Numbers:
    """Return which joystick gives an axis its demand, and where its setpoint goes."""
    bound, command, valve = control.bound, control.bound.config.command, control.bound.valve
    return {
        "joystick": joysticks.index(command.joystick),
        "number": [*_velocities(deployment, command.joystick)].index(command.signal),
        "period_ticks": control.period_ticks,
        "setpoint": _field(bound.valve_message, bound.config.valve.signal),
        "zero": valve.zero,
        "sign": valve.sign,
    }


def _filter(axis: ShapedAxis) -> Numbers:
    """Return sway model and filter of an axis."""
    transfer, sway = axis.transfer, axis.sway
    shaper = transfer.shaper
    numbers: Numbers = {"kind": KINDS[type(shaper)], "tick_s": axis.tick_s, "fade": transfer.fade}
    if sway is not None:
        numbers |= {"sways": True, **{n: getattr(sway, n) for n in ("f11", "f12", "f21", "f22")}}
    fir, gff = (shaper.shaper, shaper.gff) if isinstance(shaper, LimitAware) else (shaper, shaper)
    if isinstance(fir, Fir):
        pairs = enumerate(pairwise((*fir.taps, math.inf)), 1)
        runs = [{"end": end, "tap": tap} for end, (tap, following) in pairs if tap != following]
        numbers |= {"runs": runs, "runs_n": len(runs), "taps_n": len(fir.taps)}
    if isinstance(gff, Gff):
        numbers |= {"k1": gff.k1, "k2": gff.k2, "share": gff.share}
    if isinstance(shaper, FirstOrder):
        numbers["share"] = shaper.share
    if isinstance(shaper, SCurve):
        numbers |= {"rate": shaper.rate, "change": shaper.jerk * shaper.tick_s}
    return numbers


def _limits(axis: ShapedAxis) -> Numbers:
    """Return limits of an axis, and what a motion may add to it."""
    stage, limits = axis.stage, axis.stage.limits
    numbers: Numbers = {
        "neutral_band": axis.neutral_band,
        **dict(zip(("rise", "fall"), stage.rates, strict=True)),
        "steps": stage.grid_steps,
        "tail": stage.tail,
        "reversal": min(stage.reversal, UNLIMITED_TICKS),
        "stop_ticks": axis.states.stop_ticks,
        "spreads": stage.spreads,
        "small_least": stage.small.least,
        "small_most": stage.small.most,
        "largest_added": float(stage.largest_added),
        "added_ticks": axis.added_time.ticks,
    }
    same = ("maximum", "minimum", "fall_per_s", "deadband", "run_on", "allow_faster")
    numbers |= {name: getattr(limits, name) for name in (*same, "allow_reverse")}
    if curve := limits.curve:
        numbers |= {"curve_command": [*curve.commands], "curve_speed": [*curve.speeds]}
        numbers["curve_n"] = len(curve.speeds)
    return numbers


def _motion(
    deployment: Deployment, name: str, control: MotionControl, axes: list[str], buses: list[str]
) -> Numbers:
    """Return the members of ``cs_motion_config``."""
    bound, motion = deployment.motions[name], control.motion
    config, near_far = bound.config, bound.config.near_far
    members = [one for one in (motion.slew, motion.near_far) if one]
    same = ("full_speed", "period_s", "stiffness", "damping", "lag_s", "farthest", "fall_per_s")
    numbers: Numbers = {
        "slew": axes.index(config.slew),
        "near_far": axes.index(near_far) if near_far else -1,  # none
        "path_m": motion.path_m,
        "circle_m": control.circle_m or 0.0,
        "tick_s": control.tick_s,
        "moving": [
            {**{n: getattr(one, n) for n in same}, "bounded": one.farthest < math.inf}
            for one in members
        ],
    }
    if radius := bound.radius:
        signal, codes = radius.signal, special_codes(radius.signal)
        ends = signal.minimum or 0.0, signal.maximum or 0.0
        one = VelocitySignal(signal.name, signal.scale, signal.offset, 1.0, codes, *ends)
        numbers |= {"measured": True, "message": _message(radius, buses)}
        numbers["radius"] = _number(radius.message, one)
    return numbers
