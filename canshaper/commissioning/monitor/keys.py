"""Keys of the monitor: pause, one axis, end."""

import os
import select
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

HELP = "p pause, a axis, q end"


class Keys:
    """What a person has pressed.

    Args:
        axes: their names, in the order in which they are chosen.

    Attributes:
        paused: whether the picture stands still; listening goes on.
        axis: the only one that is shown; None for all.
        ended: whether it is enough.
    """

    def __init__(self, axes: Sequence[str]) -> None:
        self._choices: list[str | None] = [None, *axes]
        self.paused = False
        self.axis: str | None = None
        self.ended = False

    def press(self, pressed: str) -> None:
        """Take keys, in order; others do nothing."""
        for key in pressed:
            if key in "p ":
                self.paused = not self.paused
            elif key == "a":
                after = self._choices.index(self.axis) + 1
                self.axis = self._choices[after % len(self._choices)]
            elif key == "q":
                self.ended = True


@contextmanager
def pressed_keys() -> Iterator[bool]:
    """Let keys come one by one, without echo; yields whether they can come at all."""
    try:
        import termios  # noqa: PLC0415  # not everywhere
        import tty  # noqa: PLC0415
    except ModuleNotFoundError:
        yield False
        return
    if not sys.stdin or not sys.stdin.isatty():
        yield False
        return
    file = sys.stdin.fileno()
    before = termios.tcgetattr(file)
    tty.setcbreak(file)
    try:
        yield True
    finally:
        termios.tcsetattr(file, termios.TCSADRAIN, before)


def waiting() -> str:
    """Keys that wait."""
    file = sys.stdin.fileno()
    if not select.select([file], [], [], 0.0)[0]:
        return ""
    return os.read(file, 64).decode("utf-8", "replace")
