"""A loop at fixed absolute deadlines on the monotonic clock."""

import time
from collections.abc import Callable


def run_at_deadlines(period_ns: int, body: Callable[[int, int], bool]) -> None:
    """Call ``body`` at every deadline until it returns False.

    The deadlines are fixed in advance, so lateness does not add up. Deadlines that have passed
    are counted and left out, never caught up in a burst.

    Args:
        period_ns: time between two deadlines.
        body: called with the monotonic time and the number of deadlines missed since its last
            call.
    """
    clock = time.monotonic_ns
    deadline = clock()
    missed = 0
    while body(clock(), missed):
        deadline += period_ns
        left = deadline - clock()
        if left > 0:
            time.sleep(left / 1e9)
            missed = 0
        else:
            missed = -left // period_ns
            deadline += missed * period_ns
