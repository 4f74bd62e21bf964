"""An enable that was seen released: no fault, and not forgotten while frames cannot be trusted."""

from typing import Any, Protocol

from canshaper.can.frame import Frame, FrameFault
from canshaper.service.controller import Controller
from canshaper.shaping.states import State


class Rig(Protocol):
    controller: Controller
    counts: dict[str, int]

    def lever(self, name: str = ..., **raw: int) -> Frame: ...
    def receive(self, *frames: Frame) -> None: ...
    def tick(self, missed: int = ...) -> dict[str, dict[str, Any]]: ...
    def run(self, ticks: int = ..., **raw: int) -> dict[str, dict[str, Any]]: ...
    def state(self, axis: str = ...) -> State: ...
    def reason(self, axis: str = ...) -> str: ...
    def count(self, name: str) -> int: ...


def test_a_released_enable_is_no_fault_of_the_frame(rig: Rig) -> None:
    rig.run(10, Enable=0)
    rig.run(10)
    assert rig.count("InvalidSignals") == 0
    assert rig.controller.counters.last_fault is FrameFault.NONE
    rig.run(1, Enable=2)
    assert rig.count("InvalidSignals") == 2  # both levers
    assert rig.controller.counters.last_fault is FrameFault.INVALID_SIGNAL


def test_it_stays_released_while_the_frames_after_it_cannot_be_trusted(rig: Rig) -> None:
    """A counter that stands still says nothing new, and least of all that somebody enabled."""
    rig.run(5)
    rig.receive(rig.lever(Enable=0), rig.lever("LeverRight"))
    rig.tick()
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "ENABLE_OFF")
    rig.counts["LeverLeft"] -= 1
    frozen = rig.lever(Enable=1)
    for _ in range(20):
        rig.receive(frozen, rig.lever("LeverRight"))
        rig.tick()
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "ENABLE_OFF")
    rig.run(1)
    assert rig.state() is State.READY
