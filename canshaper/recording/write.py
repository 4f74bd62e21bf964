"""A replay as a log of its own, which can be replayed again."""

from collections.abc import Collection, Mapping
from typing import TextIO

from canshaper.codec.frame import Frame
from canshaper.codec.layout import CLASSICAL_BYTES
from canshaper.machine.routing import Key
from canshaper.recording.ticks import Result, Tick


class LogWriter:
    """Writes what was received and what was sent, as ``candump -L`` does.

    Args:
        file: where to.
        channel_of: channel by bus.
        fd: messages of CAN FD; what is longer than classical frames is one, too.
    """

    def __init__(
        self, file: TextIO, channel_of: Mapping[str, str], fd: Collection[Key] = ()
    ) -> None:
        self._file, self._fd = file, fd
        # A log without channels gets the names of the buses.
        self._channel_of = {bus: channel or bus for bus, channel in channel_of.items()}
        self._last_ns = 0

    def write(self, tick: Tick, result: Result) -> None:
        """Write one tick; its others are without a time of their own."""
        for time_ns, frame in tick.received:
            self._line(time_ns, frame)
        for frame in tick.others:
            self._line(self._last_ns, frame)
        for frame in result.sent:
            self._line(tick.now_ns, frame)

    def _line(self, time_ns: int, frame: Frame) -> None:
        self._last_ns = time_ns = max(time_ns, self._last_ns)
        seconds, ns = divmod(time_ns, 10**9)
        can_id = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
        channel = self._channel_of[frame.bus]
        fd = "#0" if frame[:3] in self._fd or len(frame.data) > CLASSICAL_BYTES else ""
        data = f"{fd}{frame.data.hex().upper()}"
        self._file.write(f"({seconds}.{ns // 1000:06d}) {channel} {can_id}#{data}\n")
