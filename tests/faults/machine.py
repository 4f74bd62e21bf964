"""A machine as its files say, read without a line of canshaper: plain YAML, and cantools for bits.

Everything the judge and the generator of faults know of a deployment stands here.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cantools
import yaml
from cantools.database.can import Message

from tests.faults.fields import Field
from tests.faults.inputs import Input, Joystick, Key, key_of

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
    timeout_ns: int


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
        self.brake_shaped = limit("reversal", "stop") == "brake_shaped"
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
            raw = values[self.valve.name]
            if self.direction:
                signal, signs = self.direction
                raw *= signs[values[signal]]
            if len(self._frames) < MOST_STATUSES:
                self._frames[data] = raw, count
            return raw, count
        return found

    def velocity(self, raw: int) -> float:
        """Velocity that a command of so many raw steps gives, behind the valve's deadband."""
        found = self._velocities.get(raw)
        if found is None:
            opening = max(0.0, abs(raw) / self.steps - self.deadband) / (1.0 - self.deadband)
            found = self._velocities[raw] = opening if raw > 0 else -opening
        return found


def _flags(joystick: Joystick, command: dict[str, Any]) -> tuple[Field, Field, Field] | None:
    names = command.get("flags")
    if names is None:
        return None
    field = joystick.fields
    return field[names["neutral"]], field[names["negative"]], field[names["positive"]]


def _direction(section: dict[str, Any] | None) -> tuple[str, dict[int, int]] | None:
    if section is None:
        return None
    signs = {section["neutral"]: 0, section["positive"]: 1, section["negative"]: -1}
    return section["signal"], signs


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
        self.gateway = "gateway" in data
        self.nodes = {
            (bus, name): Node(bus, node["id"], node["heartbeat_ms"] * 1_000_000)
            for bus, section in data["buses"].items()
            for name, node in section.get("canopen", {}).get("nodes", {}).items()
        }
        self.addresses: dict[str, int] = {
            b: s["j1939"]["address"] for b, s in data["buses"].items() if "j1939" in s
        }
        self.joysticks = {
            n: Joystick(n, section, messages[section["message"]])
            for n, section in data["joysticks"].items()
        }
        self.joystick_nodes = {
            name: self.nodes[section["bus"], section["node"]]
            for name, section in data["joysticks"].items()
            if "node" in section
        }
        self.axes = {n: self._axis(n, s, messages) for n, s in data["axes"].items()}
        self.radius: tuple[Key, int, Field] | None = None
        for motion in data.get("motion", {}).values():
            self._motion(motion, messages)
        self.stop: Input | None = None
        if stop := data.get("emergency_stop"):
            self.stop = Input("stop", stop, messages[stop["message"]])
            self.stop_field = self.stop.fields[stop["signal"]]
        inputs = [*self.joysticks.values(), *([self.stop] if self.stop else [])]
        self.inputs: dict[Key, Input] = {i.key: i for i in inputs}
        self.valves = {a.valve_key: a for a in self.axes.values()}
        self.statuses = {a.status_key: a for a in self.axes.values() if a.status_key}
        self.service: Key | None = None
        self.service_message: Message | None = None
        if section := data.get("status"):
            self.service_message = message = messages[section["message"]]
            self.service = self._sent(section["bus"], message)
        self.shortest_timeout_ns = min(v.timeout_ns for v in self.joysticks.values())
        # longest time between two ticks after which an axis in motion may go on
        waits_ms = [
            section["valve"]["timeout_ms"] - (self.axes[n].period_ticks - 1) * self.tick_ms
            for n, section in data["axes"].items()
        ]
        self.longest_gap_ns = min(
            *(v.timeout_ns for v in self.inputs.values()), *(ms * 1_000_000 for ms in waits_ms)
        )
        # longest time, in ticks, in which everything that runs on has come to rest
        longest = max((a.stop + a.tail + 4) * a.period_ticks for a in self.axes.values())
        self.rest_ticks = longest + self.shortest_timeout_ns // self.tick_ns

    def _sent(self, bus: str, message: Message) -> Key:
        return key_of(bus, message, self.addresses.get(bus))

    def _axis(self, name: str, section: dict[str, Any], messages: dict[str, Message]) -> Axis:
        command, valve = section["command"], section["valve"]
        joystick = self.joysticks[command["joystick"]]
        message = messages[valve["message"]]
        signals = {s.name: s for s in message.signals}
        counter = valve.get("alive_counter")
        status = section.get("status")
        shown = messages[status["message"]] if status else None
        axis = Axis(
            name=name,
            joystick=joystick,
            signal=joystick.fields[command["signal"]],
            band=command.get("neutral_pct", 2.0) / 100.0,
            valve=Field(signals[valve["signal"]]),
            valve_message=message,
            valve_key=self._sent(valve["bus"], message),
            valve_counter=Field(signals[counter]) if counter else None,
            valve_timeout_ns=valve["timeout_ms"] * 1_000_000,
            status_key=self._sent(status["bus"], shown) if shown else None,
            status_message=shown,
            period_ticks=(message.cycle_time or 0) // self.tick_ms,
            tick_s=self.tick_ms / 1000.0,
            filter=section["filter"]["kind"] or "off",  # to PyYAML, off is false
            limits=section.get("limits", {}),
            flags=_flags(joystick, command),
            negative=joystick.fields[command["negative"]] if "negative" in command else None,
            direction=_direction(valve.get("direction")),
            words=self._words(valve, message, messages),
        )
        joystick.axes.append(axis)
        return axis

    def _words(
        self, valve: dict[str, Any], command: Message, messages: dict[str, Message]
    ) -> Words | None:
        if (section := valve.get("cia408")) is None:
            return None
        status = section["status"]
        message = messages[status["message"]]
        control = next(s for s in command.signals if s.name == section["control"])
        word = next(s for s in message.signals if s.name == status["signal"])
        return Words(
            self.nodes[valve["bus"], section["node"]],
            Field(control),
            self._sent(status["bus"], message),
            Field(word),
            status["timeout_ms"] * 1_000_000,
        )

    def _motion(self, section: dict[str, Any], messages: dict[str, Message]) -> None:
        slew = self.axes[section["slew"]]
        slew.slews = True
        if "near_far" in section:
            slew.moves_with = near_far = self.axes[section["near_far"]]
            near_far.moves_with = slew
            slew.largest_added = near_far.largest_added = section.get("max_pct", 25.0) / 100.0
        if radius := section.get("radius"):
            message = messages[radius["message"]]
            signal = next(s for s in message.signals if s.name == radius["signal"])
            key = (radius["bus"], message.frame_id, message.is_extended_frame)
            self.radius = (key, message.length, Field(signal))
