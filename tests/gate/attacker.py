"""A wrong controller behind the gate: plain YAML and cantools, no codec of canshaper."""

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import cantools
import yaml
from cantools.database.can import Message

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment

CONFIG = Path(__file__).parents[2] / "config"
TICK_MS, TICK_S = 20, 0.02
ADDRESS = 0x33  # of a joystick on J1939
ACTIVE = 0xF  # control word of CiA 408

Plant = Callable[[list[Frame]], Iterable[Frame]]


class Evil(Controller):
    """Computes sound frames, and hands out what is planted in their place."""

    plant: Plant = staticmethod(list)
    of: bytes | None = None  # what a gateway received, while it forwards that
    substitute: Callable[[Frame], Frame] = staticmethod(lambda frame: frame)

    def tick(self, now_ns: int, missed: int = 0) -> Any:
        yield from self.plant(list(super().tick(now_ns, missed)))

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        passed = super().receive(frame, arrived_ns)
        self.of = frame.data
        passed = next(iter([*self.plant([passed])]), None) if passed else None
        self.of = None
        return passed

    def refused(self, frame: Frame) -> Frame:
        return self.substitute(super().refused(frame))


@cache
def loaded(path: Path) -> tuple[dict[str, Any], dict[str, Message], Deployment]:
    """File, messages, and deployment."""
    file = yaml.safe_load(path.read_text())
    bases = [cantools.database.load_file(path.parent / one) for one in file["dbc"]]
    return file, {m.name: m for b in bases for m in b.messages}, load_deployment(path)


def put(message: Message, data: bytes, values: dict[str, int]) -> bytes:
    """The frame with other raw values of some signals, every other bit as it was."""
    word = int.from_bytes(data, "little")
    for name, raw in values.items():
        signal = message.get_signal_by_name(name)
        ones = (1 << signal.length) - 1
        word = word & ~(ones << signal.start) | (raw & ones) << signal.start
    return word.to_bytes(len(data), "little")


def get(message: Message, data: bytes, name: str) -> int:
    """Raw value of a signal."""
    signal = message.get_signal_by_name(name)
    raw = int.from_bytes(data, "little") >> signal.start & (1 << signal.length) - 1
    return raw - (raw >> signal.length - 1 << signal.length) if signal.is_signed else raw


class World:
    """Hand, nodes and bus of a deployment, ticked by hand.

    Attributes:
        stick: position of the joystick by axis; ``raw`` overrides signals by joystick.
        change: what becomes of a frame before it is received: none, one or more.
        left: what left in the last tick; ``way`` what it commanded by axis, in s of full speed.
    """

    def __init__(self, name: str, file: Path | None = None) -> None:
        self.name = name
        self.file, self.messages, deployment = loaded(file or CONFIG / f"{name}.yaml")
        self.evil = Evil(deployment)
        self.guarded = Guarded(self.evil)
        self.axes: dict[str, Any] = self.file["axes"]
        self.gateway = "gateway" in self.file
        self.stick: dict[str, float] = {}
        self.raw: dict[str, dict[str, int]] = {}
        self.enable, self.reset, self.stop = 1, 0, 0
        self.change: Callable[[Frame], Iterable[Frame]] = lambda frame: [frame]
        self.count: dict[str, int] = {}
        self.n = 0
        self.left: list[Frame] = []
        self.way = dict.fromkeys(self.axes, 0.0)
        self.seen, self.last = dict.fromkeys(self.axes, 0.0), dict.fromkeys(self.axes, 0)
        self.control: dict[str, int] = {}

    def key(self, section: dict[str, Any], own: bool) -> tuple[str, int, bool]:
        """Bus, identifier and length of it of a message that a section names."""
        message, bus = self.messages[section["message"]], section["bus"]
        number = message.frame_id
        if "j1939" in self.file["buses"][bus] and message.is_extended_frame and number & 255 == 254:
            source = self.file["buses"][bus]["j1939"]["address"] if own else ADDRESS
            number = number & ~255 | source
        return bus, number, message.is_extended_frame

    def valve(self, axis: str) -> tuple[str, int, bool]:
        return self.key(self.axes[axis]["valve"], own=True)

    def full(self, axis: str) -> float:
        """Raw value of full speed."""
        valve = self.axes[axis]["valve"]
        signal = self.messages[valve["message"]].get_signal_by_name(valve["signal"])
        return valve.get("full", signal.maximum) / signal.scale

    def encode(self, axis: str, data: bytes, speed: float) -> bytes:
        """A valve's frame with another speed, else as it was."""
        valve = self.axes[axis]["valve"]
        message = self.messages[valve["message"]]
        raw = round(self.full(axis) * speed)
        values = {}
        if direction := valve.get("direction"):
            code = "neutral" if not raw else "positive" if raw > 0 else "negative"
            values[direction["signal"]] = direction[code]
            raw = abs(raw)
        values[valve["signal"]] = raw + valve.get("zero", 0)
        for also in valve.get("also", []):
            signal = message.get_signal_by_name(also)
            values[also] = round(signal.maximum * abs(speed) / signal.scale)
        if raw and "cia408" in valve:
            values[valve["cia408"]["control"]] = ACTIVE
        return put(message, data, values)

    def decode(self, axis: str, data: bytes) -> float:
        """Speed in a frame of the valve."""
        valve = self.axes[axis]["valve"]
        message = self.messages[valve["message"]]
        data = data.ljust(message.length, b"\0")
        raw = get(message, data, valve["signal"]) - valve.get("zero", 0)
        if direction := valve.get("direction"):
            code = get(message, data, direction["signal"])
            raw *= {direction["positive"]: 1, direction["negative"]: -1}.get(code, 0)
        return raw / self.full(axis)

    def joystick(self, name: str) -> Frame:
        """Its frame of this tick."""
        section = self.file["joysticks"][name]
        message = self.messages[section["message"]]
        values: dict[str, int] = {}
        for axis, config in self.axes.items():
            command = config["command"]
            if command["joystick"] != name:
                continue
            at = self.stick.get(axis, 0.0)
            signal = message.get_signal_by_name(command["signal"])
            full = signal.maximum / signal.scale
            if flags := command.get("flags"):
                values |= {flags["neutral"]: at == 0, flags["negative"]: at < 0}
                values[flags["positive"]] = at > 0
                at = abs(at)
            elif back := command.get("negative"):
                values[back] = round(full * max(-at, 0.0))
                at = max(at, 0.0)
            values[command["signal"]] = round(full * at)
        for switch in ("enable", "reset"):
            if switch in section:
                values[section[switch]] = getattr(self, switch)
        if counter := section.get("alive_counter"):
            size = 1 << message.get_signal_by_name(counter).length
            self.count[name] = values[counter] = (self.count.get(name, -1) + 1) % size
        values |= self.raw.get(name, {})
        data = put(message, bytes(message.length), values)
        return Frame(*self.key(section, own=False), data)

    def others(self) -> Iterable[Frame]:
        """Frames of other nodes."""
        for bus, section in self.file["buses"].items():
            for node in section.get("canopen", {}).get("nodes", {}).values():
                yield Frame(bus, 0x700 + node["id"], False, b"\x05")
        for axis, config in self.axes.items():
            if "cia408" in config["valve"]:
                status = config["valve"]["cia408"]["status"]
                length = self.messages[status["message"]].length
                word = self.control.get(axis, 0) & 7 | 8
                data = word.to_bytes(length, "little")
                yield Frame(*self.key(status, own=False), data)
        for motion in self.file.get("motion", {}).values():
            radius = motion["radius"]
            message = self.messages[radius["message"]]
            data = put(message, bytes(message.length), {radius["signal"]: 6000})
            yield Frame(*self.key(radius, own=False), data)
        if stop := self.file.get("emergency_stop"):
            message = self.messages[stop["message"]]
            self.count["stop"] = (self.count.get("stop", -1) + 1) % 256
            values = {stop["signal"]: self.stop, stop["alive_counter"]: self.count["stop"]}
            yield Frame(*self.key(stop, own=False), put(message, bytes(message.length), values))

    def receive(self, frame: Frame) -> list[Frame]:
        """A frame comes in; what of it goes through a gateway."""
        passed = self.guarded.receive(frame, self.n * TICK_MS * 1_000_000)
        return [passed] if passed else []

    def step(self, plant: Plant | None = None, missed: int = 0) -> list[Frame]:
        """A tick; what left."""
        self.evil.plant = plant or list
        self.left = []
        frames = [*self.others(), *(self.joystick(one) for one in self.file["joysticks"])]
        for frame in frames:
            for changed in self.change(frame):
                self.left += self.receive(changed)
        self.left += self.guarded.tick(self.n * TICK_MS * 1_000_000, missed)
        self.n += 1
        for frame in self.left:
            for axis in self.axes:
                if frame[:3] == self.valve(axis):
                    self.seen[axis] = self.decode(axis, frame.data)
                    self.last[axis] = self.n
                    if "cia408" in self.axes[axis]["valve"]:
                        self.control[axis] = frame.data[0]
        for axis in self.axes:  # a command holds until the valve's timeout
            if self.n - self.last[axis] > self.axes[axis]["valve"]["timeout_ms"] // TICK_MS:
                self.seen[axis] = 0.0
            self.way[axis] += abs(self.seen[axis]) * TICK_S
        return self.left

    def go(self, ticks: int, plant: Plant | None = None, **stick: float) -> None:
        """Ticks with the joysticks held so."""
        self.stick = stick
        for _ in range(ticks):
            self.step(plant)

    def commands(self, **speed: float) -> Plant:
        """Plants other speeds in the frames of these axes' valves."""

        def plant(frames: list[Frame]) -> Iterable[Frame]:
            for frame in frames:
                data = frame.data
                for axis, one in speed.items():
                    if frame[:3] == self.valve(axis):
                        data = self.encode(axis, data, one)
                yield frame._replace(data=data)

        return plant
