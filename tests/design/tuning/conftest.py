"""A deployment file that can be written to."""

import shutil
from pathlib import Path

import pytest

from tests.edit.edited import FILE


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return Path(shutil.copy(FILE, tmp_path / "machine.yaml"))
