"""A loop at fixed absolute deadlines, on a clock that no one sets."""

import time
from collections.abc import Callable
from functools import partial

# Time since the machine was booted, ns. No one can set it, and unlike CLOCK_MONOTONIC it goes on
# while the machine is suspended: an age, and a standstill of the loop, includes that time. Other
# systems than Linux only simulate a machine, and there any clock that runs forward serves.
boottime_ns: Callable[[], int] = (
    partial(time.clock_gettime_ns, time.CLOCK_BOOTTIME)
    if hasattr(time, "CLOCK_BOOTTIME")
    else time.monotonic_ns
)


def run_at_deadlines(
    period_ns: int,
    body: Callable[[int, int, int], bool],
    wait: Callable[[float], None] | None = None,
    steer: Callable[[int], int] | None = None,
) -> None:
    """Call ``body`` at every deadline until it returns False.

    A deadline is fixed before the sleep that ends at it, so lateness does not add up. Those that
    have passed are counted and left out, never caught up in a burst.

    Args:
        period_ns: time between two deadlines.
        body: called with the time by ``boottime_ns``, the number of deadlines missed since its
            last call, and how late it is, in ns after the first deadline it has not yet been called
            for.
        wait: lets so many seconds pass; by default it sleeps.
        steer: asked after each call, with where the next deadline would be, by how many ns it is
            to be moved; much less than a period.
    """
    clock = boottime_ns
    deadline = now = clock()
    while True:
        late = now - deadline
        missed = late // period_ns if late > 0 else 0
        deadline += missed * period_ns
        if not body(now, missed, late):
            return
        deadline += period_ns
        if steer:
            deadline += steer(deadline)
        left = deadline - clock()
        if left > 0:
            (wait or time.sleep)(left / 1e9)
        now = clock()
