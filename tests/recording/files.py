"""Logs as files, and what is said of a wrong one."""

from pathlib import Path

import pytest

from canshaper.errors import LogError
from canshaper.recording.log import read_log


def kept(folder: Path, name: str, content: str) -> Path:
    path = folder / name
    path.write_text(content, encoding="utf-8")
    return path


def error_of(path: Path) -> str:
    with pytest.raises(LogError) as error:
        list(read_log(path))
    return str(error.value)
