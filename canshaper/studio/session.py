"""A crane that a studio listens to, and drives where it is a simulated one."""

from collections.abc import Mapping
from dataclasses import dataclass

from canshaper.bus.port import Port
from canshaper.codec.frame import Frame
from canshaper.studio.crane import Crane
from canshaper.studio.in_process import InProcessCrane
from canshaper.studio.view import CraneView
from canshaper_sim.hand import Hand, Held


@dataclass
class CraneSession:
    """A crane that is listened to; ``hand`` where the page drives it, ``here`` in this process."""

    view: CraneView
    ports: Mapping[str, Port]
    hand: Hand | None = None
    crane: Crane | None = None
    shaped: bool = True
    here: InProcessCrane | None = None

    def move_joysticks(self, time_ms: int, held: Held) -> list[Frame]:
        """Send the frames of the joysticks that are due, where the page drives it; those frames."""
        frames = list(self.hand.frames(time_ms, held)) if self.hand else []
        for frame in frames:
            self.ports[frame.bus].send(frame)
        return frames
