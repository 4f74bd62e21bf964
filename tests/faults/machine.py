"""A machine as its files say, read without a line of canshaper: plain YAML, and cantools for bits.

Everything the judge and the generator of faults know of a deployment stands here.
"""

import functools
import operator
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cantools
import yaml
from cantools.database.can import Message, Signal

# Reasons why a stick is none, by their numbers in docs/states.md.
STICK_ERROR, STICK_NOT_AVAILABLE, STICK_OUT_OF_RANGE, STICK_CONTRADICTORY = 33, 34, 35, 38

# Status frames of which the values are kept.
MOST_STATUSES = 5000


class Field:
    """The bits of one little-endian integer signal, in a frame read as one number."""

    __slots__ = ("full", "high", "low", "mask", "name", "scale", "sign", "special", "start")

    def __init__(self, signal: Signal) -> None:
        assert signal.byte_order == "little_endian", signal.name
        assert not signal.is_float, signal.name
        self.name = signal.name
        self.start = signal.start
        self.mask = (1 << signal.length) - 1
        self.sign = 1 << (signal.length - 1) if signal.is_signed else 0
        self.low, self.high = -self.sign, self.mask - self.sign
        self.scale = signal.scale
        # raw value of full deflection; offsets are not used in these machines
        assert not signal.offset, signal.name
        self.full = round((signal.maximum or 0) / signal.scale)
        self.special = {int(raw): str(name) for raw, name in (signal.choices or {}).items()}

    def get(self, word: int) -> int:
        value = (word >> self.start) & self.mask
        return value - 2 * self.sign if value & self.sign else value

    def put(self, raw: int) -> int:
        return (raw & self.mask) << self.start

    def code(self, kind: str) -> int | None:
        """Raw value that the DBC names so, such as Error."""
        return next((raw for raw, name in self.special.items() if name == kind), None)


def crc8(polynomial: int, end: int) -> Callable[[bytes], int]:
    """A CRC of eight bits that starts with 0xFF, bit by bit, from a table."""
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ (polynomial if byte & 0x80 else 0)  # noqa: PLW2901
        table.append(byte & 0xFF)
    return lambda data: functools.reduce(lambda crc, b: table[crc ^ b], data, 0xFF) ^ end


CHECKSUMS: dict[str, Callable[[bytes], int]] = {
    "xor": lambda data: functools.reduce(operator.xor, data, 0),
    "sum": lambda data: sum(data) % 256,
    "crc8_sae_j1850": crc8(0x1D, 0xFF),
    "crc8_autosar": crc8(0x2F, 0xFF),
}


class Input:
    """A message that the controller takes: a lever or the emergency stop."""

    def __init__(self, name: str, section: dict[str, Any], message: Message) -> None:
        self.name = name
        self.key = (section["bus"], message.frame_id, message.is_extended_frame)
        self.length = message.length
        self.cycle_ms = message.cycle_time or 0
        self.timeout_ns = section["timeout_ms"] * 1_000_000
        self.fields = {s.name: Field(s) for s in message.signals}
        self.max_step = section.get("alive_max_step", 3)
        self.qualify = section.get("qualify", 1)
        counter = section.get("alive_counter")
        self.counter = self.fields[counter] if counter else None
        self.checksum: Callable[[bytes], int] | None = None
        self.checksum_byte = 0
        if check := section.get("checksum"):
            self.checksum = CHECKSUMS[check["kind"]]
            self.checksum_byte = self.fields[check["signal"]].start // 8

    def data(self, raw: dict[str, int], spoiled: int = 0) -> bytes:
        """Bytes of a frame; the checksum is right, or spoiled by these bits."""
        fields = self.fields
        word = 0
        for name, value in raw.items():
            word |= fields[name].put(value)
        data = word.to_bytes(self.length, "little")
        if self.checksum is None:
            return data
        at = self.checksum_byte
        found = self.checksum(data[:at] + data[at + 1 :]) ^ spoiled
        return data[:at] + bytes([found]) + data[at + 1 :]

    def whole(self, data: bytes) -> bool:
        """Whether the checksum is right, or there is none."""
        at = self.checksum_byte
        return self.checksum is None or self.checksum(data[:at] + data[at + 1 :]) == data[at]


class Lever(Input):
    """A joystick message with its switches."""

    def __init__(self, name: str, section: dict[str, Any], message: Message) -> None:
        super().__init__(name, section, message)
        self.enable = self.fields[section["enable"]]
        self.reset = self.fields[section["reset"]] if "reset" in section else None
        self.off = self.fields[section["anti_sway_off"]] if "anti_sway_off" in section else None
        self.frozen_ns = round(section.get("frozen_s", 20.0) * 1e9)
        self.axes: list[Axis] = []


@dataclass
class Axis:
    """One axis: its stick, its valve, its limits, times in ticks of its valve."""

    name: str
    lever: Lever
    stick: Field
    band: float
    valve: Field
    valve_message: Message
    valve_key: tuple[str, int, bool]
    valve_counter: Field | None
    status_key: tuple[str, int, bool] | None
    status_message: Message | None
    period_ticks: int
    tick_s: float
    filter: str
    limits: dict[str, Any]
    flags: "tuple[Field, Field, Field] | None"  # neutral, negative, positive
    compensates: "Axis | None" = None
    largest_added: float = 0.0
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
        self.step = 1.0 / self.steps / (1.0 - self.deadband)  # velocity of one raw step
        self._frames: dict[bytes, tuple[int, int]] = {}
        self._statuses: dict[bytes, Any] = {}
        self._velocities: dict[int, float] = {}

    def read(self, word: int) -> tuple[float, int]:
        """Deflection in a frame of the lever, fraction of full, and 0 or why it is none."""
        stick = self.stick
        raw = stick.get(word)
        if name := stick.special.get(raw):
            return 0.0, STICK_ERROR if name == "Error" else STICK_NOT_AVAILABLE
        if abs(raw) > stick.full:
            return 0.0, STICK_OUT_OF_RANGE
        if self.flags is None:
            return raw / stick.full, 0
        neutral, negative, positive = flags = tuple(f.get(word) for f in self.flags)
        codes = {f for f in flags if f > 1}
        if codes:
            return 0.0, STICK_NOT_AVAILABLE if codes == {3} else STICK_ERROR
        if sum(flags) > 1 or (raw and not any(flags)) or (neutral and raw > 0.05 * stick.full):
            return 0.0, STICK_CONTRADICTORY
        return (positive - negative) * raw / stick.full, 0

    def raw(self, value: int) -> dict[str, int]:
        """Raw values that a healthy lever sends for a signed deflection of so many raw steps."""
        if self.flags is None:
            return {self.stick.name: value}
        neutral = abs(value) <= self.band * self.stick.full
        flags = (neutral, value < 0 and not neutral, value > 0 and not neutral)
        names = (f.name for f in self.flags)
        return {self.stick.name: abs(value), **dict(zip(names, map(int, flags), strict=True))}

    def status(self, data: bytes) -> dict[str, Any]:
        """Values of a status frame as cantools reads them."""
        found = self._statuses.get(data)
        if found is None:
            assert self.status_message is not None
            found = self.status_message.decode(data, decode_choices=False)
            if len(self._statuses) < MOST_STATUSES:  # those of an axis at rest come again and again
                self._statuses[data] = found
        return found

    def sent(self, data: bytes) -> tuple[int, int]:
        """Command and alive counter of a frame of the valve, raw, as cantools reads them."""
        found = self._frames.get(data)
        if found is None:
            values: Any = self.valve_message.decode(data, decode_choices=False, scaling=False)
            count = values[self.valve_counter.name] if self.valve_counter else 0
            found = self._frames[data] = values[self.valve.name], count
        return found

    def velocity(self, raw: int) -> float:
        """Velocity that a command of so many raw steps gives, behind the valve's deadband."""
        found = self._velocities.get(raw)
        if found is None:
            opening = max(0.0, abs(raw) / self.steps - self.deadband) / (1.0 - self.deadband)
            found = self._velocities[raw] = opening if raw > 0 else -opening
        return found


def _flags(lever: Lever, stick: dict[str, Any]) -> tuple[Field, Field, Field] | None:
    names = stick.get("flags")
    if names is None:
        return None
    field = lever.fields
    return field[names["neutral"]], field[names["negative"]], field[names["positive"]]


class Machine:
    """A deployment file with its DBC files."""

    def __init__(self, name: str, path: Path) -> None:
        self.name = name
        self.path = path
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        files = [cantools.database.load_file(str(path.parent / f)) for f in data["dbc"]]
        messages = {m.name: m for f in files for m in f.messages}
        self.ids = {(m.frame_id, m.is_extended_frame) for m in messages.values()}
        self.tick_ms: int = data["tick_ms"]
        self.tick_ns = self.tick_ms * 1_000_000
        self.buses = list(data["buses"])
        self.levers = {
            n: Lever(n, section, messages[section["message"]])
            for n, section in data["levers"].items()
        }
        self.axes = {n: self._axis(n, s, messages) for n, s in data["axes"].items()}
        self.radius: tuple[tuple[str, int, bool], int, Field] | None = None
        for axis, section in data["axes"].items():
            if radial := section.get("radial_compensation"):
                self._radial(self.axes[axis], radial, messages)
        self.stop: Input | None = None
        if stop := data.get("emergency_stop"):
            self.stop = Input("stop", stop, messages[stop["message"]])
            self.stop_field = self.stop.fields[stop["signal"]]
        inputs = [*self.levers.values(), *([self.stop] if self.stop else [])]
        self.inputs: dict[tuple[str, int, bool], Input] = {i.key: i for i in inputs}
        self.valves = {a.valve_key: a for a in self.axes.values()}
        self.statuses = {a.status_key: a for a in self.axes.values() if a.status_key}
        self.service: tuple[str, int, bool] | None = None
        self.service_message: Message | None = None
        if section := data.get("status"):
            self.service_message = message = messages[section["message"]]
            self.service = (section["bus"], message.frame_id, message.is_extended_frame)
        self.shortest_timeout_ns = min(v.timeout_ns for v in self.levers.values())
        # longest time, in ticks, in which everything that runs on has come to rest
        longest = max((a.stop + a.tail + 4) * a.period_ticks for a in self.axes.values())
        self.rest_ticks = longest + self.shortest_timeout_ns // self.tick_ns

    def _axis(self, name: str, section: dict[str, Any], messages: dict[str, Message]) -> Axis:
        stick, valve = section["stick"], section["valve"]
        lever = self.levers[stick["lever"]]
        message = messages[valve["message"]]
        signals = {s.name: s for s in message.signals}
        counter = valve.get("alive_counter")
        status = section.get("status")
        shown = messages[status["message"]] if status else None
        axis = Axis(
            name=name,
            lever=lever,
            stick=lever.fields[stick["signal"]],
            band=stick.get("neutral_pct", 2.0) / 100.0,
            valve=Field(signals[valve["signal"]]),
            valve_message=message,
            valve_key=(valve["bus"], message.frame_id, message.is_extended_frame),
            valve_counter=Field(signals[counter]) if counter else None,
            status_key=(
                (status["bus"], shown.frame_id, shown.is_extended_frame) if shown else None
            ),
            status_message=shown,
            period_ticks=(message.cycle_time or 0) // self.tick_ms,
            tick_s=self.tick_ms / 1000.0,
            filter=section["filter"]["kind"] or "off",  # to PyYAML, off is false
            limits=section.get("limits", {}),
            flags=_flags(lever, stick),
        )
        lever.axes.append(axis)
        return axis

    def _radial(self, axis: Axis, section: dict[str, Any], messages: dict[str, Message]) -> None:
        axis.compensates = self.axes[section["axis"]]
        axis.largest_added = section.get("max_pct", 25.0) / 100.0
        axis.compensates.largest_added = axis.largest_added
        if radius := section.get("radius"):
            message = messages[radius["message"]]
            signal = next(s for s in message.signals if s.name == radius["signal"])
            key = (radius["bus"], message.frame_id, message.is_extended_frame)
            self.radius = (key, message.length, Field(signal))
