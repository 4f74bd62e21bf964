"""Logs as files, lines of candump with their frames, and what a reader makes of them."""

from pathlib import Path

from canshaper.errors import LogError
from canshaper.recording.log import LogFile, TimedFrame

FRAMES = [
    TimedFrame(1_000_000_000, "1", 0x110, False, bytes(range(8))),
    TimedFrame(1_000_250_000, "1", 0x110, True, b"\x01"),
    TimedFrame(1_019_999_000, "2", 0x1ABCDEF0, True, b""),
    TimedFrame(1_020_000_000, "1", 0x7FF, False, b"\xff\x00\xfe"),
    TimedFrame(2_500_001_000, "2", 0x0, False, b"\x80" * 8),
]
LINES = [
    "(1.000000) can0 110#0001020304050607\n",
    "(1.000250) can0 00000110#01\n",
    "(1.019999) can1 1ABCDEF0#\n",
    "(1.020000) can0 7FF#FF00FE\n",
    "(2.500001) can1 000#8080808080808080\n",
]
HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data\n"


def kept(folder: Path, name: str, content: str) -> Path:
    """Write a log; line ends stay as they are."""
    path = folder / name
    path.write_text(content, encoding="utf-8", newline="")
    return path


def log(tmp_path: Path, *lines: str, name: str = "a.log") -> Path:
    return kept(tmp_path, name, "".join(lines))


def prefix(path: Path) -> tuple[list[TimedFrame], LogError | None]:
    """Frames of a log until it ends or is wrong."""
    frames: list[TimedFrame] = []
    try:
        frames.extend(LogFile(path))  # keeps what came before the error
    except LogError as error:
        return frames, error
    return frames, None


def error_of(path: Path) -> str:
    error = prefix(path)[1]
    assert error is not None
    return str(error)
