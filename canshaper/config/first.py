"""The text of a first deployment file, from what a person knows of a new machine."""

import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from canshaper.config.filters import Filter, filter_of
from canshaper.config.load import limits
from canshaper.config.sway import Sway
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.stopping import allowed_s

# Of the measured radius of the tip.
RADIUS_TIMEOUT_MS = 200
# Of full speed, for the first motion; raised step by step while it works.
FIRST_MAX_PCT = 40
# Tail and longest stop: what the run-on of a filter for a swing of two to three seconds takes.
FIRST_TAIL_S = 2.2
# Poles beside the frequency of the swing: the first step of the filter is what was asked, no more.
POLES_TO_OMEGA = (0.9, 1.1)
# Room for a wrong stopwatch in what may be changed while it works.
PERIOD_RANGE = (0.7, 1.4)
# What YAML takes as the text that it is.
_PLAIN = re.compile(r"(?!(?:true|false|null)$)(?:\.*/)*[^\W\d][\w./-]*", re.IGNORECASE)


@dataclass(frozen=True)
class FirstJoystick:
    """A joystick: its name, message, switches and alive counter."""

    name: str
    message: str
    timeout_ms: int
    enable: str
    reset: str | None = None
    anti_sway_off: str | None = None
    alive_counter: str | None = None


@dataclass(frozen=True)
class Stopwatch:
    """Ten swings, how far the first and the last one went, and the speed of the tip."""

    ten_swings_s: float
    first: float
    last: float
    full_speed_m_s: float

    @property
    def period_s(self) -> float:
        """Time of one full swing."""
        return self.ten_swings_s / 10.0

    @property
    def decay_per_swing(self) -> float:
        """Part of the amplitude that is lost over a full swing."""
        return 1.0 - math.pow(self.last / self.first, 0.1)

    @property
    def filter(self) -> Filter:
        """A filter to begin with."""
        omega = 2.0 * math.pi / self.period_s
        poles = [float(_rounded(-share * omega)) for share in POLES_TO_OMEGA]
        return filter_of("gff", poles_rad_s=poles)

    @property
    def sway(self) -> Sway:
        """The same as sway data of an axis."""
        period, decay = (float(_rounded(v)) for v in (self.period_s, self.decay_per_swing))
        speed = self.full_speed_m_s
        return Sway(period_s=period, decay_per_swing=decay, full_speed_m_s=speed)


@dataclass(frozen=True)
class FirstSlewing:
    """An axis that turns the crane: its full speed, and how far out the tip may be."""

    full_speed_rad_s: float
    largest_radius_m: float

    @property
    def full_speed_m_s(self) -> float:
        """Of the tip, farthest out."""
        return self.full_speed_rad_s * self.largest_radius_m


@dataclass(frozen=True)
class FirstMotion:
    """Slew and near-far as one motion, and MESSAGE.SIGNAL of the radius where it is measured."""

    slew: str
    near_far: str
    radius: str | None = None


@dataclass(frozen=True)
class FirstAxis:
    """An axis: its joystick, its valve, its swing where it has one, and how it turns the crane."""

    name: str
    joystick: str
    command_signal: str
    valve: str
    signal: str
    timeout_ms: int
    alive_counter: str | None = None
    status: str | None = None
    swing: Stopwatch | None = None
    slewing: FirstSlewing | None = None


@dataclass(frozen=True)
class FirstMachine:
    """Everything that is asked."""

    channel: str
    bitrate: int
    dbc: Sequence[str]
    joysticks: Sequence[FirstJoystick]
    axes: Sequence[FirstAxis]
    status: str | None = None
    identity: str | None = None
    motion: FirstMotion | None = None


def ten_swings_s() -> tuple[float, float]:
    """Shortest and longest time of ten swings whose period may be changed as far as is written."""
    least, most = limits(Sway, "period_s")
    low, high = 10.0 * least / PERIOD_RANGE[0], 10.0 * most / PERIOD_RANGE[1]
    # In tenths and inwards, so that both are allowed as they are told.
    return math.ceil(10.0 * low) / 10.0, math.floor(10.0 * high) / 10.0


def plain(text: str) -> str:
    """A text as it stands in YAML: in quotes where it could be read as something else."""
    return text if _PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)  # YAML too


def stop_distance_m(
    full_speed_m_s: float, joystick_timeout_ms: int, valve_timeout_ms: int
) -> float:
    """How far the first limits let the tip travel at full speed, rounded up to a tenth of a metre.

    Args:
        full_speed_m_s: speed of the tip.
        joystick_timeout_ms: age at which the joystick counts as lost.
        valve_timeout_ms: that of the valve, of which its cycle is a third at most.
    """
    way_s = allowed_s(
        OutputLimits(tail_s=FIRST_TAIL_S),
        stop_s=FIRST_TAIL_S,
        timeout_s=joystick_timeout_ms / 1000.0,
        period_s=valve_timeout_ms / 3000.0,
    )
    return math.ceil(10.0 * full_speed_m_s * way_s) / 10.0


def first_deployment(machine: FirstMachine) -> str:
    """The deployment file, with a filter to begin with and reduced speed."""
    return "\n".join(_lines(machine)) + "\n"


def _lines(machine: FirstMachine) -> Iterator[str]:
    yield "# Written by canshaper init. Every key: docs/deployment.md."
    yield ""
    yield "version: 1 # of the file's format"
    yield "tick_ms: 20 # period of the control loop"
    yield ""
    yield "buses:"
    channel = plain(machine.channel)
    bus = f"interface: socketcan, channel: {channel}, bitrate: {machine.bitrate}"
    yield f"  crane: {{ {bus} }}"
    yield ""
    yield f"dbc: [{', '.join(plain(path) for path in machine.dbc)}] # relative to this file"
    yield ""
    yield "joysticks:"
    for joystick in machine.joysticks:
        yield f"  {joystick.name}:"
        yield "    bus: crane"
        yield f"    message: {joystick.message}"
        yield f"    timeout_ms: {joystick.timeout_ms} # five lost messages"
        yield f"    enable: {joystick.enable}"
        for key in ("reset", "anti_sway_off", "alive_counter"):
            if (signal := getattr(joystick, key)) is not None:
                yield f"    {key}: {signal}"
    yield ""
    yield "axes:"
    timeouts_ms = {joystick.name: joystick.timeout_ms for joystick in machine.joysticks}
    for axis in machine.axes:
        yield from _axis(axis, timeouts_ms[axis.joystick])
        yield ""
    if machine.motion:
        yield from _motion(machine.motion)
        yield ""
    for key in ("status", "identity"):
        if (message := getattr(machine, key)) is not None:
            yield f"{key}: {{ bus: crane, message: {message} }}"
            yield ""
    yield "# What `canshaper set` may change while the machine works."
    yield "control:"
    yield "  adjustable:"
    for axis in machine.axes:
        yield f"    axes.{axis.name}.limits.max_pct: [20, 100]"
        if axis.swing:
            low, high = (_rounded(share * axis.swing.period_s) for share in PERIOD_RANGE)
            yield f"    axes.{axis.name}.sway.period_s: [{low}, {high}]"


def _axis(axis: FirstAxis, joystick_timeout_ms: int) -> Iterator[str]:
    counter = f", alive_counter: {axis.alive_counter}" if axis.alive_counter else ""
    valve = f"message: {axis.valve}, signal: {axis.signal}, timeout_ms: {axis.timeout_ms}{counter}"
    yield f"  {axis.name}:"
    command = f"joystick: {axis.joystick}, signal: {axis.command_signal}"
    yield f"    command: {{ {command}, neutral_pct: 2 }}"
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
    yield f"    # Ten swings in {swing.ten_swings_s:g} s, from {swing.first:g} to {swing.last:g}."
    sway = swing.sway
    shape = f"period_s: {sway.period_s:g}, decay_per_swing: {sway.decay_per_swing:g}"
    yield f"    sway: {{ {shape}, full_speed_m_s: {sway.full_speed_m_s:g} }}"
    poles = ", ".join(f"{pole:g}" for pole in swing.filter.parameters()["poles_rad_s"])
    yield "    # When the swing is measured: `canshaper robust FILE --axis NAME --write`."
    yield f"    filter: {{ kind: gff, poles_rad_s: [{poles}] }}"
    yield "    # First motion at reduced speed: raise max_pct when all is well."
    speed = axis.slewing.full_speed_m_s if axis.slewing else swing.full_speed_m_s
    distance = stop_distance_m(speed, joystick_timeout_ms, axis.timeout_ms)
    yield "    # stop_distance_m: farthest that the tip may travel when it stops from max_pct: 100."
    yield "    # `canshaper check` shows what the filter needs; make tail_s, stop_s and it smaller."
    tail = f"reversal: brake_shaped, tail_s: {FIRST_TAIL_S:g}, stop_s: {FIRST_TAIL_S:g}"
    yield f"    limits: {{ {limits}, {tail}, stop_distance_m: {distance:g} }}"


def _motion(motion: FirstMotion) -> Iterator[str]:
    yield f"# While the crane slews, {motion.near_far} moves in a little and out again by itself."
    yield "motion:"
    yield "  crane:"
    yield f"    slew: {motion.slew}"
    yield f"    near_far: {motion.near_far}"
    if motion.radius:
        message, _, signal = motion.radius.partition(".")
        where = f"bus: crane, message: {message}, signal: {signal}"
        yield f"    radius: {{ {where}, timeout_ms: {RADIUS_TIMEOUT_MS} }}"


def _rounded(number: float) -> str:
    return f"{number:.4g}"
