"""The shipped gateway under test: its joysticks and the ECU behind it by plain cantools."""

from pathlib import Path
from typing import Any

import cantools

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from tests.rigs.files import ROOT

TICK_NS = 20_000_000
JOYSTICKS = {"JoystickLeft": ("Slew", "NearFar"), "JoystickRight": ("Lift", "Rotate")}
CENTRED = {"Enable": 1, "AntiSwayOff": 0, "Reset": 0}


class GatewayRig:
    """A controller, its clock, both joysticks, and all that leaves towards the ECU.

    ``left`` holds every frame of the joystick messages on the machine's bus, in order.
    """

    def __init__(
        self,
        folder: Path,
        yaml: tuple[tuple[str, str], ...] = (),
        dbc: tuple[tuple[str, str], ...] = (),
    ) -> None:
        text = _changed((ROOT / "config" / "gateway-forwarder.yaml").read_text(), yaml)
        network = _changed((ROOT / "dbc" / "forwarder.dbc").read_text("cp1252"), dbc)
        file = folder / "gateway.yaml"
        file.write_text(text.replace("../dbc/forwarder.dbc", "machine.dbc"))
        (folder / "machine.dbc").write_text(network, "cp1252")
        self.dbc: Any = cantools.database.load_file(folder / "machine.dbc")
        self.deployment = load_deployment(file)
        self.controller = Controller(self.deployment)
        self.now_ns = 0
        self.counts = dict.fromkeys(JOYSTICKS, 0)
        self.left: list[Frame] = []

    def joystick(self, name: str = "JoystickLeft", junk: int = 0, **raw: int) -> Frame:
        """The next frame of a joystick; ``junk`` are bits that no signal has."""
        self.counts[name] = (self.counts[name] + 1) % 256
        message = self.dbc.get_message_by_name(name)
        values = {**dict.fromkeys(JOYSTICKS[name], 0), **CENTRED, "AliveCounter": self.counts[name]}
        rest = {s.name: 0 for s in message.signals if s.name not in values}
        data = message.encode({**values, **rest, **raw}, scaling=False, strict=False)
        word = int.from_bytes(data, "little") | junk
        return Frame("joysticks", message.frame_id, False, word.to_bytes(8, "little"))

    def receive(self, frame: Frame) -> Frame | None:
        """Return the frame that a frame from the joysticks leaves as."""
        passed = self.controller.receive(frame, self.now_ns)
        if passed is not None:
            self.left.append(passed)
        return passed

    def tick(self, missed: int = 0) -> list[Frame]:
        """One tick; the frames of joystick messages that it sends by itself."""
        self.now_ns += missed * TICK_NS
        frames = list(self.controller.tick(self.now_ns, missed))
        self.now_ns += TICK_NS
        own = [f for f in frames if f.can_id in (0x110, 0x111)]
        assert all(f.bus == "machine" for f in frames)
        self.left += own
        return own

    def run(self, ticks: int = 1, **raw: int) -> dict[str, Any]:
        """Both joysticks and a tick, so many times; the last frame of the left one, decoded."""
        for _ in range(ticks):
            mine = {k: v for k, v in raw.items() if k not in JOYSTICKS["JoystickRight"]}
            other = {k: v for k, v in raw.items() if k not in JOYSTICKS["JoystickLeft"]}
            self.receive(self.joystick("JoystickLeft", **mine))
            self.receive(self.joystick("JoystickRight", **other))
            assert self.tick() == []
        return self.decoded(next(f for f in reversed(self.left) if f.can_id == 0x110))

    def moving(self) -> "GatewayRig":
        """Slew in full motion."""
        self.run(3)
        assert self.run(60, Slew=1000)["Slew"] > 400
        return self

    def decoded(self, frame: Frame) -> dict[str, Any]:
        """Raw values of a joystick message."""
        values = self.dbc.decode_message(
            frame.can_id, frame.data, decode_choices=False, scaling=False
        )
        assert isinstance(values, dict)
        return values

    def state(self, axis: str = "slew") -> tuple[str, str]:
        """State and reason."""
        found = self.controller.axes[axis].axis
        return found.state.name, found.reason.name


def _changed(text: str, changes: tuple[tuple[str, str], ...]) -> str:
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text
