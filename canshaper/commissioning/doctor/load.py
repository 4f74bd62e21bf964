"""Other work of a machine PC at ordinary priority: processes that keep it busy."""

import os
import tempfile
import time
from collections.abc import Callable
from typing import Any

from canshaper.commissioning.doctor.processes import say_ready

BLOCK_BYTES = 16 << 20
# Written again and again at the same place: no disk fills up.
WRITE_BYTES = 64 << 10
WRITES = 64
NAP_S = 50e-6


def _busy() -> None:
    sum(range(10_000))


def _memory() -> None:
    """Take memory, touch all of it, give it back."""
    block = bytearray(b"\1") * BLOCK_BYTES
    block.reverse()


def _disk() -> None:
    block = os.urandom(WRITE_BYTES)
    with tempfile.TemporaryFile() as file:  # has no name: nothing stays when we are killed
        while True:
            file.seek(0)
            for _ in range(WRITES):
                file.write(block)
                file.flush()
                os.fsync(file.fileno())


def _timers() -> None:
    time.sleep(NAP_S)


KINDS: dict[str, Callable[[], None]] = {
    "busy": _busy,
    "memory": _memory,
    "disk": _disk,
    "timers": _timers,
}


def load_kinds() -> list[str]:
    """Processes of the load: a busy one for each processor, and one of each other kind."""
    return ["busy"] * len(os.sched_getaffinity(0)) + ["memory", "disk", "timers"]


def main(options: dict[str, Any]) -> None:
    """Be one of them until killed."""
    step = KINDS[options["kind"]]
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    say_ready()
    while True:
        step()
