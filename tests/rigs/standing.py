"""The shipped machine at any tick, ticked as the daemon does, on a clock that may jump."""

from canshaper.codec.frame import Frame
from canshaper.gate.cycle import Standstill, io_cycle
from tests.rigs.forwarder import Make
from tests.rigs.waiting import Waiting, both

MS = 1_000_000


class Machine:
    """The shipped machine at another tick, on a clock of the test's.

    Attributes:
        now_ns: the clock.
        hold_up_ns: the process is held up for so long before the next frame of a valve leaves.
    """

    def __init__(
        self, make: Make, tick_ms: int, *, period_ticks: int = 1, joysticks_ms: int, valve_ms: int
    ) -> None:
        def cycle(can_id: int, before_ms: int, cycle_ms: int) -> tuple[str, str]:
            name = f"BO_ {can_id} "
            return f"{name}{before_ms};", f"{name}{cycle_ms};"

        joysticks, valves = (0x110, 0x111), (0x200, 0x201, 0x202)
        dbc = dict(cycle(can_id, 20, tick_ms) for can_id in joysticks)
        dbc |= dict(cycle(can_id, 20, tick_ms * period_ticks) for can_id in valves)
        yaml = {
            "tick_ms: 20 ": f"tick_ms: {tick_ms} ",
            "timeout_ms: 100 #": f"timeout_ms: {joysticks_ms} #",
            "timeout_ms: 100\n": f"timeout_ms: {joysticks_ms}\n",
            "timeout_ms: 600": f"timeout_ms: {valve_ms}",
        }
        self.rig = make(yaml, dbc)
        self.tick_ns, self.period = tick_ms * MS, period_ticks
        self.now_ns = self.hold_up_ns = self.slew = 0
        self.standstill = Standstill(self.rig.deployment)
        self.standstill.clock = self._clock
        self.port = Waiting()

    def _clock(self) -> int:
        self.now_ns += self.hold_up_ns
        self.hold_up_ns = 0
        return self.now_ns

    def tick(self, gap_ns: int, missed: int = 0) -> None:
        """One tick so long after the one before, with both joysticks out."""
        self.now_ns += gap_ns
        self.port.wait(*both(self.rig, Slew=self.slew))
        io_cycle(self.rig.controller, {"crane": self.port}, self.now_ns, missed, self.standstill)

    def moving(self) -> "Machine":
        for slew, ticks in ((0, 3), (900, round(1e9 / self.tick_ns))):
            self.slew = slew
            for _ in range(ticks * self.period):
                self.tick(self.tick_ns)
        assert self.commanded() > 50
        return self

    def commanded(self) -> int:
        """Velocity in the last frame of the slew valve."""
        return next(f.data[0] for f in reversed(self.port.sent) if f.can_id == 0x200)


def valves(port: Waiting) -> list[Frame]:
    """The frames of the valves that left."""
    return [f for f in port.sent if 0x200 <= f.can_id <= 0x202]
