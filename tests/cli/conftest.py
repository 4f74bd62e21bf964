"""Deployments for the command line, and a machine without a bus."""

from pathlib import Path
from typing import Any

import can
import pytest

from tests.cli.invocation import SHIPPED
from tests.rigs.files import machine_file


@pytest.fixture
def broken(tmp_path: Path) -> Path:
    changes = ("tick_ms: 20", "tick_ms: 0"), ("kind: off", "kind: x")
    return machine_file(tmp_path, SHIPPED, *changes)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Every attempt to open a bus; none succeeds."""
    attempts: list[dict[str, Any]] = []

    def refuse(**options: Any) -> None:
        attempts.append(options)
        raise OSError("no such device")

    monkeypatch.setattr(can, "Bus", refuse)
    return attempts
