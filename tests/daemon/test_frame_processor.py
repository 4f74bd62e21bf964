"""Calls that one I/O cycle makes to a frame processor and to its ports, in their order."""

from collections.abc import Iterator

import pytest

from canshaper.codec.frame import Frame
from canshaper.gate.cycle import Standstill, io_cycle, receive_waiting
from tests.rigs.forwarder import Rig
from tests.rigs.waiting import Waiting

MS = 1_000_000
NOW_NS = 10**12
JOYSTICK, OTHER, VALVE = (Frame("crane", can_id, False, b"") for can_id in (0x110, 0x300, 0x200))


class Notes:
    """A processor that passes every joystick frame on, moves with all it sends, and notes calls."""

    moves = True

    def __init__(self, *, withholds: bool = False) -> None:
        self.calls: list[tuple[object, ...]] = []
        self._withholds = withholds

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        self.calls.append(("receive", frame.can_id, arrived_ns))
        return VALVE if frame == JOYSTICK else None

    def stalled(self) -> None:
        self.calls.append(("stalled",))

    def tick(self, now_ns: int, missed: int) -> Iterator[Frame]:
        self.calls.append(("tick", now_ns, missed))
        yield VALVE

    def send_failed(self, frame: Frame) -> None:
        self.calls.append(("send failed", frame.can_id))

    def withhold(self, frame: Frame) -> bool:
        self.calls.append(("withhold", frame.can_id))
        return self._withholds


class TwoQueues(Waiting):
    """A bus with a frame that can wait."""

    def background(self) -> Iterator[Frame]:
        yield OTHER


@pytest.fixture
def standstill(rig: Rig) -> Standstill:
    """Of a loop whose last tick was 20 ms ago and which is not held up."""
    standstill = Standstill(rig.deployment)
    standstill.last_ns = NOW_NS - 20 * MS
    standstill.clock = lambda: NOW_NS
    return standstill


def test_a_cycle_receives_ticks_sends_and_then_takes_what_can_wait(standstill: Standstill) -> None:
    """A frame is never younger than the tick that takes it."""
    notes, port = Notes(), TwoQueues()
    port.wait(JOYSTICK, arrived_ns=NOW_NS - 5 * MS)
    port.wait(JOYSTICK, arrived_ns=NOW_NS + 5 * MS)
    io_cycle(notes, {"crane": port}, NOW_NS, 3, standstill)
    assert notes.calls == [
        ("receive", 0x110, NOW_NS - 5 * MS),
        ("receive", 0x110, NOW_NS),
        ("tick", NOW_NS, 3),
        ("receive", 0x300, NOW_NS),
    ]
    assert port.sent == [VALVE] * 3
    assert standstill.last_ns == NOW_NS


def test_after_a_standstill_the_processor_knows_before_it_receives(standstill: Standstill) -> None:
    notes, port = Notes(), Waiting(most=2)
    standstill.last_ns = NOW_NS - 1000 * MS
    port.wait(*[JOYSTICK] * 5, arrived_ns=NOW_NS - MS)
    io_cycle(notes, {"crane": port}, NOW_NS, 49, standstill)
    received = ("receive", 0x110, NOW_NS - MS)
    withheld = ("withhold", 0x200)  # what moves and was computed from before the standstill
    assert notes.calls == [("stalled",), *[received, withheld] * 5, ("tick", NOW_NS, 49), withheld]


@pytest.mark.parametrize("held_ms", [0, 1000])
def test_of_frames_that_are_too_late_to_pass_every_one_is_received(
    standstill: Standstill, held_ms: int
) -> None:
    """One that is withheld ends nothing: behind it may be neutral, or an emergency stop."""
    notes, port = Notes(withholds=True), Waiting()
    port.wait(*[JOYSTICK] * 3, arrived_ns=NOW_NS)
    standstill.over(NOW_NS)
    standstill.clock = lambda: NOW_NS + held_ms * MS
    assert receive_waiting(notes, {"crane": port}, NOW_NS, standstill) == 3
    assert len([call for call in notes.calls if call[0] == "receive"]) == 3
    assert len(port.sent) == (0 if held_ms else 3)


def test_frames_are_counted_over_all_buses(standstill: Standstill) -> None:
    """A gateway that finds none several times in a row sleeps instead of asking again."""
    ports = {"crane": Waiting(), "two": Waiting(), "three": Waiting()}
    assert receive_waiting(Notes(), ports, NOW_NS, standstill) == 0
    ports["crane"].wait(JOYSTICK, OTHER)
    ports["three"].wait(OTHER)
    assert receive_waiting(Notes(), ports, NOW_NS, standstill) == 3


def test_a_frame_that_does_not_reach_its_bus_is_reported(standstill: Standstill) -> None:
    class Full(Waiting):
        def send(self, frame: Frame) -> bool:
            return False

    notes, port = Notes(), Full()
    port.wait(JOYSTICK)
    io_cycle(notes, {"crane": port}, NOW_NS, 0, standstill)
    assert [call for call in notes.calls if call[0] == "send failed"] == [
        ("send failed", 0x200)
    ] * 2
