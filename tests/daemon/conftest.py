"""A daemon on ports without a bus, and its log."""

import logging
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import pytest

from tests.daemon.bench import Bench
from tests.daemon.diary import Diary
from tests.daemon.pipes import ANSWER_S, Pipe


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture) -> Callable[..., list[str]]:
    """The lines of the log so far that have a text."""
    caplog.set_level(logging.INFO, "canshaper")

    def lines(what: str = "") -> list[str]:
        said = [(r.levelname, r.getMessage()) for r in caplog.records]
        return [f"{level} {text}" for level, text in said if what in text]

    return lines


@pytest.fixture
def diary(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> Diary:
    return Diary(bench, monkeypatch)


@pytest.fixture
def never_wait() -> Iterator[None]:
    """A handler that blocks, or never comes to an end, is interrupted and fails the test."""

    def hung(_number: int, _frame: FrameType | None) -> None:
        pytest.fail("the handler did not return")  # no OSError: those it catches

    before = signal.signal(signal.SIGALRM, hung)
    signal.alarm(ANSWER_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture
def pipe() -> Iterator[Pipe]:
    opened = Pipe()
    yield opened
    opened.close()
