"""One axis of a machine as its files say: what its joystick means, what its valve was sent."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from cantools.database.can import Message

from tests.faults.fields import Field
from tests.faults.inputs import Joystick, Key

# Reasons why a joystick is none, by their numbers in docs/states.md.
JOYSTICK_ERROR, JOYSTICK_NOT_AVAILABLE, JOYSTICK_OUT_OF_RANGE, JOYSTICK_CONTRADICTORY = (
    33,
    34,
    35,
    38,
)

# Status frames of which the values are kept.
MOST_STATUSES = 5000


@dataclass(frozen=True)
class Node:
    """A node of CANopen whose heartbeats count."""

    bus: str
    number: int
    timeout_ns: int


@dataclass(frozen=True)
class Words:
    """Control and status word of a valve of CiA 408, and its node."""

    node: Node
    control: Field
    key: Key
    status: Field
    length: int
    timeout_ns: int


@dataclass(frozen=True)
class Ends:
    """End stops of an axis: message with its position, positions in raw steps."""

    key: Key
    length: int
    field: Field
    low: float
    high: float
    timeout_ns: int
    sign: int

    @classmethod
    def read(cls, section: Mapping[str, Any], message: Any) -> "Ends":
        """From its section in the file, and the message that it names."""
        signal = next(s for s in message.signals if s.name == section["signal"])
        field, margin = Field(signal), section["margin"]
        return cls(
            (section["bus"], message.frame_id, message.is_extended_frame),
            message.length,
            field,
            (section["lowest"] + margin) / field.scale,
            (section["highest"] - margin) / field.scale,
            section["timeout_ms"] * 1_000_000,
            1 if section["full_speed"] > 0 else -1,
        )


@dataclass
class Axis:
    """One axis: its joystick, its valve, its limits, times in ticks of its valve."""

    name: str
    joystick: Joystick
    signal: Field
    band: float
    valve: Field
    valve_message: Message
    valve_key: Key
    valve_counter: Field | None
    valve_timeout_ns: int
    status_key: Key | None
    status_message: Message | None
    period_ticks: int
    tick_s: float
    filter: str
    limits: dict[str, Any]
    flags: "tuple[Field, Field, Field] | None"  # neutral, negative, positive
    negative: Field | None = None  # of a rocker: the signal of the other direction
    direction: "tuple[str, dict[int, int]] | None" = None  # of the valve: signal, code to sign
    moves_with: "Axis | None" = None
    slews: bool = False
    largest_added: float = 0.0
    words: Words | None = None
    period_s: float | None = None  # of its swing; with a sway sensor
    full_speed_m_s: float = 0.0
    tip_m_s: float = 0.0  # at the largest radius, where the file says
    steps: int = field(init=False)

    def __post_init__(self) -> None:
        self.steps = self.valve.full
        limit = self.limits.get
        period_s = self.tick_s * self.period_ticks
        self.maximum = limit("max_pct", 100.0) / 100.0
        self.rise = limit("rise_per_s", 5.0) * period_s
        self.fall = limit("fall_per_s", 5.0) * period_s
        self.deadband = limit("deadband_pct", 0.0) / 100.0
        self.tail = round(limit("tail_s", 2.0) / period_s)
        self.stop = max(1, round(limit("stop_s", 2.0) / period_s))
        self.allow_faster = limit("allow_faster", False)
        self.allow_reverse = limit("allow_reverse", False)
        shaped = limit("reversal", "stop") == "brake_shaped"
        self.reversal = round(limit("reversal_s", 0.45) / period_s) if shaped else 0
        self.run_on = limit("stop_distance_m", math.inf) / (self.tip_m_s or 1.0)
        self.step = 1.0 / self.steps / (1.0 - self.deadband)  # velocity of one raw step
        self._frames: dict[bytes, tuple[int, int]] = {}
        self._statuses: dict[bytes, Any] = {}
        self._velocities: dict[int, float] = {}

    def read(self, word: int) -> tuple[float, int]:
        """Deflection in a frame of the joystick, fraction of full, and 0 or why it is none."""
        joystick = self.signal
        raw = joystick.get(word)
        if name := joystick.special.get(raw):
            return 0.0, JOYSTICK_ERROR if name == "Error" else JOYSTICK_NOT_AVAILABLE
        if abs(raw) > joystick.full:
            return 0.0, JOYSTICK_OUT_OF_RANGE
        if self.negative or self.flags is None:
            return self._rocker(raw, word) if self.negative else (raw / joystick.full, 0)
        neutral, negative, positive = flags = tuple(f.get(word) for f in self.flags)
        codes = {f for f in flags if f > 1}
        if codes:
            return 0.0, JOYSTICK_NOT_AVAILABLE if codes == {3} else JOYSTICK_ERROR
        if sum(flags) > 1 or (raw and not any(flags)) or (neutral and raw > 0.05 * joystick.full):
            return 0.0, JOYSTICK_CONTRADICTORY
        return (positive - negative) * raw / joystick.full, 0

    def _rocker(self, raw: int, word: int) -> tuple[float, int]:
        """Deflection of a rocker with a signal for each direction."""
        assert self.negative
        other = self.negative.get(word)
        if name := self.negative.special.get(other):
            return 0.0, JOYSTICK_ERROR if name == "Error" else JOYSTICK_NOT_AVAILABLE
        if other > self.negative.full:
            return 0.0, JOYSTICK_OUT_OF_RANGE
        if min(raw, other) > 0.05 * self.signal.full:
            return 0.0, JOYSTICK_CONTRADICTORY
        return (raw - other) / self.signal.full, 0

    def raw(self, value: int) -> dict[str, int]:
        """Raw values that a healthy joystick sends for a signed deflection of so many raw steps."""
        if self.negative:
            return {self.signal.name: max(0, value), self.negative.name: max(0, -value)}
        if self.flags is None:
            return {self.signal.name: value}
        neutral = abs(value) <= self.band * self.signal.full
        flags = (neutral, value < 0 and not neutral, value > 0 and not neutral)
        names = (f.name for f in self.flags)
        return {self.signal.name: abs(value), **dict(zip(names, map(int, flags), strict=True))}

    def status(self, data: bytes) -> dict[str, Any]:
        """Values of a status frame as cantools reads them."""
        values = self._statuses.get(data)
        if values is None:
            assert self.status_message is not None
            values = self.status_message.decode(data, decode_choices=False)
            if len(self._statuses) < MOST_STATUSES:  # those of an axis at rest come again and again
                self._statuses[data] = values
        return values

    def sensor_state(self, data: bytes) -> str:
        """State of the sway sensor in a status frame, by the names of the DBC."""
        assert self.status_message is not None
        names = self.status_message.get_signal_by_name("SwaySensor").choices
        assert names is not None
        return str(names[self.status(data)["SwaySensor"]])

    def sent(self, data: bytes) -> tuple[int, int]:
        """Command and alive counter of a frame of the valve, raw, as cantools reads them."""
        if (known := self._frames.get(data)) is None:
            values: Any = self.valve_message.decode(data, decode_choices=False, scaling=False)
            count = values[self.valve_counter.name] if self.valve_counter else 0
            raw = self.valve.read(values[self.valve.name])
            if self.direction:
                signal, signs = self.direction
                raw *= signs[values[signal]]
            if len(self._frames) < MOST_STATUSES:
                self._frames[data] = raw, count
            return raw, count
        return known

    def velocity(self, raw: int) -> float:
        """Velocity that a command of so many raw steps gives, behind the valve's deadband."""
        velocity = self._velocities.get(raw)
        if velocity is None:
            opening = max(0.0, abs(raw) / self.steps - self.deadband) / (1.0 - self.deadband)
            velocity = self._velocities[raw] = opening if raw > 0 else -opening
        return velocity
