"""Threads that come before the rest: a browser that draws may not hold up joysticks."""

import contextlib
import os

from canshaper.commissioning.doctor.processes import JOYSTICKS_PRIORITY


def before_the_rest() -> None:
    """Let this thread come after the daemon and before all else, where that is permitted.

    A browser that draws without a graphics card takes every processor, and joysticks that are late
    are a fault. What is started from here does not inherit it.
    """
    with contextlib.suppress(OSError, AttributeError):  # only Linux has it
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(JOYSTICKS_PRIORITY))
