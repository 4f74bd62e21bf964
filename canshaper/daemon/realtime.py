"""Prepares interpreter and kernel for a control loop: memory, priority, capabilities."""

import ctypes
import gc
import logging
import os
import resource
from pathlib import Path

log = logging.getLogger("canshaper")

# sys/mman.h and linux/prctl.h
MCL_CURRENT, MCL_FUTURE = 1, 2
PR_SET_THP_DISABLE = 41
# linux/capability.h: access to files of other users, locked memory, priorities.
CAP_CHOWN, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH, CAP_FOWNER = 0, 1, 2, 3
CAP_IPC_LOCK, CAP_SYS_NICE = 14, 23
NEEDED = CAP_CHOWN, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH, CAP_FOWNER, CAP_IPC_LOCK, CAP_SYS_NICE
CAPABILITY_VERSION_3 = 0x20080522


class Collector:
    """Runs the garbage collector only in pauses of the loop, and never over the whole heap.

    Objects that exist at the start are frozen. The loop leaves few objects behind, which are
    collected in a pause of the loop.
    """

    # Time between two collections. The loop makes no cycles; only faults do, some kB each.
    PERIOD_NS = 5_000_000_000

    def __init__(self) -> None:
        self._next_ns = 0

    def freeze(self) -> None:
        """Collect the objects that are not frozen, then freeze the rest, and stop the collector.

        To examine the frozen objects again would take longer than a tick. So the old deployment of
        a reload must contain no cycles, and is freed with its last reference.
        """
        gc.collect()
        gc.freeze()
        gc.disable()

    def pause(self, now_ns: int) -> None:
        """Collect the objects made since ``freeze``, every ``PERIOD_NS`` at most."""
        if now_ns >= self._next_ns:
            self._next_ns = now_ns + self.PERIOD_NS
            gc.collect()
            gc.disable()  # a library may have enabled it


def refuse_huge_pages() -> None:
    """Keep the kernel from merging pages of this process into huge pages.

    Its thread khugepaged merges them 2 MiB at a time. On the same processor no priority interrupts
    that; on another processor it blocks the memory of the process meanwhile. A kernel without huge
    pages ignores the request.
    """
    ctypes.CDLL(None).prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0)


def take_priority(priority: int) -> None:
    """Run this thread, but not its children, under SCHED_FIFO; log why if that is not permitted."""
    try:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except OSError as error:
        log.warning("priority=ordinary (%s)", error.strerror)


def drop_capabilities() -> None:
    """Give up the capabilities of root that a control loop does not need.

    With those for the network, the kernel would search for a module for each missing interface.
    The daemon sets up no bus and no route.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    permitted = int(status.partition("CapPrm:")[2].split()[0], 16)
    kept = permitted & sum(1 << one for one in NEEDED)
    header = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION_3, 0)
    ctypes.CDLL(None).capset(header, (ctypes.c_uint32 * 6)(kept, kept))


def lock_memory() -> str | None:
    """Keep all memory of the process in RAM; return None, or why that failed.

    Only root tries it under a limited RLIMIT_MEMLOCK: to others the kernel refuses memory later.
    """
    soft, _hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if soft != resource.RLIM_INFINITY and os.geteuid() != 0:
        return "RLIMIT_MEMLOCK is not unlimited"
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
        return None
    return os.strerror(ctypes.get_errno())
