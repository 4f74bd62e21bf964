"""A bus on which frames wait, and the daemon's tick that reads them."""

from collections.abc import Iterator

from canshaper.codec.frame import BusState, Frame
from canshaper.gate.cycle import Standstill, io_cycle
from tests.rigs.forwarder import TICK_NS, Rig

# Younger than the clock of any rig: such a frame is as old as the tick that reads it.
YOUNG_NS = 10**18


class Waiting:
    """A bus on which frames wait; it hands out no more than ``most`` of them at a time.

    Attributes:
        queue: arrival and frame of each.
        sent: what left, in its order.
    """

    name = "crane"
    state = BusState.UP
    waited = 0

    def __init__(self, most: int = 1000) -> None:
        self.queue: list[tuple[int, Frame]] = []
        self.sent: list[Frame] = []
        self.arrived_ns = 0
        self._most = most

    def wait(self, *frames: Frame, arrived_ns: int = YOUNG_NS) -> None:
        """Let frames wait behind those that do."""
        self.queue += [(arrived_ns, frame) for frame in frames]

    def frames(self) -> Iterator[Frame]:
        for _ in range(min(self._most, len(self.queue))):
            self.arrived_ns, frame = self.queue.pop(0)
            yield frame

    def background(self) -> Iterator[Frame]:
        return iter(())

    def send(self, frame: Frame) -> bool:
        self.sent.append(frame)
        return True

    def watch(self, name: str, ids: object) -> None: ...

    def fileno(self) -> int:
        return -1

    def close(self) -> None: ...


def tick(rig: Rig, port: Waiting, missed: int = 0) -> None:
    """The rig's next tick as the daemon has it, so many late after one in time."""
    standstill = Standstill(rig.deployment)
    standstill.last_ns = rig.now_ns - TICK_NS
    rig.now_ns += TICK_NS * missed
    standstill.clock = lambda: rig.now_ns
    io_cycle(rig.controller, {"crane": port}, rig.now_ns, missed, standstill)
    rig.now_ns += TICK_NS


def both(rig: Rig, **raw: int) -> tuple[Frame, Frame]:
    """The next frame of each joystick; the values are of the left one."""
    return rig.joystick("JoystickLeft", **raw), rig.joystick("JoystickRight")
