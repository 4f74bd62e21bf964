"""A crane that a studio listens to, and drives where it is a simulated one."""

from collections.abc import Mapping
from dataclasses import dataclass

from canshaper.bus.port import Port
from canshaper.studio.crane import Crane
from canshaper.studio.in_process import InProcessCrane
from canshaper.studio.view import CraneView
from canshaper_sim.hand import Hand


@dataclass
class Seen:
    """A crane that is listened to; ``hand`` where the page drives it, ``here`` in this process."""

    view: CraneView
    ports: Mapping[str, Port]
    hand: Hand | None = None
    crane: Crane | None = None
    shaped: bool = True
    here: InProcessCrane | None = None
