"""One tick between the buses and the controller, above all the first one after a standstill."""

from collections.abc import Callable, Iterator

from canshaper.can.binding import load_deployment
from canshaper.can.frame import BusState, Frame
from canshaper.service.exchange import exchange, stall_ns
from canshaper.shaping.states import State
from tests.service.conftest import ROOT, TICK_NS, Rig
from tests.service.emergency import DBC, LAST, STOP

Make = Callable[..., Rig]

# Levers that are believed for longer than a valve waits.
PATIENT = {"timeout_ms: 100 #": "timeout_ms: 900 #", "timeout_ms: 100\n": "timeout_ms: 900\n"}


class Waiting:
    """A bus on which frames wait; it hands out no more than ``most`` of them at a time."""

    name = "crane"
    state = BusState.UP

    def __init__(self, most: int = 1000) -> None:
        self.queue: list[Frame] = []
        self.sent: list[Frame] = []
        self._most = most

    def frames(self) -> Iterator[Frame]:
        for _ in range(min(self._most, len(self.queue))):
            yield self.queue.pop(0)

    def others(self) -> Iterator[Frame]:
        return iter(())

    def send(self, frame: Frame) -> bool:
        self.sent.append(frame)
        return True

    def watch(self, name: str, ids: object) -> None: ...

    def fileno(self) -> int:
        return -1

    def close(self) -> None: ...


def tick(rig: Rig, port: Waiting, missed: int = 0) -> None:
    """A tick as the daemon has it."""
    rig.now_ns += TICK_NS * (1 + missed)
    stalled = missed * TICK_NS > stall_ns(rig.deployment)
    exchange(rig.controller, {"crane": port}, rig.now_ns, missed, stalled=stalled)


def test_the_shortest_age_limit_or_valve_timeout_is_the_limit(changed_rig: Make) -> None:
    shipped = load_deployment(ROOT / "config" / "forwarder.yaml")
    assert stall_ns(shipped) == 100_000_000
    assert stall_ns(changed_rig(PATIENT).deployment) == 600_000_000
    assert stall_ns(changed_rig({LAST: STOP + LAST}, DBC).deployment) == 60_000_000


def test_a_valve_that_has_closed_meanwhile_does_not_get_full_speed(changed_rig: Make) -> None:
    rig = changed_rig(PATIENT)
    rig.moving()
    port = Waiting()
    port.queue = [rig.lever(Slew=1000)]
    tick(rig, port, missed=31)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "LOOP_STALLED")
    assert port.sent[0].data[0] == 0
