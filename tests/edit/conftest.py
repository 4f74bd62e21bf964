"""A deployment file that can be written to."""

from pathlib import Path

import pytest

from tests.edit.edited import FILE


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A copy next to a link to the DBC files: its bytes are those of the shipped one."""
    folder = tmp_path / "config"
    folder.mkdir()
    (tmp_path / "dbc").symlink_to(FILE.parents[1] / "dbc")
    copy = folder / "machine.yaml"
    copy.write_bytes(FILE.read_bytes())
    return copy
