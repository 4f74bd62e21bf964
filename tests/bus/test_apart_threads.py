"""The threads of a bus apart, with an interface that waits for a sign of the test to go on."""

import socket
from collections.abc import Iterator
from contextlib import suppress
from select import select
from typing import Any

import can
import pytest

from canshaper.bus import apart
from canshaper.bus.apart import LEAVE_NS, MOST_RECEIVED, PROBE_NS, BusApart, unsent
from canshaper.bus.python_can import receive
from tests.bus.held import Held, message
from tests.bus.lines import until


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    clock = [10**12]
    monkeypatch.setattr(apart, "boottime_ns", lambda: clock[0])
    return clock


@pytest.fixture
def held() -> Held:
    return Held()


@pytest.fixture
def bus(held: Held, now: list[int]) -> Iterator[BusApart]:
    made = BusApart(held, receive)  # type: ignore[arg-type]
    yield made
    held.go.release(1000)
    made.shutdown()


def test_of_each_id_the_last_waits(bus: BusApart, held: Held) -> None:
    bus.send(message(1))
    until(lambda: held.begun == [1])
    for value, can_id in ((2, 1), (3, 2), (4, 1)):
        bus.send(message(value, can_id))
    held.go.release(3)
    until(lambda: len(held.sent) == 3)
    assert held.sent == [1, 4, 3]


@pytest.mark.parametrize(("waited_ns", "sent"), [(LEAVE_NS, [1, 2]), (LEAVE_NS + 1, [1])])
def test_what_waited_too_long_is_dropped(
    bus: BusApart, held: Held, now: list[int], waited_ns: int, sent: list[int]
) -> None:
    bus.send(message(1))
    until(lambda: held.begun)
    bus.send(message(2))
    now[0] += waited_ns
    held.go.release(2)
    until(lambda: held.sent == sent and not bus._waiting)
    held.go.release(10)
    with suppress(can.CanTimeoutError):  # the first was late too
        bus.send(message(9, 9))
    now[0] += PROBE_NS
    bus.send(message(9, 9))
    until(lambda: held.sent[-1] == 9)
    assert [value for value in held.sent if value != 9] == sent


def test_a_frame_under_way_for_too_long_blocks_and_one_is_tried_later(
    bus: BusApart, held: Held, now: list[int]
) -> None:
    bus.send(message(1))
    until(lambda: held.begun)
    now[0] += LEAVE_NS
    bus.send(message(2))
    now[0] += 1
    with pytest.raises(can.CanTimeoutError, match=r"^the adapter takes no frames$"):
        bus.send(message(3))
    assert not bus.took
    held.go.release(10)
    until(lambda: held.sent == [1])
    until(lambda: not bus._began_ns)
    with pytest.raises(can.CanTimeoutError):
        bus.send(message(4))
    assert not bus.took, "it came too late"
    now[0] += PROBE_NS - 1
    with pytest.raises(can.CanTimeoutError):
        bus.send(message(4))
    now[0] += 1
    bus.send(message(5))
    until(lambda: held.sent == [1, 5])
    until(lambda: bus.took)


@pytest.mark.parametrize(("lasted_ns", "took"), [(LEAVE_NS, True), (LEAVE_NS + 1, False)])
def test_a_frame_is_late_that_took_longer_than_the_limit(
    bus: BusApart, held: Held, now: list[int], lasted_ns: int, took: bool
) -> None:
    bus.send(message(1))
    until(lambda: held.begun)
    now[0] += lasted_ns
    held.go.release(1)
    until(lambda: not bus._began_ns)
    assert bus.took is took


def test_bytes_in_the_kernel_block_from_when_they_were_seen_first(
    bus: BusApart, held: Held, now: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A frame that begins later does not restart the time."""
    monkeypatch.setattr(apart, "unsent", lambda _: 1)
    held.go.release(1)
    bus.send(message(1))
    until(lambda: held.sent == [1] and not bus._began_ns)
    now[0] += LEAVE_NS
    bus.send(message(2))
    until(lambda: held.begun == [1, 2])
    now[0] += 1
    with pytest.raises(can.CanTimeoutError):
        bus.send(message(3))


def test_what_the_interface_raises_is_raised_at_the_next_frame(bus: BusApart, held: Held) -> None:
    held.error = OSError("gone")
    held.go.release(1)
    bus.send(message(1))
    until(lambda: not bus.took)
    with pytest.raises(OSError, match="gone"):
        bus.send(message(2))
    held.error = None
    held.go.release(1)
    bus.send(message(3))
    until(lambda: held.sent == [3])


def test_what_is_raised_too_late_is_not_raised_again(
    bus: BusApart, held: Held, now: list[int]
) -> None:
    """That it was late is reported in its place."""
    held.error = OSError("gone")
    bus.send(message(1))
    until(lambda: held.begun)
    now[0] += LEAVE_NS + 1
    held.go.release(1)
    until(lambda: not bus._began_ns)
    held.error = None
    with pytest.raises(can.CanTimeoutError):
        bus.send(message(2))
    now[0] += PROBE_NS
    held.go.release(1)
    bus.send(message(3))
    until(lambda: held.sent == [3])


def test_a_frame_that_leaves_does_not_hide_that_one_before_did_not(
    bus: BusApart, held: Held
) -> None:
    held.error = OSError("gone")
    bus.send(message(1))
    until(lambda: held.begun == [1])
    bus.send(message(2, 2))
    held.go.release(1)
    until(lambda: held.begun == [1, 2])
    held.error = None
    held.go.release(1)
    until(lambda: held.sent == [2] and bus.took)
    with pytest.raises(OSError, match="gone"):
        bus.send(message(3))
    held.go.release(1)
    bus.send(message(4))
    until(lambda: held.sent == [2, 4])


def test_a_frame_that_comes_as_the_descriptor_is_emptied_is_not_left(
    bus: BusApart, held: Held
) -> None:
    """The descriptor would not be readable again before the next one."""
    seen = bus._wake_reader

    class Late:
        def recv(self, size: int) -> bytes:
            held.waiting = [message(1)]
            until(lambda: bus._received)
            until(lambda: select([seen], [], [], 0)[0])
            return seen.recv(size)

        def close(self) -> None:
            seen.close()

    bus._wake_reader = Late()  # type: ignore[assignment]
    received = bus.recv(0)
    assert received is not None
    assert received.data == b"\1"


def test_a_frame_and_what_is_raised_come_in_their_order(bus: BusApart, held: Held) -> None:
    first, second = message(1), message(2)
    held.waiting = [first, ValueError("garbled"), second]
    frames: list[Any] = []

    def more() -> bool:
        try:
            frames.append(bus.recv(0))
        except ValueError as error:
            frames.append(error)
        frames[:] = [one for one in frames if one is not None]
        return len(frames) == 3

    until(more)
    assert [frames[0], frames[2]] == [first, second]
    assert str(frames[1]) == "garbled"


@pytest.mark.slow
def test_a_backlog_is_bounded(held: Held) -> None:
    held.waiting = [message(n % 256) for n in range(MOST_RECEIVED + 10)]
    bus = BusApart(held, receive)  # type: ignore[arg-type]
    until(lambda: not held.waiting)
    count = 0
    while bus.recv(0):
        count += 1
    assert count == MOST_RECEIVED
    assert bus.lost == 10
    bus.shutdown()
    assert held.closed


def test_an_interface_that_never_returns_is_left_behind(held: Held) -> None:
    bus = BusApart(held, receive)  # type: ignore[arg-type]
    bus.send(message(1))
    until(lambda: held.begun)
    bus.shutdown()
    assert not held.closed
    held.go.release(1)
    until(lambda: held.closed)


def test_a_line_that_is_closed_meanwhile_is_no_end(held: Held) -> None:
    ours, theirs = socket.socketpair()
    held.line = ours.fileno()
    bus = BusApart(held, receive)  # type: ignore[arg-type]
    ours.close()
    theirs.close()
    held.waiting = [message(1)]
    until(lambda: bus.recv(0))
    held.go.release(1)
    bus.shutdown()


def test_where_no_one_says_how_much_waits_nothing_does() -> None:
    assert apart.descriptor(Held()) == -1  # type: ignore[arg-type]
    assert unsent(-1) == 0
    apart.discard_unsent(-1)
