"""The shipped bridge crane: its controller on real frames, and its file with other lines."""

from pathlib import Path
from typing import Any

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.rigs.files import CONFIG, machine_file, read

FILE = CONFIG / "bridge-crane.yaml"
TICK_NS = 20_000_000


def changed(directory: Path, *changes: tuple[str, str]) -> Path:
    """The file with other lines, everywhere that they stand."""
    return machine_file(directory, FILE, *changes)


class OverheadRig:
    """Its controller with a clock, both joysticks, and a rope of ``rope_m``, None for silence."""

    def __init__(self, path: Path = FILE) -> None:
        self.deployment: Deployment = read(path) if path == FILE else load_deployment(path)
        self.controller = Controller(self.deployment)
        self.rope_m: float | None = 5.0
        self._now_ns = self._count = 0

    def frame(self, name: str, **values: float) -> Frame:
        """A frame of a message, in the units of the DBC."""
        message: Any = self.deployment.messages.find(name)[1]
        every = {**dict.fromkeys((s.name for s in message.signals), 0), **values}
        data = message.encode(every, strict=False)
        return Frame("crane", message.frame_id, False, data)

    def tick(self, **joystick: float) -> dict[str, float]:
        """A tick with these joysticks, in percent; the speeds that were sent, in percent."""
        self._count = (self._count + 1) % 256
        own = {"Enable": 1, "AliveCounter": self._count}
        left = {k: v for k, v in joystick.items() if k != "Hoist"}
        right = {k: v for k, v in joystick.items() if k == "Hoist"}
        frames = [self.frame("CabinLeft", **own, **left), self.frame("CabinRight", **own, **right)]
        if self.rope_m is not None:
            frames.append(self.frame("CranePosition", RopeLength=self.rope_m))
        for frame in frames:
            self.controller.receive(frame, self._now_ns)
        sent = {}
        for frame in self.controller.tick(self._now_ns):
            for name in ("Bridge", "Trolley", "Hoist"):
                message: Any = self.deployment.messages.find(f"{name}Command")[1]
                if frame.can_id == message.frame_id:
                    sent[name] = float(message.decode(frame.data)["Speed"])
        self._now_ns += TICK_NS
        return sent

    def run(self, ticks: int, **joystick: float) -> list[float]:
        """So many of them; the speeds of the bridge."""
        return [self.tick(**joystick)["Bridge"] for _ in range(ticks)]

    def news(self) -> list[str]:
        """Return the lines of the log about the bridge's length."""
        texts = (event.text for event in self.controller.events)
        return [text for text in texts if text.startswith("axis=bridge length")]
