"""A daemon whose ticks the test makes."""

from pathlib import Path

import pytest

from tests.daemon.bench import Bench


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)
