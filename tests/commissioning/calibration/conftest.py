"""A file of a machine that a measurement may write into."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    text = (ROOT / "config/forwarder-robust.yaml").read_text(encoding="utf-8")
    (copy := tmp_path / "machine.yaml").write_text(text.replace("../dbc", str(ROOT / "dbc")))
    return copy
