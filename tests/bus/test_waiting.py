"""Reading a bus of python-can whose interface raises errors in the place of frames."""

import can
import pytest

from canshaper.bus.python_can import receive, waiting

FRAME = can.Message(arbitration_id=0x110, data=b"\1")


class Interface:
    """An interface that hands out or raises what it is given; it keeps a line, as slcan does."""

    def __init__(self, *given: can.Message | Exception | None) -> None:
        self.given = [*given]
        self._buffer = bytearray(b"t110\xff")

    def recv(self, _timeout_s: float | None) -> can.Message | None:
        one = self.given.pop(0)
        if isinstance(one, Exception):
            raise one
        return one


def garbled() -> Exception:
    """As slcan raises it, of the line that it keeps."""
    error = can.CanOperationError("no text")
    error.__cause__ = UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte")
    return error


def test_an_error_stands_in_the_place_of_a_frame_and_the_next_one_is_read() -> None:
    lost = OSError("lost")
    interface = Interface(FRAME, lost, FRAME, None, FRAME)
    assert [*waiting(interface, 100)] == [FRAME, lost, FRAME, None]
    assert interface.given == [FRAME]


def test_no_more_is_read_than_is_asked_for() -> None:
    assert [*waiting(Interface(*[FRAME] * 5), 3)] == [FRAME] * 3


def test_a_line_that_is_no_text_is_not_read_again() -> None:
    interface = Interface(garbled())
    with pytest.raises(can.CanOperationError):
        receive(interface)
    assert interface._buffer == b""


def test_another_error_leaves_what_an_interface_keeps() -> None:
    interface = Interface(OSError("lost"))
    with pytest.raises(OSError, match="lost"):
        receive(interface)
    assert interface._buffer == b"t110\xff"
