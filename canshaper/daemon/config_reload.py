"""Reads a deployment in a forked process, so that the control loop never waits for it.

Memory and time of that process are limited: docs/decisions.md#the-loop-waits-for-no-one.
"""

import os
import pickle
import resource
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, NoReturn

from canshaper.errors import ConfigError
from canshaper.machine.deployment import Deployment

# Ten times the need of the largest allowed deployment (limits in canshaper.config.source and
# canshaper.machine), on a PC that is ten times as slow as today's.
MOST_CPU_S = 20
MOST_S = 60.0  # wall time: the loop and other programs run first
MOST_BYTES = 140 << 20  # beyond the memory of the daemon, which it shares


class ConfigReload:
    """A deployment that a forked process reads.

    Args:
        load: reads and checks the deployment; called in the forked process.

    Raises:
        OSError: no process can be forked now.
    """

    def __init__(self, load: Callable[[], Deployment]) -> None:
        self._until_s = time.monotonic() + MOST_S
        # A file in memory takes any amount at once; a pipe would block.
        self._file = os.fdopen(os.memfd_create("deployment"), "w+b")
        try:
            self._pid = os.fork()
        except OSError:
            self._file.close()
            raise
        if self._pid == 0:
            _read(load, self._file)

    def result(self) -> Deployment | str | None:
        """Return the deployment, or why it is refused (text of lines); None while it is read.

        After ``MOST_S`` kill the process, and refuse. Not allowed after a result.
        """
        done, status = os.waitpid(self._pid, os.WNOHANG)
        if not done:
            if time.monotonic() < self._until_s:
                return None
            self.end()
            return f"its reader took longer than {MOST_S:g} s"
        with self._file as file:
            file.seek(0)
            data = file.read()
        if status == signal.SIGXCPU:
            return f"its reader took more than {MOST_CPU_S} s of a processor"
        if status:
            return f"its reader ended with status {os.waitstatus_to_exitcode(status)}"
        result = pickle.loads(data)
        assert isinstance(result, Deployment | str)
        return result

    def end(self) -> None:
        """Kill the process; not allowed after a result."""
        os.kill(self._pid, signal.SIGKILL)
        os.waitpid(self._pid, 0)
        self._file.close()


def _read(load: Callable[[], Deployment], file: BinaryIO) -> NoReturn:
    """Read in the forked process, write the result, and exit; touch neither buses nor log."""
    status = 1
    try:
        _bound()
        with suppress(OSError):  # at the priority of the loop, it could hold up the loop
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        file.write(pickle.dumps(_result(load)))
        file.flush()
        status = 0
    finally:
        os._exit(status)


def _bound() -> None:
    """Limit memory and processor time of this process; a crash of it writes no core."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    most = pages * resource.getpagesize() + MOST_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CPU, (MOST_CPU_S, MOST_CPU_S + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _result(load: Callable[[], Deployment]) -> Deployment | str:
    try:
        return load()
    except ConfigError as error:
        return str(error)
    except MemoryError:
        return f"its reader took more than {MOST_BYTES >> 20} MB"
    except Exception as error:  # an error of this program in reading must not end the daemon
        return f"{type(error).__name__}: {error}"
