"""The text of a first deployment file, from what a person knows of a new machine."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

# Of full speed, for the first motion; raised step by step while it works.
FIRST_MAX_PCT = 40
# Poles beside the frequency of the swing: the first step of the filter is what was asked, no more.
POLES_TO_OMEGA = (0.9, 1.1)
# Room for a wrong stopwatch in what may be changed while it works.
PERIOD_RANGE = (0.7, 1.4)


@dataclass(frozen=True)
class FirstLever:
    """A lever: its name, message, switches and alive counter."""

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


@dataclass(frozen=True)
class FirstAxis:
    """An axis: its stick, its valve, and its swing where it has one."""

    name: str
    lever: str
    stick: str
    valve: str
    signal: str
    timeout_ms: int
    alive_counter: str | None = None
    status: str | None = None
    swing: Stopwatch | None = None


@dataclass(frozen=True)
class FirstMachine:
    """Everything that is asked."""

    channel: str
    bitrate: int
    dbc: Sequence[str]
    levers: Sequence[FirstLever]
    axes: Sequence[FirstAxis]
    status: str | None = None


def first_deployment(machine: FirstMachine) -> str:
    """The deployment file, with a filter to begin with and reduced speed."""
    return "\n".join(_lines(machine)) + "\n"


def _lines(machine: FirstMachine) -> Iterator[str]:
    yield "# Written by canshaper init. Every key: docs/deployment.md."
    yield ""
    yield "tick_ms: 20 # period of the control loop"
    yield ""
    yield "buses:"
    bus = f"interface: socketcan, channel: {machine.channel}, bitrate: {machine.bitrate}"
    yield f"  crane: {{ {bus} }}"
    yield ""
    yield f"dbc: [{', '.join(machine.dbc)}] # relative to this file"
    yield ""
    yield "levers:"
    for lever in machine.levers:
        yield f"  {lever.name}:"
        yield "    bus: crane"
        yield f"    message: {lever.message}"
        yield f"    timeout_ms: {lever.timeout_ms} # five lost messages"
        yield f"    enable: {lever.enable}"
        for key in ("reset", "anti_sway_off", "alive_counter"):
            if (signal := getattr(lever, key)) is not None:
                yield f"    {key}: {signal}"
    yield ""
    yield "axes:"
    for axis in machine.axes:
        yield from _axis(axis)
        yield ""
    if machine.status:
        yield f"status: {{ bus: crane, message: {machine.status} }}"
        yield ""
    yield "# What `canshaper set` may change while the machine works."
    yield "control:"
    yield "  adjustable:"
    for axis in machine.axes:
        yield f"    axes.{axis.name}.limits.max_pct: [20, 100]"
        if axis.swing:
            low, high = (_rounded(share * axis.swing.period_s) for share in PERIOD_RANGE)
            yield f"    axes.{axis.name}.sway.period_s: [{low}, {high}]"


def _axis(axis: FirstAxis) -> Iterator[str]:
    counter = f", alive_counter: {axis.alive_counter}" if axis.alive_counter else ""
    valve = f"message: {axis.valve}, signal: {axis.signal}, timeout_ms: {axis.timeout_ms}{counter}"
    yield f"  {axis.name}:"
    yield f"    stick: {{ lever: {axis.lever}, signal: {axis.stick}, neutral_pct: 2 }}"
    yield f"    valve: {{ bus: crane, {valve} }}"
    if axis.status:
        yield f"    status: {{ bus: crane, message: {axis.status} }}"
    limits = f"max_pct: {FIRST_MAX_PCT}, deadband_pct: 0, rise_per_s: 5, fall_per_s: 5"
    if axis.swing is None:
        yield "    filter: { kind: off } # it makes nothing swing"
        yield f"    limits: {{ {limits}, tail_s: 0.5, stop_s: 0.5 }}"
        return
    swing = axis.swing
    yield f"    # Ten swings in {swing.ten_swings_s:g} s, from {swing.first:g} to {swing.last:g}."
    period, decay = _rounded(swing.period_s), _rounded(swing.decay_per_swing)
    speed = f"full_speed_m_s: {swing.full_speed_m_s:g}"
    yield f"    sway: {{ period_s: {period}, decay_per_swing: {decay}, {speed} }}"
    omega = 2.0 * math.pi / swing.period_s
    poles = ", ".join(_rounded(-share * omega) for share in POLES_TO_OMEGA)
    yield "    # To begin with; better is `canshaper robust FILE --axis NAME --write`."
    yield f"    filter: {{ kind: gff, poles_rad_s: [{poles}] }}"
    yield "    # First motion at reduced speed: raise max_pct when all is well."
    yield f"    limits: {{ {limits}, tail_s: 2.2, stop_s: 2.2 }}"


def _rounded(number: float) -> str:
    return f"{number:.4g}"
