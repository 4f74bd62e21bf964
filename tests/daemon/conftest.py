"""A daemon on ports without a bus, and its log."""

import logging
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.daemon.test_reload import Bench


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    caplog.set_level(logging.INFO, "canshaper")
    return lambda: [f"{r.levelname} {r.getMessage()}" for r in caplog.records]
