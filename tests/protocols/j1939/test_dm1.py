"""Active faults on the bus: single frame and broadcast, every second and on change."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.frame import Frame
from canshaper.protocols.j1939.dm1 import FMI_OF, ActiveFaults, Fault, dm1_data
from canshaper.shaping.states import Reason
from tests.rigs.j1939 import BROADCAST, DM1, OWN, PACKET, Rig, bjm, ids, request

MS = 1_000_000
SECOND_NS = 1_000_000_000
FIRST = 520192
# What the operator does, and what leaves us without an address to report it from.
NO_FAULTS = {"ENABLE_LOST", "EMERGENCY_STOP", "ADDRESS_NOT_CLAIMED", "ADDRESS_LOST"}


def codes(data: bytes) -> list[tuple[int, int, int]]:
    """(SPN, FMI, count) by the layout of SAE J1939-73, version 4, read bit by bit."""
    active = []
    for at in range(2, len(data) - 3, 4):
        number = int.from_bytes(data[at : at + 4], "little")
        spn = number & 0xFFFF | (number >> 21 & 7) << 16
        assert number >> 31 == 0  # the conversion method of version 4
        if number:
            active.append((spn, number >> 16 & 31, number >> 24 & 127))
    return active


class Bus:
    """Takes DM1, in one frame or by broadcast, as another node does."""

    def __init__(self) -> None:
        self.faults = ActiveFaults("crane", OWN)
        self.now_ns = 0
        self.received: list[tuple[int, bytes]] = []
        self._size = self._count = 0
        self._parts: list[bytes] = []
        self._last_ns = 0

    def run(self, active: list[tuple[int, int]], ticks: int = 1, **options: Any) -> None:
        for _ in range(ticks):
            for frame in self.faults.frames(active, self.now_ns, **options):
                self._take(frame.can_id, frame.data)
            self.now_ns += 20 * MS

    def _take(self, can_id: int, data: bytes) -> None:
        assert len(data) == 8
        if can_id == DM1:
            self.received.append((self.now_ns, data))
        elif can_id == BROADCAST:
            assert not self._parts
            assert (data[0], data[4], data[5:]) == (32, 0xFF, b"\xca\xfe\x00")
            self._size, self._count = int.from_bytes(data[1:3], "little"), data[3]
            self._last_ns = self.now_ns
        else:
            assert can_id == PACKET
            assert 50 * MS <= self.now_ns - self._last_ns <= 200 * MS
            self._last_ns = self.now_ns
            self._parts.append(data[1:])
            assert data[0] == len(self._parts)
            if len(self._parts) == self._count:
                whole = b"".join(self._parts)
                assert set(whole[self._size :]) <= {0xFF}
                self.received.append((self.now_ns, whole[: self._size]))
                self._parts = []


@pytest.fixture
def bus() -> Bus:
    return Bus()


def test_no_fault_is_reported_every_second(bus: Bus) -> None:
    bus.run([], 151)
    assert [t for t, _ in bus.received] == [0, SECOND_NS, 2 * SECOND_NS, 3 * SECOND_NS]
    assert {data for _, data in bus.received} == {bytes((0, 0xFF, 0, 0, 0, 0, 0xFF, 0xFF))}


def test_one_fault_is_reported_at_once_with_the_lamp_and_its_end_too(bus: Bus) -> None:
    bus.run([], 20)
    bus.run([(FIRST, 9)])
    when, data = bus.received[-1]
    assert when == 400 * MS
    assert data == bytes((0x04, 0xFF, 0x00, 0xF0, 0xE9, 0x01, 0xFF, 0xFF))
    bus.run([(FIRST, 9)], 19)
    bus.run([])
    assert bus.received[-1][0] == 800 * MS
    assert codes(bus.received[-1][1]) == []


def test_a_fault_that_comes_and_goes_does_not_fill_the_bus_and_is_counted(bus: Bus) -> None:
    for _ in range(500):
        bus.run([(FIRST, 9)])
        bus.run([])
    bus.run([(FIRST, 9)], 60)
    times = [t for t, _ in bus.received]
    assert min(b - a for a, b in pairwise(times)) >= 200 * MS
    assert codes(bus.received[-1][1]) == [(FIRST, 9, 126)]


@pytest.mark.parametrize("count", [2, 3, 5, 64])
def test_more_than_one_fault_is_a_broadcast(bus: Bus, count: int) -> None:
    active = [(FIRST + i, i % 32) for i in range(count)]
    bus.run(active, 200)
    assert codes(bus.received[0][1]) == [(spn, fmi, 1) for spn, fmi in active]


def test_a_broadcast_that_was_interrupted_is_not_gone_on_with(bus: Bus) -> None:
    active = [(FIRST, 9), (FIRST + 1, 7), (FIRST + 2, 9)]
    assert ids(list(bus.faults.frames(active, 0))) == [BROADCAST]
    bus.faults.interrupt()
    assert ids(list(bus.faults.frames(active, 400 * MS))) == [BROADCAST]


def test_a_single_fault_is_one_extended_frame() -> None:
    faults = ActiveFaults("crane", OWN)
    data = bytes.fromhex("04FF00F0E901FFFF")
    assert list(faults.frames([(FIRST, 9)], 0)) == [Frame("crane", DM1, True, data)]


def test_a_broadcast_is_extended_frames_50_ms_apart() -> None:
    faults, active = ActiveFaults("crane", OWN), [(FIRST, 9), (FIRST + 1, 7)]
    head, first, second = (
        Frame("crane", can_id, True, bytes.fromhex(data))
        for can_id, data in (
            (BROADCAST, "200A0002FFCAFE00"),
            (PACKET, "0104FF00F0E90101"),
            (PACKET, "02F0E701FFFFFFFF"),
        )
    )
    assert list(faults.frames(active, 0)) == [head]
    assert list(faults.frames(active, 50 * MS - 1)) == []
    assert list(faults.frames(active, 50 * MS)) == [first]
    assert list(faults.frames(active, 100 * MS - 1)) == []
    assert list(faults.frames(active, 100 * MS)) == [second]
    assert list(faults.frames(active, 150 * MS)) == []


def test_a_change_is_sent_at_200_ms_after_the_last_report() -> None:
    faults = ActiveFaults("crane", OWN)
    assert ids(list(faults.frames([], 0))) == [DM1]
    assert list(faults.frames([(FIRST, 9)], 200 * MS - 1)) == []
    assert ids(list(faults.frames([(FIRST, 9)], 200 * MS))) == [DM1]


def test_after_an_interruption_at_time_zero_faults_are_reported_again_at_once() -> None:
    faults = ActiveFaults("crane", OWN)
    assert ids(list(faults.frames([], 0))) == [DM1]
    faults.interrupt()
    assert ids(list(faults.frames([], 0))) == [DM1]


def test_a_request_is_answered_at_once(bus: Bus) -> None:
    bus.run([], 10)
    bus.run([], requested=True)
    assert bus.received[-1][0] == 200 * MS


@given(
    st.lists(
        st.builds(Fault, st.integers(1, 524287), st.integers(0, 31), st.integers(0, 1000)),
        max_size=70,
    )
)
def test_every_code_is_read_back(faults: list[Fault]) -> None:
    data = dm1_data(faults)
    assert data[0] == (0x04 if faults else 0)
    expected = [(f.spn, f.fmi, min(f.times, 126)) for f in faults]
    assert codes(data) == expected


def test_every_reason_for_a_stop_is_a_fault_or_is_known_to_be_none() -> None:
    stops = {r.name for r in Reason if r >= Reason.JOYSTICK_TIMEOUT}
    reported = {r.name for r in FMI_OF}
    assert not reported & NO_FAULTS
    assert stops - reported - NO_FAULTS <= {"VALVE_NOT_READY"}


def test_the_machine_reports_which_axes_cannot_move_and_why() -> None:
    rig = Rig()
    for _ in range(14):
        sent = rig.tick(bjm("BJM1"))  # the right joystick is silent
    frames = sent + [f for _ in range(30) for f in rig.tick(bjm("BJM1"))]
    data = b"".join(f.data[1:] for f in frames if f.can_id == PACKET)
    (head,) = [f for f in frames if f.can_id == BROADCAST]
    active = codes(data[: head.data[1]])
    # lift is the third axis: joystick lost; its valve and those of the other two were not received
    assert active == [(FIRST + 1, 9, 1), (FIRST + 3, 9, 1), (FIRST + 4, 9, 1), (FIRST + 5, 9, 1)]


def test_a_broadcast_begins_again_after_the_address_was_not_ours() -> None:
    rig = Rig().claimed()
    while BROADCAST not in ids(rig.run(1)[0]):
        pass
    rig.controller.on_bus_off("crane")
    sent = [f for frames in rig.run(20) for f in frames]
    under_way = [i for i in ids(sent) if i in (BROADCAST, PACKET)]
    assert under_way[0] == BROADCAST


def test_a_request_for_dm1_is_answered_also_when_it_came_while_waiting() -> None:
    rig = Rig()
    rig.tick(request(0xFECA))
    rig.claimed()
    rig.run(100)
    answers = rig.tick(bjm("BJM1"), bjm("BJM2"), request(0xFECA))
    assert {DM1, BROADCAST} & set(ids(answers))
