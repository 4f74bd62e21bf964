"""Adapters whose calls block: slcan and serial on a pseudo-terminal, socketcand on loopback."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from select import select
from typing import Any

import can
import pytest

from canshaper.bus import apart
from canshaper.bus.apart import LEAVE_NS, MOST_RECEIVED, PROBE_NS, BusApart, unsent
from canshaper.bus.clock import boottime_ns
from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.config.bus import Bus
from tests.bus.lines import ANSWER_S, SerialLine, Socketcand, until

FRAME = Frame("crane", 0x110, False, b"\1\2\3\4\5\6\7\x08")
THEIR_BYTES = 4096  # N_TTY_BUF_SIZE of drivers/tty/n_tty.c


def numbered(number: int) -> Frame:
    return FRAME._replace(can_id=number % 8, data=number.to_bytes(8, "big"))


@pytest.fixture
def line() -> Iterator[SerialLine]:
    made = SerialLine()
    yield made
    made.close()


@pytest.fixture
def server() -> Iterator[Socketcand]:
    made = Socketcand()
    yield made
    made.close()


@pytest.fixture
def faults() -> list[FrameFault]:
    return []


@pytest.fixture
def slcan(line: SerialLine, faults: list[FrameFault]) -> Iterator[Port]:
    config = Bus(interface="slcan", channel=line.path, options={"sleep_after_open": 0.0})
    port = open_port("crane", config, faults.append)
    yield port
    port.close()


@pytest.fixture
def socketcand(server: Socketcand, faults: list[FrameFault]) -> Iterator[Port]:
    options: dict[str, Any] = {"host": "127.0.0.1", "port": server.port}
    config = Bus(interface="socketcand", channel="can0", options=options)
    port = open_port("crane", config, faults.append)
    yield port
    port.close()


def fill(port: Port, least: int = 0) -> list[Frame]:
    """Send until the adapter takes no more, at the pace of a loop; what it took.

    On a busy machine the thread that sends may be late before: then, again.
    """
    end, number = time.monotonic() + ANSWER_S, 0
    while time.monotonic() < end:
        received = []
        while port.send(numbered(number)):
            received.append(numbered(number))
            number += 1
            time.sleep(0.0005)
        if len(received) > least:
            return received
        time.sleep(0.01)
    raise AssertionError("it took all")


def text(frame: Frame) -> bytes:
    return b"t%03X8%s\r" % (frame.can_id, frame.data.hex().upper().encode())


# -- frames --------------------------------------------------------------------------------------


def test_frames_that_had_no_room_are_reported_once(
    line: SerialLine, faults: list[FrameFault], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(apart, "MOST_RECEIVED", 3)
    config = Bus(interface="slcan", channel=line.path, options={"sleep_after_open": 0.0})
    port: Any = open_port("crane", config, faults.append)
    line.write(b"".join(text(numbered(n)) for n in range(5)))
    until(lambda: port._bus.lost == 2)
    assert list(port.frames()) == [numbered(n) for n in (2, 3, 4)]
    assert faults == [FrameFault.FRAMES_LOST]
    assert list(port.frames()) == []
    assert faults == [FrameFault.FRAMES_LOST]
    port.close()


def test_frames_of_slcan_pass_both_ways(
    slcan: Port, line: SerialLine, faults: list[FrameFault]
) -> None:
    assert slcan.send(FRAME)
    until(lambda: text(FRAME) in line.read())
    line.write(b"t1108010203040506")
    line.write(b"0708\rT0000011011F\r")
    frames: list[Frame] = []
    until(lambda: frames.extend(slcan.frames()) or len(frames) == 2)
    assert frames == [FRAME, Frame("crane", 0x110, True, b"\x1f")]
    assert faults == [], "none is lost"


def test_frames_of_socketcand_pass_both_ways(socketcand: Port, server: Socketcand) -> None:
    assert socketcand.send(FRAME)
    until(lambda: server.frames)
    assert server.frames == ["send 110 8 1 2 3 4 5 6 7 8"]
    server.send(0x110, FRAME.data)
    frames: list[Frame] = []
    until(lambda: frames.extend(socketcand.frames()) or frames)
    assert frames == [FRAME]


def test_frames_of_a_serial_line_pass_and_none_holds_the_loop(line: SerialLine) -> None:
    """Its ``recv(0)`` waits for the time-out of the line."""
    config = Bus(interface="serial", channel=line.path, options={"timeout": 3600.0})
    port = open_port("crane", config, lambda _: None)
    assert list(port.frames()) == []
    line.write(b"\xaa\0\0\0\0\x01\x10\1\0\0\x05\xbb")
    frames: list[Frame] = []
    until(lambda: frames.extend(port.frames()) or frames)
    assert frames == [Frame("crane", 0x110, False, b"\5")]
    port.close()


def test_a_descriptor_is_readable_when_a_frame_waits(slcan: Port, line: SerialLine) -> None:
    assert select([slcan.fileno()], [], [], 0)[0] == []
    line.write(b"t1101FF\r")
    assert select([slcan.fileno()], [], [], 30.0)[0]
    assert [frame.data for frame in slcan.frames()] == [b"\xff"]
    assert list(slcan.frames()) == []
    assert select([slcan.fileno()], [], [], 0)[0] == []


def test_a_frame_is_never_younger_than_it_is(slcan: Port, line: SerialLine) -> None:
    for _ in range(20):
        before_ns = boottime_ns()
        line.write(b"t1101FF\r")
        written_ns = boottime_ns()
        until(lambda: list(slcan.frames()))
        assert slcan.arrived_ns <= written_ns
        assert slcan.arrived_ns > before_ns - 1_000_000_000


# -- a line that takes nothing -------------------------------------------------------------------


def test_a_blocked_serial_line_is_seen_and_nothing_of_it_comes_later(
    slcan: Port, line: SerialLine, faults: list[FrameFault]
) -> None:
    line.read()
    received = fill(slcan, least=2 * THEIR_BYTES // len(text(FRAME)))
    assert slcan.state is BusState.NOT_CONFIRMED
    reported = len(faults)
    assert not slcan.send(FRAME), "held for a while"
    assert faults == [FrameFault.NOT_CONFIRMED] * reported, "reported once"
    until(lambda: slcan.send(FRAME._replace(can_id=0x333)))
    until(lambda: b"t3338" in line.read())
    # The other end of a pseudo-terminal has a buffer of its own, as an adapter has.
    late = [one for one in received if text(one) in line.text]
    assert len(late) <= THEIR_BYTES // len(text(FRAME)), "what the kernel had queued is dropped"
    assert text(FRAME) not in line.text
    line.write(b"t1101FF\r")
    until(lambda: list(slcan.frames()))
    until(lambda: line.read() and slcan.send(FRAME) and slcan.state is BusState.UP)


def test_what_comes_from_a_blocked_line_is_no_sign_of_it_taking_any(
    slcan: Port, line: SerialLine
) -> None:
    fill(slcan)
    line.write(b"t1101FF\r")
    until(lambda: list(slcan.frames()))
    assert slcan.state is BusState.NOT_CONFIRMED


def test_a_blocked_connection_is_seen(
    socketcand: Port, server: Socketcand, faults: list[FrameFault]
) -> None:
    server.reads = False
    fill(socketcand)
    assert socketcand.state is BusState.NOT_CONFIRMED
    assert set(faults) == {FrameFault.NOT_CONFIRMED}
    server.reads = True
    until(lambda: socketcand.send(FRAME) and socketcand.state is BusState.UP)


def test_a_port_that_is_blocked_closes(slcan: Port) -> None:
    fill(slcan)
    slcan.close()


def test_what_was_sent_last_leaves_before_the_goodbye(slcan: Port, line: SerialLine) -> None:
    line.read()
    assert slcan.send(FRAME)
    slcan.close()
    assert line.read().endswith(text(FRAME) + b"C\r")


# -- an interface that waits for a sign to go on -------------------------------------------------


class Held:
    """An interface that hands a frame on when the test says so."""

    def __init__(self) -> None:
        self.line: int | None = None
        self.go = threading.Semaphore(0)
        self.begun: list[int] = []
        self.sent: list[int] = []
        self.waiting: list[Any] = []
        self.closed = False
        self.error: Exception | None = None

    def send(self, message: can.Message, timeout: float) -> None:
        assert timeout == LEAVE_NS / 1e9
        self.begun.append(message.data[0])
        self.go.acquire()
        if self.error:
            raise self.error
        self.sent.append(message.data[0])

    def recv(self, _timeout_s: float) -> Any:
        one = self.waiting.pop(0) if self.waiting else None
        if isinstance(one, Exception):
            raise one
        return one

    def fileno(self) -> int:
        if self.line is None:
            raise NotImplementedError
        return self.line

    def shutdown(self) -> None:
        self.closed = True
        raise OSError


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
    made = BusApart(held)  # type: ignore[arg-type]
    yield made
    held.go.release(1000)
    made.shutdown()


def message(value: int, can_id: int = 1) -> can.Message:
    return can.Message(arbitration_id=can_id, is_extended_id=False, data=[value])


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
    with pytest.raises(can.CanTimeoutError):
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


def test_a_backlog_is_bounded(held: Held) -> None:
    held.waiting = [message(n % 256) for n in range(MOST_RECEIVED + 10)]
    bus = BusApart(held)  # type: ignore[arg-type]
    until(lambda: not held.waiting)
    count = 0
    while bus.recv(0):
        count += 1
    assert count == MOST_RECEIVED
    assert bus.lost == 10
    bus.shutdown()
    assert held.closed


def test_an_interface_that_never_returns_is_left_behind(held: Held) -> None:
    bus = BusApart(held)  # type: ignore[arg-type]
    bus.send(message(1))
    until(lambda: held.begun)
    bus.shutdown()
    assert not held.closed
    held.go.release(1)
    until(lambda: held.closed)


def test_a_line_that_is_closed_meanwhile_is_no_end(held: Held) -> None:
    ours, theirs = socket.socketpair()
    held.line = ours.fileno()
    bus = BusApart(held)  # type: ignore[arg-type]
    ours.close()
    theirs.close()
    held.waiting = [message(1)]
    until(lambda: bus.recv(0))
    held.go.release(1)
    bus.shutdown()


def test_where_no_one_says_how_much_waits_nothing_does() -> None:
    assert unsent(-1) == 0
    with suppress(OSError):
        apart.discard_unsent(-1)
