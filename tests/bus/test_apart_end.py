"""The end of a bus apart: of its threads, of its descriptors, of what its line has not sent."""

import os
import threading
from collections.abc import Iterator

import pytest

from canshaper.bus import apart
from canshaper.bus.apart import BusApart
from canshaper.bus.python_can import receive
from tests.bus.held import Held, message
from tests.bus.lines import ANSWER_S, THEIR_BYTES, SerialLine, until


class Reading(Held):
    """An interface whose read returns when the test says so."""

    def __init__(self) -> None:
        super().__init__()
        self.reading, self.go_on = threading.Event(), threading.Event()
        self.calls: list[str] = []

    def recv(self, timeout_s: float) -> None:
        self.reading.set()
        self.go_on.wait(ANSWER_S)
        self.calls.append("read")

    def shutdown(self) -> None:
        self.calls.append("closed")


@pytest.fixture
def held() -> Held:
    return Held()


@pytest.fixture
def line() -> Iterator[SerialLine]:
    made = SerialLine()
    yield made
    made.close()


def test_its_threads_do_not_hold_the_process(held: Held) -> None:
    before = threading.enumerate()
    bus = BusApart(held, receive)  # type: ignore[arg-type]
    daemons = [thread.daemon for thread in threading.enumerate() if thread not in before]
    bus.shutdown()
    assert daemons == [True, True]


def test_its_descriptors_are_closed(held: Held) -> None:
    bus = BusApart(held, receive)  # type: ignore[arg-type]
    ends = bus._wake_reader, bus._wake_writer
    assert bus.fileno() == ends[0].fileno() >= 0
    bus.shutdown()
    assert [end.fileno() for end in ends] == [-1, -1]


def test_an_interface_is_closed_once_its_read_has_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    """And is given a while to return: one that never does is closed all the same."""
    monkeypatch.setattr(apart, "CLOSE_S", ANSWER_S)
    reading = Reading()
    bus = BusApart(reading, receive)  # type: ignore[arg-type]
    join, waited_s = bus._receiver.join, []

    def joined(timeout: float | None = None) -> None:
        waited_s.append(timeout)
        reading.go_on.set()
        join(timeout)

    monkeypatch.setattr(bus._receiver, "join", joined)
    assert reading.reading.wait(ANSWER_S)
    bus.shutdown()
    try:
        assert reading.calls == ["read", "closed"]
        assert waited_s == [ANSWER_S]
    finally:
        reading.go_on.set()


@pytest.mark.parametrize("hangs", [False, True])
def test_what_a_line_did_not_send_is_dropped_where_the_interface_hangs(
    held: Held, line: SerialLine, monkeypatch: pytest.MonkeyPatch, hangs: bool
) -> None:
    """It would hold the process until it is sent; else it is what was sent last, and leaves."""
    monkeypatch.setattr(apart, "CLOSE_S", 0.0 if hangs else ANSWER_S)
    held.line, written = line._theirs, THEIR_BYTES + 2000
    bus = BusApart(held, receive)  # type: ignore[arg-type]
    bus.send(message(1))
    until(lambda: held.begun)
    os.write(line._theirs, bytes(written))
    if not hangs:
        held.go.release(1)
    bus.shutdown()
    assert held.closed is not hangs
    os.write(line._theirs, b".")
    until(lambda: line.read().endswith(b"."))
    left = len(line.text) - 1
    assert left <= THEIR_BYTES if hangs else left == written
    held.go.release(1)
    until(lambda: held.closed)
