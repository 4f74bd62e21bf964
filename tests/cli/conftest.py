"""Deployments for the command line, and a machine without a bus."""

from pathlib import Path
from typing import Any

import can
import pytest

from tests.cli.invocation import ROOT, SHIPPED


@pytest.fixture
def broken(tmp_path: Path) -> Path:
    path = tmp_path / "broken.yaml"
    text = SHIPPED.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc"))
    path.write_text(text.replace("tick_ms: 20", "tick_ms: 0").replace("kind: off", "kind: x"))
    return path


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Every attempt to open a bus; none succeeds."""
    attempts: list[dict[str, Any]] = []

    def refuse(**options: Any) -> None:
        attempts.append(options)
        raise OSError("no such device")

    monkeypatch.setattr(can, "Bus", refuse)
    return attempts
