"""A machine as its files say, read without a line of canshaper: plain YAML, and cantools for bits.

Everything the judge and the generator of faults know of a deployment stands here and in axis.py.
"""

import math
from pathlib import Path
from typing import Any

import cantools
import yaml
from cantools.database.can import Message

from tests.faults.axis import Axis, Ends, Node, Words
from tests.faults.fields import Field
from tests.faults.inputs import Input, Joystick, Key, Switches, key_of
from tests.faults.sensor import SensorMessage
from tests.faults.swing import GRAVITY_M_S2


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


def _choices(data: dict[str, Any], messages: dict[str, Message]) -> list[tuple[Key, int, Field]]:
    """Messages that choose a set of filters: length, and the signal."""
    return [
        (key_of(one["bus"], message, None), message.length, Field(signal))
        for one in (data.get("load_state"), data.get("profile"))
        for message in ([messages[one["message"]]] if one else [])
        for signal in message.signals
        if signal.name == one["signal"]
    ]


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
        buses = data["buses"].items()
        self.buses = [bus for bus, _section in buses]
        self.gateway = "gateway" in data
        self.nodes = {
            (bus, name): Node(bus, node["id"], node["heartbeat_ms"] * 1_000_000)
            for bus, section in buses
            for name, node in section.get("canopen", {}).get("nodes", {}).items()
        }
        self.addresses = {b: s["j1939"]["address"] for b, s in buses if "j1939" in s}
        self.joysticks = {
            n: Joystick(n, section, messages[section["message"]])
            for n, section in data["joysticks"].items()
        }
        self.joystick_nodes = self._nodes(data["joysticks"])
        self.switches = self._switches(data, messages)
        self.axes = {n: self._axis(n, s, messages) for n, s in data["axes"].items()}
        # without CiA 408
        self.drives = self._nodes({name: one["valve"] for name, one in data["axes"].items()})
        self.sensors = self._sensors(data, messages)
        self.radius: tuple[Key, int, Field] | None = None
        self.aims: set[Key] = set()
        for motion in data.get("motion", {}).values():
            self._motion(motion, messages)
            if aim := motion.get("aim"):
                self.aims.add(self._sent(aim["bus"], messages[aim["message"]]))
        self.choices = _choices(data, messages)
        self.hydraulics: dict[str, Any] | None = data.get("hydraulics")
        self.ends = {
            name: Ends.read(ends, messages[ends["message"]])
            for name, section in data["axes"].items()
            if (ends := section.get("limits", {}).get("ends"))
        }
        self.stop: Input | None = None
        if stop := data.get("emergency_stop"):
            self.stop = Input("stop", stop, messages[stop["message"]])
            self.stop_field = self.stop.fields[stop["signal"]]
        inputs = [*self.joysticks.values(), *self.switches]
        self.shortest_timeout_ns = min(v.timeout_ns for v in inputs)
        self.inputs: dict[Key, Input] = {i.key: i for i in (*inputs, self.stop) if i}
        self.valves = {a.valve_key: a for a in self.axes.values()}
        self.statuses = {a.status_key: a for a in self.axes.values() if a.status_key}
        self.service: Key | None = None
        self.service_message: Message | None = None
        if section := data.get("status"):
            self.service_message = message = messages[section["message"]]
            self.service = self._sent(section["bus"], message)
        self.identity = self._identity(data, messages)
        self.longest_gap_ns = self._longest_gap_ns()
        # longest time, in ticks, in which everything that runs on has come to rest
        longest = max((a.stop + a.tail + 4) * a.period_ticks for a in self.axes.values())
        self.rest_ticks = longest + self.shortest_timeout_ns // self.tick_ns

    def _longest_gap_ns(self) -> int:
        """Longest time between two ticks after which an axis in motion may go on."""
        waits_ns = [
            axis.valve_timeout_ns - (axis.period_ticks - 1) * self.tick_ns
            for axis in self.axes.values()
        ]
        return min(*waits_ns, *(one.timeout_ns for one in self.inputs.values()))

    def _identity(self, data: dict[str, Any], messages: dict[str, Message]) -> Key | None:
        """Key of the message that says what runs, where there is one."""
        if section := data.get("identity"):
            return self._sent(section["bus"], messages[section["message"]])
        return None

    def _nodes(self, sections: dict[str, Any]) -> dict[str, Node]:
        """Nodes of those sections that name one."""
        named = {name: section for name, section in sections.items() if "node" in section}
        return {name: self.nodes[one["bus"], one["node"]] for name, one in named.items()}

    def _switches(self, data: dict[str, Any], messages: dict[str, Message]) -> list[Switches]:
        """Messages with switches; the joysticks know theirs."""
        switches: dict[str, Switches] = {}
        named: dict[str, tuple[Switches, str]] = {}
        for name, section in data.get("switches", {}).items():
            message = messages[section["message"]]
            one = switches.setdefault(message.name, Switches(section, message))
            named[name] = one, section["signal"]
            one.codes[section["signal"]] = section.get("code", 1)
        for name, joystick in self.joysticks.items():
            section = data["joysticks"][name]
            if of := section.get("enable_of"):
                joystick.enabled_by = self.joysticks[of]
                section = data["joysticks"][of]
            names = section["enable"]
            joystick.agree = [named[n] for n in ([] if isinstance(names, str) else names[1:])]
        return list(switches.values())

    def _sensors(
        self, data: dict[str, Any], messages: dict[str, Message]
    ) -> dict[Key, SensorMessage]:
        """Messages of sway sensors; their axes know how they swing."""
        sensors: dict[Key, SensorMessage] = {}
        for name, axis in self.axes.items():
            if (section := data["axes"][name].get("sway_sensor")) is None:
                continue
            message = messages[section["message"]]
            key = key_of(section["bus"], message, section.get("source"))
            sensor = sensors.setdefault(key, SensorMessage(key, message))
            if node := section.get("node"):
                sensor.node = self.nodes[section["bus"], node].number
            if e2e := section.get("e2e"):
                assert e2e["profile"] == "p04"
                sensor.data_id = e2e["data_id"]
            sign = -1 if section.get("invert") else 1
            sensor.signals[section["signal"]] = axis, section["kind"] == "rate", sign
            sway = data["axes"][name]["sway"]
            axis.full_speed_m_s = sway["full_speed_m_s"]
            axis.period_s = sway.get("period_s") or 2.0 * math.pi * math.sqrt(
                sway["length_m"] / GRAVITY_M_S2
            )
        return sensors

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
        slewing, sway = section.get("slewing"), section.get("sway") or {}
        tip_m_s = sway.get("full_speed_m_s", 0.0)
        if slewing:
            tip_m_s = slewing["full_speed_rad_s"] * slewing["largest_radius_m"]
        axis = Axis(
            name=name,
            joystick=joystick,
            signal=joystick.scaled(command["signal"], command),
            band=command.get("neutral_pct", 2.0) / 100.0,
            valve=Field(signals[valve["signal"]], valve),
            valve_message=message,
            valve_key=self._sent(valve["bus"], message),
            valve_counter=Field(signals[counter]) if counter else None,
            valve_timeout_ns=valve["timeout_ms"] * 1_000_000,
            status_key=self._sent(status["bus"], shown) if shown else None,
            status_message=shown,
            period_ticks=valve.get("cycle_ms", message.cycle_time or 0) // self.tick_ms,
            tick_s=self.tick_ms / 1000.0,
            filter=section["filter"]["kind"] or "off",  # to PyYAML, off is false
            limits=section.get("limits", {}),
            flags=_flags(joystick, command),
            negative=joystick.fields[command["negative"]] if "negative" in command else None,
            direction=_direction(valve.get("direction")),
            words=self._words(valve, message, messages),
            tip_m_s=tip_m_s,
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
            message.length,
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
