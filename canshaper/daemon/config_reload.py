"""Reads a deployment in a process of its own, so that the control loop never waits for it.

The process may take only so much memory and time: docs/decisions.md#the-loop-waits-for-no-one.
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

# Ten times what the largest deployment takes that is allowed (canshaper.config.source and
# canshaper.machine say how large), on a PC that is ten times as slow as today's.
MOST_CPU_S = 20
MOST_S = 60.0  # by the clock: it runs behind the loop and all else
MOST_BYTES = 140 << 20  # more than the daemon has, which it shares with it


class ConfigReload:
    """A deployment that is being read.

    Args:
        load: reads and checks the deployment; called in the other process.

    Raises:
        OSError: there can be no process now.
    """

    def __init__(self, load: Callable[[], Deployment]) -> None:
        self._until_s = time.monotonic() + MOST_S
        # In memory; it takes everything at once, unlike a pipe.
        self._file = os.fdopen(os.memfd_create("deployment"), "w+b")
        try:
            self._pid = os.fork()
        except OSError:
            self._file.close()
            raise
        if self._pid == 0:
            _read(load, self._file)

    def result(self) -> Deployment | str | None:
        """The deployment, or why there is none, line by line; None while it is being read."""
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
        """Give it up; not after a result."""
        os.kill(self._pid, signal.SIGKILL)
        os.waitpid(self._pid, 0)
        self._file.close()


def _read(load: Callable[[], Deployment], file: BinaryIO) -> NoReturn:
    """The other process: leaves the daemon's buses and log alone."""
    status = 1
    try:
        _bound()
        with suppress(OSError):  # with the loop's priority it could keep it from the processor
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        file.write(pickle.dumps(_result(load)))
        file.flush()
        status = 0
    finally:
        os._exit(status)


def _bound() -> None:
    """Limit memory and time of this process."""
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
    except Exception as error:  # a fault of ours in reading must not end what runs
        return f"{type(error).__name__}: {error}"
