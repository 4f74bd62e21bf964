"""The native lane: this kernel's own vcan in a private network namespace."""

import contextlib
import os
import shlex
import socket
import subprocess
import time

from .job import Job, ip_batch
from .outcome import say
from .owned import owned, strays_ended
from .packages import which
from .watch import Watch

POLL_S = 0.2  # how soon the time limit and the end of the grace are seen
PROBE = (
    "ip link add lane0 type vcan && ip link set lane0 up && ip link del lane0"
    " && ip link add lane0 type vxcan peer name lane1 && ip link del lane0"
)


def namespace() -> list[str]:
    """Return the command prefix that gives a private network namespace; root inside."""
    return ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-Urn"]


def obstacle() -> str | None:
    """Return why this machine has no native lane, or None if it has."""
    if not hasattr(socket, "AF_CAN"):
        return "this Python knows no AF_CAN"
    try:
        # asks the kernel to load its modules, too
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as error:
        return f"the kernel has no AF_CAN sockets ({error.strerror})"
    absent = [tool for tool in ("unshare", "setpriv", "ip") if not which(tool)]
    if absent:
        return f"{', '.join(absent)} not found (Debian packages util-linux, iproute2)"
    probe = subprocess.run(
        [*namespace(), "sh", "-c", f"PATH=$PATH:/usr/sbin:/sbin; {PROBE}"],
        capture_output=True,
        text=True,
        check=False,
    )
    if probe.returncode:
        return f"no vcan or vxcan in a private network namespace ({probe.stderr.strip()})"
    return None


def run(job: Job) -> int:
    """Run the job in this lane; return its exit status."""
    ip = shlex.quote(which("ip") or "ip")
    script = f"{ip} -batch - <<'END' || exit 125\n{ip_batch(())}END\n{job.script('native', ())}"
    begin = time.monotonic()
    with (
        strays_ended(),
        Watch(job.timeout_s, job.grace_s) as watch,
        owned([*namespace(), "sh", "-c", script]) as child,
    ):
        watch.started(lambda number: _signal_group(child, number))
        status = _wait(child, watch)
    if job.verbose:
        say(f"native, {time.monotonic() - begin:.2f} s")
    return status


def _signal_group(child: subprocess.Popen[bytes], number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, number)


def _wait(child: subprocess.Popen[bytes], watch: Watch) -> int:
    while True:
        try:
            code = child.wait(POLL_S)
        except subprocess.TimeoutExpired:
            verdict = watch.verdict()
            if verdict is not None:
                return verdict
        else:
            return watch.status(code if code >= 0 else 128 - code)
