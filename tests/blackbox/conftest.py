"""A daemon whose ticks the test makes."""

import logging
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.blackbox import keeper
from tests.blackbox.driven import SECOND, TRIP, drive
from tests.daemon.bench import Bench


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


@pytest.fixture
def box(bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A black box, written after a trip."""
    monkeypatch.setattr(keeper, "STATE_NS", 10**9)
    folder = tmp_path / "boxes"
    folder.mkdir()
    drive(bench, folder, TRIP + 8 * SECOND)
    (path,) = folder.iterdir()
    return path


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    caplog.set_level(logging.INFO, "canshaper")
    return lambda: [r.getMessage() for r in caplog.records if "black-box" in r.getMessage()]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "boxes"
