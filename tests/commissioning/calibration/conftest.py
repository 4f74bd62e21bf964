"""A file of a machine that a measurement may write into."""

from pathlib import Path

import pytest

from tests.rigs.files import machine_file


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return machine_file(tmp_path, "forwarder-robust")
