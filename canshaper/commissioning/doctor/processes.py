"""Child processes of a measurement, and those that keep the PC busy; none outlives it."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from canshaper.design.processes import end_with_parent
from canshaper.errors import MeasurementError

# The loop has the priority that the service's unit gives it; the joysticks come after it, so that
# they never delay it.
LOOP_PRIORITY = 40
JOYSTICKS_PRIORITY = LOOP_PRIORITY - 1

_CODE = f"import sys; sys.path[:] = {{path!r}}; from {__name__} import be; be()"


READY = "ready"


class Children:
    """Child processes, each a module of this package with a ``main``; none outlives the block."""

    def __init__(self) -> None:
        self._processes: list[subprocess.Popen[str]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for process in self._processes:
            process.kill()
        for process in self._processes:
            process.communicate()

    def start(
        self, module: str, sockets: Mapping[str, int] | None = None, **options: Any
    ) -> subprocess.Popen[str]:
        """Start ``canshaper.commissioning.doctor.MODULE``.

        Args:
            module: its name.
            sockets: file descriptors that it inherits, by the name of the bus.
            options: what its ``main`` gets, with ``sockets``.
        """
        sockets = dict(sockets or {})
        options |= {"module": module, "parent": os.getpid(), "sockets": sockets}
        # Isolated, with the import path of this process, so that it finds the same canshaper.
        path = [str(Path(entry).resolve()) for entry in sys.path]
        flags = ["-I", *(["-B"] if sys.dont_write_bytecode else [])]
        code = _CODE.format(path=path)
        # A Ctrl-C between start and note would leave a child that no one ends.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process = subprocess.Popen(
                [sys.executable, *flags, "-c", code, json.dumps(options)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                pass_fds=tuple(sockets.values()),
                process_group=0,  # Ctrl-C is for the parent, which ends them
            )
            self._processes.append(process)
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        return process


def ready(process: "subprocess.Popen[str]") -> None:
    """Wait until a child prints that it is ready; it prints nothing else before its end.

    Raises:
        MeasurementError: it failed or ended instead.
    """
    assert process.stdout is not None
    if process.stdout.readline().strip() != READY:
        output(process, None)
        raise MeasurementError(f"the measurement failed: {process.args!r} ended")


def output(process: "subprocess.Popen[str]", limit_s: float | None) -> str:
    """Wait until a child ends, at most ``limit_s`` (None: for ever); return its output.

    Raises:
        MeasurementError: it failed.
        TimeoutExpired: it has not ended yet.
    """
    out, err = process.communicate(timeout=limit_s)
    if process.returncode:
        raise MeasurementError(f"the measurement failed: {err.strip() or process.returncode}")
    return out


def be() -> None:
    """Be the child: end with the parent, and call ``main`` of the module with the options."""
    options: dict[str, Any] = json.loads(sys.argv[1])
    end_with_parent(signal.SIGKILL)
    if os.getppid() != options["parent"]:  # the parent ended before that call
        sys.exit(1)
    import_module(f"canshaper.commissioning.doctor.{options['module']}").main(options)


def say_ready() -> None:
    """Signal the parent that the work can begin."""
    print(READY, flush=True)


def real_time(priority: int) -> str | None:
    """Ask for SCHED_FIFO with this priority; return None, or why it is refused."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return error.strerror
    return None


def before_the_rest() -> None:
    """Give this thread the priority just below that of the daemon, where that is permitted.

    A browser that draws without a graphics card keeps every processor busy, and late joysticks are
    a fault. Child processes do not inherit the priority.
    """
    with contextlib.suppress(OSError, AttributeError):  # only Linux has it
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(JOYSTICKS_PRIORITY))


BLOCK_BYTES = 16 << 20
# Written again and again at the same place: no disk fills up.
WRITE_BYTES = 64 << 10
WRITES = 64
NAP_S = 50e-6


def _busy() -> None:
    sum(range(10_000))


def _memory() -> None:
    """Allocate memory, touch all of it, free it."""
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
    """Return the kinds of the load: a busy one for each processor, and one of each other kind."""
    return ["busy"] * len(os.sched_getaffinity(0)) + ["memory", "disk", "timers"]


def main(options: dict[str, Any]) -> None:
    """Run one process of the load until it is killed."""
    step = KINDS[options["kind"]]
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    say_ready()
    while True:
        step()
