"""How a bus apart is polled: what its receiver does between two reads that bring nothing."""

import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from canshaper.bus import apart
from canshaper.bus.apart import LOOK_S, POLL_S, BusApart
from tests.bus.lines import until
from tests.bus.test_apart_threads import Held, message

READ, SLEPT = "read", ("slept", POLL_S)


class Polled(Held):
    """An interface that notes its reads and the waits between them; ten of these end at once."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[Any] = []
        self.closed_meanwhile: Exception | None = None
        self._bus: BusApart | None = None
        self._reader: threading.Thread | None = None
        self._waits = threading.Semaphore(10)
        self._ended = False

    def recv(self, timeout_s: float) -> Any:
        self._reader = threading.current_thread()
        self.calls.append(READ)
        return super().recv(timeout_s)

    def sleep(self, seconds: float) -> None:
        self._wait(("slept", seconds))

    def select(self, *arguments: Any) -> None:
        self._wait(arguments)
        if self.closed_meanwhile:
            raise self.closed_meanwhile

    def _wait(self, how: tuple[Any, ...]) -> None:
        # Else a thread that another test left behind.
        if threading.current_thread() is self._reader and not self._ended:
            self.calls.append(how)
            self._waits.acquire()

    def first(self, count: int) -> list[Any]:
        """Open it; what is done first."""
        self._bus = BusApart(self)  # type: ignore[arg-type]
        until(lambda: len(self.calls) >= count)
        return self.calls[:count]

    def end(self) -> None:
        self._ended = True
        self._waits.release()
        if self._bus:
            self._bus.shutdown()


@pytest.fixture
def polled(monkeypatch: pytest.MonkeyPatch) -> Iterator[Polled]:
    made = Polled()
    monkeypatch.setattr(apart, "time", SimpleNamespace(sleep=made.sleep))
    monkeypatch.setattr(apart, "select", made.select)
    yield made
    made.end()


def test_an_interface_with_nothing_to_wait_on_is_polled(polled: Polled) -> None:
    assert polled.first(4) == [READ, SLEPT, READ, SLEPT]


@pytest.mark.parametrize("line", [0, 1, 7])
def test_a_line_is_waited_for_until_it_is_looked_at_again(polled: Polled, line: int) -> None:
    """Each descriptor is one, that of a standard stream which the process began without too."""
    polled.line = line
    look = ([line], [], [], LOOK_S)
    assert polled.first(4) == [READ, look, READ, look]


def test_only_a_frame_is_followed_by_a_read_at_once(polled: Polled) -> None:
    """What failed may be readable and fail again, for as long as it is gone."""
    polled.line = 7
    polled.waiting = [message(1), OSError("gone"), message(2)]
    look = ([7], [], [], LOOK_S)
    assert polled.first(6) == [READ, READ, SLEPT, READ, READ, look]


@pytest.mark.parametrize("error", [OSError("bad descriptor"), ValueError("a negative one")])
def test_a_line_that_cannot_be_waited_for_is_polled(polled: Polled, error: Exception) -> None:
    polled.line = 7
    polled.closed_meanwhile = error
    look = ([7], [], [], LOOK_S)
    assert polled.first(6) == [READ, look, SLEPT, READ, look, SLEPT]
