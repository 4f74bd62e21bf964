"""Answers of ``canshaper init`` as data: what its first deployment file is written from."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from canshaper.config.filters import Filter, filter_of
from canshaper.config.limits import Limits, Sway
from canshaper.config.load import limits

# Proposals where nothing is known: time of ten swings (s), speeds of the tip (m/s) and of slewing
# (rad/s), largest radius (m), timeout of a valve (ms). The file lists unchanged ones as assumed.
TEN_SWINGS_S, TIP_M_S, SLEWING_RAD_S, RADIUS_M, VALVE_TIMEOUT_MS = 23.6, 1.0, 0.5, 9.0, 200
# Timeout of the measured radius of the tip.
RADIUS_TIMEOUT_MS = 200
# Percent of full speed for the first motion; a person raises it step by step.
FIRST_MAX_PCT = 40
# Tail and longest stop: the run-on of a filter for a swing of two to three seconds fits in.
FIRST_TAIL_S = 2.2
# Run-on in periods of the swing: 0.36 of a robust shaper of 1.8 s at 2.36 s, and a quarter more.
RUN_ON_PERIODS = 0.45
# Poles around the frequency of the swing: the first step of the output equals the command's.
POLES_TO_OMEGA = (0.9, 1.1)
# Range of the period that may be set on the running machine: room for a wrong stopwatch.
PERIOD_RANGE = (0.7, 1.4)


@dataclass(frozen=True)
class FirstJoystick:
    """A joystick: its message and its switches.

    Attributes:
        enable, reset, anti_sway_off: signals of its switches; a bit of one is SIGNAL/BIT.
        cycle_ms: cycle of its message if the DBC states none.
        switch: message of its enable switch if that is another one.
        switch_ms: timeout of that message, and its cycle if the DBC states none.
        code: value of ``enable`` that enables, if its values have names.
        enable_of: joystick whose switch enables this one.
        node: its CANopen node, if that has a heartbeat.
        multiplexor: value of the multiplexor with which its message carries the joystick.
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
    switch_ms: tuple[int, int | None] = (0, None)
    node: str | None = None
    enable_of: str | None = None
    multiplexor: int | None = None
    code: int | None = None


@dataclass(frozen=True)
class Stopwatch:
    """Ten swings by the stopwatch.

    ``first`` and ``last``: amplitude of the first swing and of that after the tenth, in one unit.
    """

    ten_swings_s: float
    first: float
    last: float
    full_speed_m_s: float

    @property
    def period_s(self) -> float:
        """Time of one full swing, seconds."""
        return self.ten_swings_s / 10.0

    @property
    def decay_per_swing(self) -> float:
        """Part of the amplitude that a full swing loses, 0 to 1."""
        return 1.0 - math.pow(self.last / self.first, 0.1)

    @property
    def filter(self) -> Filter:
        """G_FF filter to begin with: two real poles next to the frequency of the swing."""
        omega = 2.0 * math.pi / self.period_s
        poles = [float(rounded(-share * omega)) for share in POLES_TO_OMEGA]
        return filter_of("gff", poles_rad_s=poles)

    @property
    def sway(self) -> Sway:
        """Sway data of an axis, as measured by the stopwatch, with four significant digits."""
        period, decay = (float(rounded(v)) for v in (self.period_s, self.decay_per_swing))
        speed = self.full_speed_m_s
        return Sway(period_s=period, decay_per_swing=decay, full_speed_m_s=speed)


@dataclass(frozen=True)
class FirstSlewing:
    """Full speed of an axis that turns the crane, and the largest radius of the tip."""

    full_speed_rad_s: float
    largest_radius_m: float

    @property
    def full_speed_m_s(self) -> float:
        """Full speed of the tip at the largest radius."""
        return self.full_speed_rad_s * self.largest_radius_m


@dataclass(frozen=True)
class FirstMotion:
    """Slew and near-far as one motion.

    ``radius`` is MESSAGE.SIGNAL if it is measured, ``radius_codes`` the meaning of named values.
    """

    slew: str
    near_far: str
    radius: str | None = None
    radius_codes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class FirstLoad:
    """Time of ten swings with a log, by axis, and the signal that says that a log is gripped.

    ``empty`` and ``log`` are values of the signal, ``codes`` the meaning of its named ones;
    ``cycle_ms`` is that of its message if the DBC states none. Without a message one response holds
    for both an empty grapple and a log.
    """

    ten_swings_s: Mapping[str, float]
    message: str | None = None
    signal: str = ""
    timeout_ms: int = 0
    empty: float = 0.0
    log: float = 0.0
    codes: Mapping[str, str] = field(default_factory=dict)
    cycle_ms: int | None = None


@dataclass(frozen=True)
class FirstSensor:
    """A sway sensor, which is only watched at first; ``kind`` is rate, angle or inclination.

    ``fusion_s``: time constant with which accelerations correct the gyro of an inclination.
    ``codes``: meaning of the named values of its signal.
    """

    message: str
    signal: str
    kind: str
    timeout_ms: int
    fusion_s: float | None = None
    node: str | None = None
    codes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class FirstCanopen:
    """Id of our CANopen node, whether it starts the others, and their ids and timeouts (ms)."""

    node: int
    master: bool
    nodes: Mapping[str, tuple[int, int]]


@dataclass(frozen=True)
class FirstCia408:
    """Signal of a CiA 408 valve's control word, and message and signal of its status word."""

    control: str
    message: str
    signal: str
    timeout_ms: int
    node: str | None = None


@dataclass(frozen=True)
class FirstScaling:
    """Scaling of a signal where the DBC does not state it.

    ``zero`` is the value without a command, ``full`` how far that at full command is from it.
    ``flags`` are the signals of neutral, negative and positive; ``negative`` is the second signal
    of a rocker.
    """

    full: float | None = None
    zero: float | None = None
    invert: bool = False
    flags: tuple[str, str, str] | None = None
    negative: str | None = None


@dataclass(frozen=True)
class FirstAxis:
    """An axis: joystick, valve, and its swing, slewing and sensor if it has them.

    ``valve`` and ``status`` are messages; ``signal`` and ``cycle_ms`` are those of the valve.
    """

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
    """CANopen node, with a heartbeat, of a valve without CiA 408."""
    codes: Mapping[str, str] = field(default_factory=dict)
    """Meaning of named values (VAL_) of its command, "fault" or "value", by name."""
    timeout_known: bool = False
    """Whether the timeout comes from an EDS or was typed."""

    def assumed(self) -> list[str]:
        """Return the keys of the file whose numbers are unchanged proposals, and stop distances."""
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
    """All answers; ``notes`` become comments of the file; ``status``, ``identity`` are messages."""

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
    """Data bit rate of a CAN FD bus, bit/s."""
    notes: Sequence[str] = field(default=())
    load: FirstLoad | None = None


def ten_swings_s() -> tuple[float, float]:
    """Return shortest and longest time of ten swings, s, rounded inwards to tenths.

    The file may state their period times each factor of PERIOD_RANGE.
    """
    least, most = limits(Sway, "period_s")
    low, high = 10.0 * least / PERIOD_RANGE[0], 10.0 * most / PERIOD_RANGE[1]
    # Rounded inwards to tenths, so that both ends are allowed as they are written.
    return math.ceil(10.0 * low) / 10.0, math.floor(10.0 * high) / 10.0


def stop_distance_m(
    full_speed_m_s: float, period_s: float, joystick_timeout_ms: int, valve_timeout_ms: int
) -> float:
    """Return a stop distance (m) for run-on and a lost joystick, rounded up to a tenth.

    It is at most what a file may state; no sensible machine needs more.

    Args:
        full_speed_m_s: full speed of the tip.
        period_s: period of the swing, to which the run-on is proportional.
        joystick_timeout_ms: age at which the joystick counts as lost.
        valve_timeout_ms: timeout of the valve; its cycle is at most a third of it.
    """
    waits_s = joystick_timeout_ms / 1000.0 + 2.0 * valve_timeout_ms / 3000.0
    distance_m = math.ceil(10.0 * full_speed_m_s * (waits_s + RUN_ON_PERIODS * period_s)) / 10.0
    return min(distance_m, limits(Limits, "stop_distance_m")[1])


def rounded(number: float) -> str:
    """Return a number as text, with four significant digits."""
    return f"{number:.4g}"
