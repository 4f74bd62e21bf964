"""Logs as files, and what is said of a wrong one."""

from pathlib import Path

import pytest

from canshaper.errors import LogError
from canshaper.recording.log import LogFile


def kept(folder: Path, name: str, content: str) -> Path:
    path = folder / name
    path.write_text(content, encoding="utf-8")
    return path


def error_of(path: Path) -> str:
    with pytest.raises(LogError) as error:
        list(LogFile(path))
    return str(error.value)
