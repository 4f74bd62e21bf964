"""How a bus apart is polled: the waits of its receiver, and since when a frame may have waited."""

import os
import pty
import socket
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import can
import pytest

from canshaper.bus import apart
from canshaper.bus.apart import LOOK_S, POLL_S, BusApart, ended
from canshaper.bus.python_can import receive
from tests.bus.held import Held, message
from tests.bus.lines import until

READ, SLEPT, FAILED = "read", ("slept", POLL_S), OSError("gone")
LINE = 7
SEEN, LOOK = ([LINE], [], [], 0.0), ([LINE], [], [], LOOK_S)


class Polled(Held):
    """An interface that notes its reads and the waits between them; twenty of these end at once."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[Any] = []
        self.readable: list[bool] = []
        self.closed_meanwhile: Exception | None = None
        self.now_ns = 1000
        self.bus: BusApart | None = None
        self._reader: threading.Thread | None = None
        self._waits = threading.Semaphore(20)
        self._ended = False

    def recv(self, timeout_s: float) -> Any:
        self.calls.append(READ)
        return super().recv(timeout_s)

    def sleep(self, seconds: float) -> None:
        self._wait(("slept", seconds))

    def select(self, *arguments: Any) -> tuple[list[int], list[int], list[int]]:
        self._wait(arguments)
        self.now_ns += 1
        if self.closed_meanwhile:
            raise self.closed_meanwhile
        readable = arguments[3] == 0 and bool(self.readable) and self.readable.pop(0)
        return arguments[0] if readable else [], [], []

    def _wait(self, how: tuple[Any, ...]) -> None:
        # Else a thread that another test left behind.
        self._reader = self._reader or threading.current_thread()
        if threading.current_thread() is self._reader and not self._ended:
            self.calls.append(how)
            self._waits.acquire()

    def first(self, count: int) -> list[Any]:
        """Open it; what is done first."""
        self.bus = BusApart(self, receive)  # type: ignore[arg-type]
        until(lambda: len(self.calls) >= count)
        return self.calls[:count]

    def end(self) -> None:
        self._ended = True
        self._waits.release()
        if self.bus:
            self.bus.shutdown()


@pytest.fixture
def polled(monkeypatch: pytest.MonkeyPatch) -> Iterator[Polled]:
    made = Polled()
    monkeypatch.setattr(apart, "time", SimpleNamespace(sleep=made.sleep))
    monkeypatch.setattr(apart, "select", made.select)
    monkeypatch.setattr(apart, "boottime_ns", lambda: made.now_ns)
    monkeypatch.setattr(apart, "ended", lambda _: False)
    yield made
    made.end()


def test_an_interface_with_nothing_to_wait_on_is_polled(polled: Polled) -> None:
    assert polled.first(6) == [("slept", 0.0), READ, SLEPT] * 2


@pytest.mark.parametrize("line", [0, 1, LINE])
def test_a_line_is_waited_for_until_it_is_looked_at_again(polled: Polled, line: int) -> None:
    """Each descriptor is one, that of a standard stream which the process began without too."""
    polled.line = line
    look = ([line], [], [])
    assert polled.first(6) == [(*look, 0.0), READ, (*look, LOOK_S)] * 2


def test_what_is_no_frame_is_followed_by_a_read_at_once(polled: Polled) -> None:
    """Answers of an adapter, faster than it could be polled. What failed may fail for ever."""
    polled.line = LINE
    polled.waiting = [message(1), FAILED, None, message(2)]
    polled.readable = [True] * 4
    expected = [SEEN, READ, SEEN, READ, SLEPT, SEEN, READ, SEEN, READ, SEEN, READ, LOOK]
    assert polled.first(12) == expected


@pytest.mark.parametrize("error", [OSError("bad descriptor"), ValueError("a negative one")])
def test_a_line_that_cannot_be_waited_for_is_polled(polled: Polled, error: Exception) -> None:
    polled.line, polled.closed_meanwhile = LINE, error
    assert polled.first(5) == [SEEN, ("slept", 0.0), READ, LOOK, SLEPT]


@pytest.mark.parametrize(
    ("readable", "brought", "since_ns"),
    [
        ([], [None], 1002),  # it was empty
        ([False, True], [None], 1000),  # bytes of which no frame came: one may wait behind them
        ([False, True], [FAILED], 1000),
        ([], [FAILED], 1000),
        ([False, True, True], [message(1)], 1000),
    ],
)
def test_a_line_was_empty_where_it_had_nothing_to_read_and_brought_none(
    polled: Polled, readable: list[bool], brought: list[Any], since_ns: int
) -> None:
    """Else a frame that waited behind an answer through a long stall would pass as new."""
    polled.line, polled.readable = LINE, [*readable]
    polled.waiting = [None, *brought, message(2)]
    polled.first(9)
    frames: list[Any] = []

    def last() -> bool:
        assert polled.bus
        try:
            frames.append(polled.bus.recv(0))
        except OSError:
            return False
        return frames[-1] is not None and frames[-1].data == b"\2"

    until(last)
    assert polled.bus
    assert polled.bus.since_ns == since_ns


def test_a_connection_that_has_ended_has_failed(
    polled: Polled, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(apart, "ended", lambda line: line == LINE)
    polled.line, polled.readable = LINE, [True]
    assert polled.first(3) == [SEEN, READ, SLEPT]
    assert polled.bus
    with pytest.raises(can.CanOperationError, match=r"^the connection was closed at its other end"):
        polled.bus.recv(0)


def test_only_a_connection_that_was_closed_has_ended() -> None:
    ours, theirs = socket.socketpair()
    ends = os.pipe(), pty.openpty()
    assert not ended(ours.fileno())
    theirs.send(b"x")
    theirs.close()
    assert not ended(ours.fileno()), "not before all of it is read"
    assert ours.recv(2) == b"x", "it was not read, nor closed"
    assert ended(ours.fileno())
    ours.close()
    for reader, writer in ends:
        os.close(writer)
        assert not ended(reader), "its interface reports that by itself"
        os.close(reader)
