"""Work for engines: functions of a module, as every process finds them."""

import os
import signal
from pathlib import Path


def square(number: int) -> int:
    return number * number


def fails(number: int) -> int:
    raise ValueError(f"no square of {number}")


def dies_once(marker: Path, number: int) -> int:
    """The process that has number 7 first is killed in the middle of it."""
    if number == 7:
        try:
            marker.touch(exist_ok=False)
        except FileExistsError:
            pass
        else:
            os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def always_dies(number: int) -> int:
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def fails_or_stays(number: int) -> int:
    """Fail with 0; stay, whatever signal comes, with others."""
    while number:
        signal.pause()
    return fails(number)
