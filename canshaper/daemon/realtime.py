"""Requests of a control loop to interpreter and kernel: memory, priority, rights."""

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
# linux/capability.h; to read and write files of others, to lock memory, to set a priority.
CAP_CHOWN, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH, CAP_FOWNER = 0, 1, 2, 3
CAP_IPC_LOCK, CAP_SYS_NICE = 14, 23
NEEDED = CAP_CHOWN, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH, CAP_FOWNER, CAP_IPC_LOCK, CAP_SYS_NICE
CAPABILITY_VERSION_3 = 0x20080522


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


def take_priority(priority: int) -> None:
    """Run this thread by SCHED_FIFO from now on, not its children; log why where it may not."""
    try:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except OSError as error:
        log.warning("priority=ordinary (%s)", error.strerror)


def drop_capabilities() -> None:
    """Give up the rights of root that a control loop does not need.

    With those over the network the kernel would look for a module for each interface that is
    missing; to set up a bus or a route is not the daemon's.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    permitted = int(status.partition("CapPrm:")[2].split()[0], 16)
    kept = permitted & sum(1 << one for one in NEEDED)
    header = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION_3, 0)
    ctypes.CDLL(None).capset(header, (ctypes.c_uint32 * 6)(kept, kept))


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
