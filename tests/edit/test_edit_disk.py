"""Values written into a deployment file: whole, or not at all."""

import os
from pathlib import Path

import pytest

from canshaper.edit.edit import change
from canshaper.errors import ConfigError
from tests.edit.edited import NEW, SLEW


def test_a_directory_that_cannot_be_written(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As root every directory can be written, so the refusal is put in where it would come up."""
    before = file.read_bytes()
    file.parent.chmod(0o555)
    if os.geteuid() == 0:

        def refuse(**_options: object) -> None:
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr("canshaper.edit.edit.tempfile.mkstemp", refuse)
    try:
        with pytest.raises(ConfigError, match="not written, the file is as it was: Permission"):
            change(file, [(SLEW, NEW, "")])
    finally:
        file.parent.chmod(0o755)
    assert file.read_bytes() == before


@pytest.mark.parametrize("step", ["os.fsync", "Path.replace"])
def test_a_disk_that_fails_on_the_way(
    file: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    before = file.read_bytes()

    def fail(*_arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(f"canshaper.edit.edit.{step}", fail)
    with pytest.raises(ConfigError, match="No space left on device"):
        change(file, [(SLEW, NEW, "")])
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


def test_a_file_changed_meanwhile_is_left_alone(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fsync = os.fsync

    def someone_else(number: int) -> None:
        fsync(number)
        file.write_text("tick_ms: 10\n")

    monkeypatch.setattr("canshaper.edit.edit.os.fsync", someone_else)
    with pytest.raises(ConfigError, match="changed by someone else"):
        change(file, [(SLEW, NEW, "")])
    assert file.read_text() == "tick_ms: 10\n"


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        change(tmp_path / "none.yaml", [(SLEW, NEW, "")])
