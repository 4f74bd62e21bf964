"""Logs for tests, written by python-can."""

from collections.abc import Iterable
from pathlib import Path

import can

from canshaper.recording.log import TimedFrame


def messages(frames: Iterable[TimedFrame], first: int = 0) -> list[can.Message]:
    """As python-can has them; channels that are numbers count from ``first``."""
    return [
        can.Message(
            timestamp=f.time_ns / 1e9,
            channel=int(f.channel) - first if f.channel.isdigit() else f.channel,
            arbitration_id=f.can_id,
            is_extended_id=f.extended,
            data=f.data,
        )
        for f in frames
    ]


def written(path: Path, frames: Iterable[can.Message]) -> Path:
    """The log, by the writer of its suffix."""
    with can.Logger(path) as writer:
        for frame in frames:
            writer.on_message_received(frame)
    return path
