"""Adapters whose calls block: slcan and serial on a pseudo-terminal, socketcand on loopback."""

import threading
import time
from collections.abc import Iterator
from select import select
from typing import Any

import pytest

from canshaper.bus import apart
from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.config.bus import Bus
from canshaper.gate.cycle import boottime_ns
from tests.bus.lines import ANSWER_S, THEIR_BYTES, SerialLine, Socketcand, until

FRAME = Frame("crane", 0x110, False, b"\1\2\3\4\5\6\7\x08")


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


# -- frames ----------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("before", [b"", b"\r", b"z\r", b"t1\r"])
def test_a_frame_is_no_younger_behind_bytes_that_are_none(
    slcan: Port, line: SerialLine, monkeypatch: pytest.MonkeyPatch, before: bytes
) -> None:
    """An answer of the adapter, or garbage, after which it waited through a stall."""
    held, go_on = threading.Event(), threading.Event()

    def wait(*arguments: Any) -> Any:
        if arguments[3]:
            held.set()
            assert go_on.wait(ANSWER_S)
        return select(*arguments[:3], 0)

    monkeypatch.setattr(apart, "select", wait)
    assert held.wait(ANSWER_S)
    line.write(before + b"t1101FF\r")
    written_ns = boottime_ns()
    go_on.set()
    until(lambda: list(slcan.frames()))
    assert slcan.arrived_ns <= written_ns


def test_a_connection_that_its_server_closes_has_failed(
    socketcand: Port, server: Socketcand, faults: list[FrameFault]
) -> None:
    """Reading it goes on bringing nothing, as fast as it is read."""
    server.send(0x110, FRAME.data)
    server.hang_up()
    frames: list[Frame] = []
    until(lambda: frames.extend(socketcand.frames()) or socketcand.state is BusState.FAILED)
    assert frames == [FRAME]
    assert set(faults) == {FrameFault.BUS_ERROR}


# -- a line that takes nothing ---------------------------------------------------------------------


def test_a_blocked_serial_line_is_seen_and_nothing_of_it_comes_later(
    slcan: Port, line: SerialLine, faults: list[FrameFault]
) -> None:
    line.read()
    received = fill(slcan, least=2 * THEIR_BYTES // len(text(FRAME)))
    assert slcan.state is BusState.NOT_CONFIRMED
    reported = len(faults)
    assert not slcan.send(FRAME), "held for a while"
    assert faults == [FrameFault.NOT_CONFIRMED] * reported, "reported once"
    # Again and again: on a machine that stands still one becomes too old before it is written.
    another = FRAME._replace(can_id=0x333)
    until(lambda: (slcan.send(another), b"t3338" in line.read())[1])
    # The other end of a pseudo-terminal has a buffer of its own, as an adapter has; and one frame
    # may have been under way into the kernel when that dropped what it had.
    theirs = THEIR_BYTES // len(text(FRAME))
    late = [one for one in received[:-20] if text(one) in line.text]
    # Where the sender was late the newest frame of an id has taken the place of the one before.
    for can_id in {one.can_id for one in late}:
        places = [line.text.index(text(one)) for one in late if one.can_id == can_id]
        assert places == sorted(places)
    assert len(late) <= theirs, "what the kernel had queued is dropped"
    assert sum(text(one) in line.text for one in received[-20:]) <= 1
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


def test_what_was_sent_last_leaves_before_the_goodbye(
    slcan: Port, line: SerialLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(apart, "CLOSE_S", ANSWER_S)  # a busy machine
    line.read()
    assert slcan.send(FRAME)
    slcan.close()
    assert line.read().endswith(text(FRAME) + b"C\r")
