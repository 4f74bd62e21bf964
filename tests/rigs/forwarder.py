"""A controller on real frames: joysticks are encoded and valves decoded by plain cantools."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.shaping.states import State
from tests.rigs.files import ROOT, read

TICK_NS = 20_000_000

# What a joystick sends that nobody touches, raw.
CENTRED = {"Enable": 1, "AntiSwayOff": 0, "Reset": 0}
JOYSTICKS = {"JoystickLeft": ("Slew", "NearFar"), "JoystickRight": ("Lift", "Rotate")}

# For the DBC: the slew axis has its turn in every tenth tick.
SLOW_VALVE = {"BO_ 512 20;": "BO_ 512 200;"}
# For the YAML: joysticks that are believed for longer than a valve waits.
PATIENT = {"timeout_ms: 100 #": "timeout_ms: 900 #", "timeout_ms: 100\n": "timeout_ms: 900\n"}
NAMES = (*JOYSTICKS, "SlewCommand", "NearFarCommand", "LiftCommand", "ShaperStatus")
NAMES += ("SlewStatus", "NearFarStatus", "LiftStatus", "AimPoint")


class Rig:
    """A controller with its clock and the two joysticks of the shipped machine."""

    def __init__(self, path: Path) -> None:
        self.deployment = read(path)
        self.controller = Controller(self.deployment)
        self.now_ns = 0
        self.messages = {name: self.message(name) for name in NAMES}
        self.counts = {"JoystickLeft": 0, "JoystickRight": 0}

    def message(self, name: str) -> Any:
        found = self.deployment.messages.find(name)
        assert not isinstance(found, str)
        return found[1]

    def joystick(self, name: str = "JoystickLeft", **raw: int) -> Frame:
        """The next frame of a joystick; joysticks in 0.1 %, centred and enabled unless told."""
        self.counts[name] = (self.counts[name] + 1) % 256
        values = {**dict.fromkeys(JOYSTICKS[name], 0), **CENTRED, "AliveCounter": self.counts[name]}
        message = self.messages[name]
        data = message.encode({**values, **raw}, scaling=False, strict=False)
        bus = next(v.bus for v in self.deployment.config.joysticks.values() if v.message == name)
        return Frame(bus, message.frame_id, message.is_extended_frame, data)

    def receive(self, *frames: Frame) -> None:
        for frame in frames:
            self.controller.receive(frame, self.now_ns)

    def tick(self, missed: int = 0) -> dict[str, dict[str, Any]]:
        """One tick; what was sent, decoded, by the name of the message."""
        self.now_ns += TICK_NS * missed
        frames = self.controller.tick(self.now_ns, missed)
        self.now_ns += TICK_NS
        sent = {}
        for frame in frames:
            message = next(
                m
                for m in self.messages.values()
                if (m.frame_id, m.is_extended_frame) == (frame.can_id, frame.extended)
            )
            assert len(frame.data) == message.length
            assert message.name not in sent
            sent[message.name] = {**message.decode(frame.data, decode_choices=False), "": frame}
        return sent

    def run(self, ticks: int = 1, **raw: int) -> dict[str, dict[str, Any]]:
        """Both joysticks and a tick, so many times; what the last one sent."""
        sent: dict[str, dict[str, Any]] = {}
        for _ in range(ticks):
            left = {k: v for k, v in raw.items() if k not in JOYSTICKS["JoystickRight"]}
            right = {k: v for k, v in raw.items() if k not in JOYSTICKS["JoystickLeft"]}
            self.receive(
                self.joystick("JoystickLeft", **left), self.joystick("JoystickRight", **right)
            )
            sent = self.tick()
        return sent

    def moving(self) -> "Rig":
        """Slew in full motion."""
        self.run(3)
        assert self.run(50, Slew=1000)["SlewCommand"]["Velocity"] > 50
        return self

    def state(self, axis: str = "slew") -> State:
        return self.controller.axes[axis].axis.state

    def reason(self, axis: str = "slew") -> str:
        return self.controller.axes[axis].axis.reason.name

    def count(self, name: str) -> int:
        return self.controller.counters.values[name]


Make = Callable[..., Rig]
"""Type of ``changed_rig``."""


def command(rig: Rig) -> float:
    """Command of the operator for slew."""
    return rig.controller.axes["slew"].axis.demand


def velocity(sent: dict[str, dict[str, Any]]) -> float:
    """Setpoint of the slew valve, in raw steps."""
    return float(sent["SlewCommand"]["Velocity"])


def last_fault(rig: Rig) -> FrameFault:
    return rig.controller.counters.last_fault


@pytest.fixture
def rig() -> Rig:
    return Rig(ROOT / "config" / "forwarder.yaml")


@pytest.fixture
def changed_rig(tmp_path: Path) -> Make:
    """A rig of the shipped machine with pieces of its two files replaced."""

    def make(yaml: dict[str, str] | None = None, dbc: dict[str, str] | None = None) -> Rig:
        text = (ROOT / "config" / "forwarder.yaml").read_text(encoding="utf-8")
        text = text.replace("../dbc/forwarder.dbc", "machine.dbc")
        # Valves that wait for longer, so that a test may slow them down.
        text = text.replace(
            "signal: Velocity, timeout_ms: 200", "signal: Velocity, timeout_ms: 600"
        )
        # And stop over a long way, which tails and cycles of a test need.
        text = re.sub(r"stop_distance_m: [\d.]+", "stop_distance_m: 200", text)
        network = (ROOT / "dbc" / "forwarder.dbc").read_text(encoding="cp1252")
        for old, new in (yaml or {}).items():
            assert old in text, old
            text = text.replace(old, new)
        for old, new in (dbc or {}).items():
            assert old in network, old
            network = network.replace(old, new)
        (tmp_path / "machine.yaml").write_text(text, encoding="utf-8")
        (tmp_path / "machine.dbc").write_text(network, encoding="cp1252")
        return Rig(tmp_path / "machine.yaml")

    return make
