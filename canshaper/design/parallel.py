"""Many independent jobs on the processors of this machine."""

import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from threading import current_thread, main_thread
from typing import Generic, TypeVar

from canshaper.design.processes import end_with_parent
from canshaper.errors import CampaignError

# A piece whose process dies so often is what kills it.
MOST_DEATHS = 3
# Time until Ctrl-C is seen, s.
WAIT_S = 0.2
# A process of the pool is a child of the one that began it, on every Python.
_CONTEXT = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")

J = TypeVar("J")
R = TypeVar("R")


class _Queue(Generic[J]):
    """The jobs still to do, each with the number of deaths of its process."""

    def __init__(self, jobs: Iterable[J]) -> None:
        self._jobs = iter(jobs)
        self._again: deque[tuple[J, int]] = deque()

    def take(self) -> tuple[J, int] | None:
        """Return the next job and its number of deaths; None if no job is left."""
        if self._again:
            return self._again.popleft()
        return next(((job, 0) for job in self._jobs), None)

    def put_back(self, job: J, deaths: int) -> None:
        """Put back a job whose process died; raise CampaignError if it died too often."""
        if deaths + 1 >= MOST_DEATHS:
            raise CampaignError(f"the process died {MOST_DEATHS} times of {job}")
        self._again.append((job, deaths + 1))


@dataclass
class Processes:
    """A pool of processes of this machine.

    Attributes:
        count: number of processes; by default one a processor. 1: in the calling process.
    """

    count: int | None = None

    def run(self, work: Callable[[J], R], jobs: Iterable[J]) -> Iterator[tuple[J, R]]:
        """Do every job once; yield each job with its result, in any order.

        An interrupt ends it and its processes at once.

        Args:
            work: function to call with each job: one of a module, or a ``functools.partial`` of it.
            jobs: taken one by one, a few more than are being done.

        Raises:
            CampaignError: the process of one job died again and again.
        """
        if self.count == 1:
            yield from ((job, work(job)) for job in jobs)
            return
        queue, ends = _Queue(jobs), False
        with _interrupt_seen() as interrupted:
            while not ends:
                with ProcessPoolExecutor(
                    self.count, _CONTEXT, initializer=_begin, initargs=(os.getpid(),)
                ) as pool:
                    try:
                        ends = yield from self._drain(pool, work, queue, interrupted)
                    except BaseException:
                        for process in multiprocessing.active_children():
                            process.kill()  # a forked process may have a handler for SIGTERM
                        pool.shutdown(cancel_futures=True)
                        raise

    def _drain(
        self,
        pool: ProcessPoolExecutor,
        work: Callable[[J], R],
        queue: _Queue[J],
        interrupted: Callable[[], bool],
    ) -> Generator[tuple[J, R], None, bool]:
        """Do all jobs, yield results; return False if a process died, which ends the whole pool."""
        doing: dict[Future[R], tuple[J, int]] = {}
        ahead, dead = 2 * (self.count or multiprocessing.cpu_count()), False
        while True:
            while not dead and len(doing) < ahead and (item := queue.take()):
                try:
                    doing[pool.submit(work, item[0])] = item
                except BrokenProcessPool:
                    queue.put_back(item[0], item[1] - 1)  # this job never began
                    dead = True
            if not doing:
                return not dead
            for future in wait(doing, WAIT_S, FIRST_COMPLETED).done:
                job, deaths = doing.pop(future)
                try:
                    result = future.result()
                except BrokenProcessPool:
                    queue.put_back(job, deaths)
                    dead = True
                else:
                    yield job, result
            if interrupted():
                raise KeyboardInterrupt


@contextmanager
def _interrupt_seen() -> Iterator[Callable[[], bool]]:
    """Give a function that returns whether Ctrl-C came; Ctrl-C then raises no exception.

    An exception within the pool's own lines would leave a lock taken, for which the end of the pool
    then waits for ever. Outside the main thread, and where Ctrl-C is ignored or has a handler, as
    in a background job of a shell, the function always returns False.
    """
    seen = []
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler or current_thread() is not main_thread():
        yield lambda: False
        return
    signal.signal(signal.SIGINT, lambda *_: seen.append(True))
    try:
        yield lambda: bool(seen)
    finally:
        signal.signal(signal.SIGINT, before)


def _begin(parent: int) -> None:
    """Set up a process of the pool, and end it if the process ``parent`` has ended already."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all; the parent ends this one
    end_with_parent(signal.SIGKILL)  # the parent may have no time to end it
    # Not by the pipe of multiprocessing: a sibling that was forked later holds its other end too.
    if os.getppid() != parent:
        sys.exit(1)
