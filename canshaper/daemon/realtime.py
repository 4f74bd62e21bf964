"""Requests of a control loop to interpreter and kernel: no surprises from memory.

The scheduling policy is set from outside (``CPUSchedulingPolicy=`` of the unit, ``chrt``).
"""

import ctypes
import gc
import os
import resource

# sys/mman.h and linux/prctl.h
MCL_CURRENT, MCL_FUTURE = 1, 2
PR_SET_THP_DISABLE = 41


class Collector:
    """The garbage collector under control: never by itself, and never over the whole heap.

    What is there at the start is frozen; what the loop leaves behind is little and looked through
    in a pause of the loop.
    """

    # The loop makes no cycles, only faults do, some kB each.
    PERIOD_NS = 5_000_000_000

    def __init__(self) -> None:
        self._next_ns = 0

    def freeze(self) -> None:
        """Collect what is not frozen yet, and let it be from now on.

        To look through what was frozen before would take longer than a tick. So a reload must
        leave no cycles of the old deployment behind; the end of its references ends it.
        """
        gc.collect()
        gc.freeze()
        gc.disable()

    def pause(self, now_ns: int) -> None:
        """Collect what came since the start, now and then, while the loop has time."""
        if now_ns >= self._next_ns:
            self._next_ns = now_ns + self.PERIOD_NS
            gc.collect()
            gc.disable()  # a library may have switched it on


def refuse_huge_pages() -> None:
    """Keep the kernel from joining pages of this process to huge ones.

    Its khugepaged does that behind every process's back, 2 MiB at a time: on the same processor it
    cannot be interrupted meanwhile, by no priority, and on another one it keeps the process from
    its memory. A kernel without huge pages has nothing to refuse.
    """
    ctypes.CDLL(None).prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0)


def lock_memory() -> str | None:
    """Keep all memory of the process in RAM; None, or why it could not be done.

    Not tried below an unlimited RLIMIT_MEMLOCK: memory needed later would then be refused.
    """
    soft, _hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if soft != resource.RLIM_INFINITY and os.geteuid() != 0:
        return "RLIMIT_MEMLOCK is not unlimited"
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
        return None
    return os.strerror(ctypes.get_errno())
