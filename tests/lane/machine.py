"""The tcg lane: one virtual machine for one command."""

import contextlib
import os
import platform
import select
import selectors
import shutil
import signal
import socket
import tempfile
import time
from pathlib import Path

from . import initramfs, kernel, systemd
from .job import Job
from .outcome import LaneError, NoLane, say
from .owned import owned
from .packages import (
    MACHINE_TOOLS,
    cache_lock,
    cannot_install,
    install,
    install_test_tools,
    missing,
    which,
)
from .qemu import command_line
from .watch import Watch

# Standard output and error apart, both binary-clean; the status on a port of its own, so that a
# crash can never read as success.
PORTS = {"CTL": "/dev/vport0p1", "OUT": "/dev/vport0p2", "ERR": "/dev/vport0p3"}
DESTINATION = {"OUT": 1, "ERR": 2}
POLL_S = 0.2  # how soon the time limits are seen
POWER_OFF_S = 5.0  # from EXIT to the end of qemu; it takes some 10 ms


def obstacle(flavour: str, with_systemd: bool) -> str | None:
    """Return why this machine cannot have a tcg lane, or None if it can (perhaps by installing).

    ``flavour`` is that of the kernel, std or rt.
    """
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        return f"it is for Linux on x86_64, this is {platform.system()} on {platform.machine()}"
    absent = missing(_tools(with_systemd))
    reason = cannot_install()
    if absent and reason:
        return f"please install {' '.join(absent)} ({reason})"
    if kernel.cached(flavour) is None and not (which("apt-get") and which("dpkg-deb")):
        return "a kernel can be fetched on Debian and Ubuntu only (apt-get, dpkg-deb)"
    return None


def _tools(with_systemd: bool) -> dict[str, str]:
    return {**MACHINE_TOOLS, **(systemd.TOOLS if with_systemd else {})}


def prepare(flavour: str, with_systemd: bool) -> tuple[kernel.Kernel, Path]:
    """Install and download what is missing; return the kernel and the shared initramfs."""
    reason = obstacle(flavour, with_systemd)
    if reason:
        raise NoLane(reason)
    with cache_lock():
        install(missing(_tools(with_systemd)))
        install_test_tools()
        image = kernel.obtain(flavour)
        return image, initramfs.base(image)


def run(job: Job) -> int:
    """Run the job in this lane; return its exit status."""
    begin = time.monotonic()
    image, base = prepare(job.kernel, job.systemd)
    machine = Machine(job)
    with contextlib.ExitStack() as stack:
        watch = stack.enter_context(Watch(job.timeout_s, job.grace_s))
        folder = Path(tempfile.mkdtemp(prefix="canshaper-lane-"))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        archive = folder / "initramfs"
        archive.write_bytes(base.read_bytes() + initramfs.for_run(job, image, PORTS))
        theirs = machine.connect()
        fds = {name: port.fileno() for name, port in theirs.items()}
        words = command_line(job, image, archive, folder / "console.log", fds)
        if job.verbose:
            say(*words)
        log = stack.enter_context((folder / "qemu.log").open("wb"))
        stack.enter_context(owned(words, folder=folder, log=log, pass_fds=list(fds.values())))
        for port in theirs.values():
            port.close()
        start = time.monotonic()
        try:
            status = machine.serve(watch)
        except LaneError as error:
            raise type(error)(str(error), _logs(folder)) from error
    if job.verbose:
        ready, done = machine.ready_at or start, machine.done_at or start
        say(f"set-up {start - begin:.2f} s, boot {ready - start:.2f} s")
        say(f"command {done - ready:.2f} s, all {time.monotonic() - begin:.2f} s")
    return status


def _logs(folder: Path) -> str:
    """Return the ends of what qemu and the guest's console said."""
    texts = [(folder / name) for name in ("qemu.log", "console.log")]
    ends = [path.read_bytes()[-3000:] for path in texts if path.exists()]
    return "\n".join(end.decode(errors="replace").strip() for end in ends if end.strip())


class Machine:
    """Our ends of the machine's ports, and what came over them."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._ports: dict[str, socket.socket] = {}
        self._control = b""
        self._status: int | None = None
        self.ready_at: float | None = None
        self.done_at: float | None = None

    def connect(self) -> dict[str, socket.socket]:
        """Open the ports; return the machine's ends."""
        theirs: dict[str, socket.socket] = {}
        for name in PORTS:
            self._ports[name], theirs[name] = socket.socketpair()
            self._ports[name].setblocking(False)
        return theirs

    def serve(self, watch: Watch) -> int:
        """Pass output on until the machine has ended or must be ended; return the status."""
        boot_by = time.monotonic() + self._job.boot_timeout_s
        with selectors.DefaultSelector() as selector:
            for name, port in self._ports.items():
                selector.register(port, selectors.EVENT_READ, name)
            while selector.get_map():
                verdict = self._verdict(watch, boot_by)
                if verdict is not None:
                    return verdict
                for key, _ in selector.select(POLL_S):
                    if not self._receive(key.data, watch):
                        selector.unregister(key.fileobj)
        # all ports have closed: qemu has ended
        if self._status is None:
            raise LaneError("the machine ended without a status of the command")
        return watch.status(self._status)

    def _verdict(self, watch: Watch, boot_by: float) -> int | None:
        now = time.monotonic()
        if self._status is not None:
            over = self.done_at is not None and now > self.done_at + POWER_OFF_S
            return watch.status(self._status) if over else None
        if self.ready_at is None and now > boot_by:
            raise LaneError(f"no boot within {self._job.boot_timeout_s:g} s")
        return watch.verdict()

    def _receive(self, name: str, watch: Watch) -> bool:
        """Read one port; return whether it is still open."""
        try:
            data = self._ports[name].recv(65536)
        except BlockingIOError:
            return True
        except ConnectionResetError:
            return False
        if name == "CTL":
            *lines, self._control = (self._control + data).split(b"\n")
            for line in lines:
                self._on_line(line.split(), watch)
        else:
            _write(DESTINATION[name], data)
        return bool(data)

    def _on_line(self, words: list[bytes], watch: Watch) -> None:
        match words:
            case [b"READY", _uptime]:
                self.ready_at = time.monotonic()
                watch.started(self._signal)
            case [b"EXIT", status, _uptime]:
                self.done_at = time.monotonic()
                self._status = int(status)

    def _signal(self, number: signal.Signals) -> None:
        with contextlib.suppress(OSError):
            self._ports["CTL"].send(f"SIG {number.name.removeprefix('SIG')}\n".encode())


def _write(fd: int, data: bytes) -> None:
    while data:
        try:
            data = data[os.write(fd, data) :]
        except BlockingIOError:  # someone has made our output non-blocking
            select.select([], [fd], [])
