"""The J1939 machine of the repository in lock-step; joysticks are encoded by plain cantools."""

from pathlib import Path
from typing import Any

import cantools

from canshaper.codec.frame import GLOBAL, Frame, name_bytes
from canshaper.controller.controller import Controller
from canshaper.shaping.states import State
from tests.rigs.files import ROOT, read

TICK_NS = 20_000_000
OWN, JOYSTICK, OTHER = 0x9C, 0x33, 0x21
NETWORK: Any = cantools.database.load_file(ROOT / "dbc" / "j1939-bjm-avc.dbc")
AVC, AVEF = 0x0CFE3000, 0x0CFE1000
CLAIM, NO_CLAIM, WHO_HAS_IT = 0x18EEFF00 | OWN, 0x18EEFFFE, 0x18EAFFFE
DM1, BROADCAST, PACKET, NACK = (i | OWN for i in (0x18FECA00, 0x1CECFF00, 0x1CEBFF00, 0x18E8FF00))


def bjm(
    message: str = "BJM1", source: int = JOYSTICK, priority: int = 3, /, **values: float
) -> Frame:
    """A joystick with X and Y in %, Button1 (enable) pressed unless told."""
    definition = NETWORK.get_message_by_name(message)
    raw = {s.name: 0 for s in definition.signals} | {"Button1": 1}
    for axis in ("X", "Y"):
        value = values.pop(axis, 0.0)
        raw[f"{axis}Neutral"] = int(value == 0)
        raw[f"{axis}Negative"] = int(value < 0)
        raw[f"{axis}Positive"] = int(value > 0)
        raw[f"{axis}Position"] = round(abs(value) * 10)
    data = definition.encode({**raw, **values}, scaling=False, strict=False, padding=True)
    can_id = priority << 26 | definition.frame_id & 0x03FFFF00 | source
    return Frame("crane", can_id, True, data)


def avef(number: int, percent: float, source: int = 0x80) -> Frame:
    """Estimated flow of a valve."""
    definition = NETWORK.get_message_by_name(f"AVEF{number}")
    raw = {s.name: 2**s.length - 1 for s in definition.signals}
    raw["ExtendFlow"] = round(percent) + 125
    data = definition.encode(raw, scaling=False, strict=False, padding=True)
    return Frame("crane", AVEF + (number << 8) | source, True, data)


def request(pgn: int, source: int = OTHER, to: int = GLOBAL) -> Frame:
    return Frame("crane", 0x18EA0000 | to << 8 | source, True, pgn.to_bytes(3, "little"))


class Rig:
    """A controller with its clock; what it sends is seen as frames."""

    def __init__(self, path: Path = ROOT / "config" / "j1939-forwarder.yaml") -> None:
        self.deployment = read(path)
        self.controller = Controller(self.deployment)
        config = self.deployment.config.buses["crane"].j1939
        assert config is not None
        self.name = int.from_bytes(name_bytes(config.name), "little")
        self.now_ns = 0
        self.events: list[str] = []

    def claim(self, difference: int = 0, source: int = OWN) -> Frame:
        """A claim by a node whose NAME is so much higher than ours."""
        data = (self.name + difference).to_bytes(8, "little")
        return Frame("crane", 0x18EEFF00 | source, True, data)

    def receive(self, *frames: Frame) -> None:
        for frame in frames:
            self.controller.receive(frame, self.now_ns)

    def tick(self, *frames: Frame, missed: int = 0) -> list[Frame]:
        """These frames, and a tick; what was sent."""
        self.now_ns += TICK_NS * missed
        self.receive(*frames)
        sent = list(self.controller.tick(self.now_ns, missed))
        self.events += [event.text for event in self.controller.events]
        self.controller.events.clear()
        self.now_ns += TICK_NS
        return sent

    def run(self, ticks: int, **left: float) -> list[list[Frame]]:
        """Both joysticks and a tick, so many times; what each sent."""
        return [self.tick(bjm("BJM1", **left), bjm("BJM2")) for _ in range(ticks)]

    def claimed(self) -> "Rig":
        self.run(14)
        assert self.events[0] == "bus=crane message=BJM1 source=0x33"
        assert "bus=crane address=0x9c state=claimed" in self.events
        return self

    def moving(self) -> "Rig":
        """Slew in full motion."""
        self.claimed().run(5)
        sent = self.run(60, X=100.0)[-1]
        assert flow(sent) > 50.0
        assert self.state() is State.ACTIVE
        return self

    def state(self, axis: str = "slew") -> State:
        return self.controller.axes[axis].axis.state

    def reason(self, axis: str = "slew") -> str:
        return self.controller.axes[axis].axis.reason.name

    @property
    def fault(self) -> str:
        return self.controller.counters.last_fault.name


def ids(frames: list[Frame]) -> list[int]:
    return [frame.can_id for frame in frames]


def flow(frames: list[Frame], number: int = 0) -> float:
    """Signed flow of an auxiliary valve command in %, as a valve of eight bits reads it."""
    (frame,) = [f for f in frames if f.can_id == AVC | number << 8 | OWN]
    values = NETWORK.decode_message(f"AVC{number}", frame.data, decode_choices=False)
    if values["State"] == 0:
        assert values["PortFlow"] == values["ExtendedFlow"] == 0
    return {0: 0.0, 1: 1.0, 2: -1.0}[values["State"]] * values["PortFlow"]
