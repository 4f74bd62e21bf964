"""Child processes that cannot outlive us, however we end."""

import contextlib
import ctypes
import os
import signal
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

PR_SET_CHILD_SUBREAPER = 36
# End of file on standard input without a line before it: our parent is gone, whatever ended it.
GUARD = 'read -r _ || { kill -9 -- "-$1"; [ -z "$2" ] || rm -rf -- "$2"; }'


@contextlib.contextmanager
def owned(
    argv: Sequence[str],
    *,
    folder: Path | None = None,
    log: IO[bytes] | None = None,
    pass_fds: Sequence[int] = (),
) -> Iterator[subprocess.Popen[bytes]]:
    """Run ``argv`` in a session of its own and end its process group when the context ends.

    Should we be killed without a chance to clean up, the kernel (parent-death signal) ends the
    process and a guard, a shell in yet another session, ends the group and removes ``folder``.
    ``log`` takes standard output and error; without it they are ours. Standard input is empty.
    """
    child = subprocess.Popen(
        ["setpriv", "--pdeathsig", "KILL", *argv],
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=log,
        pass_fds=pass_fds,
        start_new_session=True,
    )
    guard = subprocess.Popen(
        ["sh", "-c", GUARD, "guard", str(child.pid), str(folder or "")],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield child
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()
        guard.communicate(b"done\n")


@contextlib.contextmanager
def strays_ended() -> Iterator[None]:
    """Adopt what the commands run inside leave behind, and end it when the context ends."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, *map(ctypes.c_ulong, (1, 0, 0, 0)))
    try:
        yield
    finally:
        children = Path(f"/proc/self/task/{os.getpid()}/children")
        while pids := children.read_text().split():
            for pid in map(int, pids):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
                with contextlib.suppress(ChildProcessError):
                    os.waitpid(pid, 0)
