"""Any bytes out of the sockets of a port, and any errors of them: no exception, only proper frames.

Unix sockets carry them; the kernel's own never hand over a structure of another size.
"""

import errno
from unittest.mock import patch

from canshaper.bus import interface, raw
from canshaper.codec.frame import BusState, Frame
from tests.bus.raw_line import IDS, OTHER, STATUS, VALVE, Line
from tests.fuzz.frames import Bytes

ERRORS = ("ENODEV", "ENXIO", "EBADF", "ENETDOWN", "ENOBUFS", "EAGAIN", "EINVAL", "EIO", "EPERM")


def run(data: bytes) -> set[BusState]:
    """Do what the bytes say with a port; the states that it came through."""
    source = Bytes(data)
    line = Line(IDS if source.number() & 1 else None)
    seen = {line.port.state}
    with patch.object(raw, "time", line), patch.object(interface, "time", line):
        try:
            while source.left:
                _step(line, source)
                seen.add(line.port.state)
        finally:
            line.end()
    return seen


def _step(line: Line, source: Bytes) -> None:
    kind, number = source.number(), source.number()
    if kind < 80:
        _put(line, number, source.take(kind % 24))
    elif kind < 150:  # of the right size, with a length that is mostly right
        word = source.number(4)
        _put(line, number, raw.CAN_FRAME.pack(word, number >> 4 & 7 or 8, source.take(8)))
    elif kind < 170:
        line.now_ns += source.number(4)
    elif kind < 190:
        error = getattr(errno, ERRORS[number % len(ERRORS)])
        for near in line.near:
            near.fail = OSError(error, "as the bytes say") if kind & 1 else None
        if kind & 1:
            _put(line, number, b"")  # the kernel says of an error that there is something to read
        line.refuse = OSError(errno.ENODEV, "no such device") if kind % 3 == 0 else None
    elif kind < 220:
        assert line.port.send((VALVE, OTHER, STATUS)[number % 3]) in (True, False)
        line.sent()
    else:
        _receive(line)


def _put(line: Line, number: int, data: bytes) -> None:
    try:
        line.far[number % len(line.far)].send(data)
    except OSError:  # the queue is full, or the port has closed its end
        _receive(line)


def _receive(line: Line) -> None:
    for frame in line.received():
        _check(frame)


def _check(frame: Frame) -> None:
    assert frame.bus == "crane", frame
    assert 0 <= frame.can_id < (1 << 29 if frame.extended else 1 << 11), frame
    assert len(frame.data) <= 8, frame
