"""Knowledge of a person about a new machine, for its first deployment file."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from canshaper.config.filters import Filter, filter_of
from canshaper.config.limits import Limits, Sway
from canshaper.config.load import limits

# Proposals where nothing is known: ten swings in s, speeds of the tip (m/s) and of slewing (rad/s),
# largest radius in m, timeout of a valve in ms. What stays as it is, the file says as assumed.
TEN_SWINGS_S, TIP_M_S, SLEWING_RAD_S, RADIUS_M, VALVE_TIMEOUT_MS = 23.6, 1.0, 0.5, 9.0, 200
# Of the measured radius of the tip.
RADIUS_TIMEOUT_MS = 200
# Of full speed, for the first motion; raised step by step while it works.
FIRST_MAX_PCT = 40
# Tail and longest stop: what the run-on of a filter for a swing of two to three seconds takes.
FIRST_TAIL_S = 2.2
# Run-on of the first day: 0.36 periods are those of robust 1.8 s at 2.36 s, and a quarter more.
RUN_ON_PERIODS = 0.45
# Poles next to the frequency of the swing: the first step of the filter is what was asked, no more.
POLES_TO_OMEGA = (0.9, 1.1)
# Room for a wrong stopwatch in what may be changed while it works.
PERIOD_RANGE = (0.7, 1.4)


@dataclass(frozen=True)
class FirstJoystick:
    """A joystick: its name, message, switches and alive counter; its cycle, where the DBC has none.

    ``switch`` is the message of its enable switch, where that is another one, ``code`` the value
    of that signal that enables, ``enable_of`` the joystick whose switch enables it; ``node`` is the
    name of its node on CANopen, ``multiplexor`` the value with which a multiplexed message counts.
    """

    name: str
    message: str
    timeout_ms: int
    enable: str | None
    reset: str | None = None
    anti_sway_off: str | None = None
    alive_counter: str | None = None
    cycle_ms: int | None = None
    switch: str | None = None
    node: str | None = None
    enable_of: str | None = None
    multiplexor: int | None = None
    code: int | None = None


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
        poles = [float(rounded(-share * omega)) for share in POLES_TO_OMEGA]
        return filter_of("gff", poles_rad_s=poles)

    @property
    def sway(self) -> Sway:
        """Sway data of an axis, as measured by the stopwatch."""
        period, decay = (float(rounded(v)) for v in (self.period_s, self.decay_per_swing))
        speed = self.full_speed_m_s
        return Sway(period_s=period, decay_per_swing=decay, full_speed_m_s=speed)


@dataclass(frozen=True)
class FirstSlewing:
    """An axis that turns the crane: its full speed, and how far out the tip may be."""

    full_speed_rad_s: float
    largest_radius_m: float

    @property
    def full_speed_m_s(self) -> float:
        """Full speed of the tip, farthest out."""
        return self.full_speed_rad_s * self.largest_radius_m


@dataclass(frozen=True)
class FirstMotion:
    """Slew and near-far as one motion, and MESSAGE.SIGNAL of the radius where it is measured."""

    slew: str
    near_far: str
    radius: str | None = None
    radius_codes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class FirstLoad:
    """Time of ten swings with a log, by axis, and the signal that says that there is one.

    Without a signal one response has to hold for both; ``empty`` and ``log`` are its values.
    """

    ten_swings_s: Mapping[str, float]
    message: str | None = None
    signal: str = ""
    timeout_ms: int = 0
    empty: float = 0.0
    log: float = 0.0
    codes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class FirstSensor:
    """A sway sensor, to be watched first; an inclination has a time constant of its fusion."""

    message: str
    signal: str
    kind: str
    timeout_ms: int
    fusion_s: float | None = None
    node: str | None = None
    codes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class FirstCanopen:
    """Our node on a bus of CANopen, and the others: id and longest silence (ms) by name."""

    node: int
    master: bool
    nodes: Mapping[str, tuple[int, int]]


@dataclass(frozen=True)
class FirstCia408:
    """A valve of CiA 408: its control word, and message and signal of its status word."""

    control: str
    message: str
    signal: str
    timeout_ms: int
    node: str | None = None


@dataclass(frozen=True)
class FirstScaling:
    """Meaning of a signal where the DBC does not give it.

    ``flags`` are those of neutral, negative and positive, ``negative`` is the second signal of a
    rocker.
    """

    full: float | None = None
    zero: float | None = None
    invert: bool = False
    flags: tuple[str, str, str] | None = None
    negative: str | None = None


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
    sensor: FirstSensor | None = None
    scaling: FirstScaling = field(default_factory=FirstScaling)
    valve_scaling: FirstScaling = field(default_factory=FirstScaling)
    cycle_ms: int | None = None
    cia408: FirstCia408 | None = None
    node: str | None = None
    """CANopen node of a valve without CiA 408."""
    codes: Mapping[str, str] = field(default_factory=dict)
    """Codes of its command, see ``NamedCodes``."""
    timeout_known: bool = False
    """Whether the timeout is that of an EDS, or typed."""

    def assumed(self) -> list[str]:
        """Keys of numbers that are proposals still."""
        keys = [] if self.timeout_known else ["valve.timeout_ms"]
        if self.swing and self.swing.ten_swings_s == TEN_SWINGS_S:
            keys += ["sway.period_s", "sway.decay_per_swing"]
        if self.swing and self.swing.full_speed_m_s == TIP_M_S:
            keys.append("sway.full_speed_m_s")
        if self.slewing and self.slewing.full_speed_rad_s == SLEWING_RAD_S:
            keys.append("slewing.full_speed_rad_s")
        if self.slewing and self.slewing.largest_radius_m == RADIUS_M:
            keys.append("slewing.largest_radius_m")
        if self.swing:
            keys.append("limits.stop_distance_m")
        return [f"axes.{self.name}.{key}" for key in keys]


@dataclass(frozen=True)
class FirstMachine:
    """Everything that is asked; ``notes`` are said at the top of the file."""

    channel: str
    bitrate: int
    dbc: Sequence[str]
    joysticks: Sequence[FirstJoystick]
    axes: Sequence[FirstAxis]
    status: str | None = None
    identity: str | None = None
    motion: FirstMotion | None = None
    interface: str = "socketcan"
    canopen: FirstCanopen | None = None
    data_bitrate: int | None = None
    """Bit rate of the data of a bus of CAN FD."""
    notes: Sequence[str] = field(default=())
    load: FirstLoad | None = None


def ten_swings_s() -> tuple[float, float]:
    """Shortest and longest time of ten swings whose period may be changed as far as is written."""
    least, most = limits(Sway, "period_s")
    low, high = 10.0 * least / PERIOD_RANGE[0], 10.0 * most / PERIOD_RANGE[1]
    # In tenths and inwards, so that both are allowed as they are written.
    return math.ceil(10.0 * low) / 10.0, math.floor(10.0 * high) / 10.0


def stop_distance_m(
    full_speed_m_s: float, period_s: float, joystick_timeout_ms: int, valve_timeout_ms: int
) -> float:
    """Room for the run-on of a filter and for a lost joystick, rounded up to a tenth of a metre.

    At most what a file may have: no machine with sense needs more.

    Args:
        full_speed_m_s: speed of the tip.
        period_s: of the swing; a filter that we recommend runs on for a third of it.
        joystick_timeout_ms: age at which the joystick counts as lost.
        valve_timeout_ms: that of the valve, of which its cycle is a third at most.
    """
    waits_s = joystick_timeout_ms / 1000.0 + 2.0 * valve_timeout_ms / 3000.0
    distance_m = math.ceil(10.0 * full_speed_m_s * (waits_s + RUN_ON_PERIODS * period_s)) / 10.0
    return min(distance_m, limits(Limits, "stop_distance_m")[1])


def rounded(number: float) -> str:
    """A number as it is written."""
    return f"{number:.4g}"
