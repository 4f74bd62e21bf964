"""A deployment file that can be written to."""

import shutil
from pathlib import Path

import pytest

from tests.edit.edited import FILE


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "dbc").symlink_to(FILE.parents[1] / "dbc")
    (tmp_path / "config").mkdir()
    return Path(shutil.copy(FILE, tmp_path / "config" / "machine.yaml"))
