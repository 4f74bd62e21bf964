"""Frames of messages as they are bound, each the first one of a sender of its own."""

from typing import Any

from canshaper.codec.frame import Frame
from canshaper.codec.status import StatusCodec
from canshaper.codec.velocity import ValveCodec


def command_raw(valve: ValveCodec, steps: int) -> dict[str, Any]:
    """Raw values of a valve message with this command."""
    raw = dict(valve.message.start)
    valve.put(raw, steps)
    return raw


def command_frame(valve: ValveCodec, steps: int = 0) -> Frame:
    """A frame of a valve message with this command."""
    return valve.message.sender().frame(command_raw(valve, steps))


def status_frame(status: StatusCodec[Any], source: Any) -> Frame:
    """A frame of a status message."""
    return status.message.sender().frame(status.values(source))
