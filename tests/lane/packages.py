"""Programs of the host: finding them, and installing what is absent on Debian and Ubuntu."""

import contextlib
import fcntl
import os
import shlex
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

from .outcome import NoLane, say

# What the tcg lane needs: program and the Debian package that has it.
MACHINE_TOOLS = {
    "qemu-system-x86_64": "qemu-system-x86",
    "busybox": "busybox-static",
    "ip": "iproute2",
    "depmod": "kmod",
    "setpriv": "util-linux",
}
# Counterparts that tests like to have; a lane is complete without them.
TEST_TOOLS = {"cangw": "can-utils", "tc": "iproute2", "tshark": "tshark"}
EVERYWHERE = ":/usr/local/sbin:/usr/sbin:/sbin:/usr/local/bin:/usr/bin:/bin"


def which(program: str) -> str | None:
    """Return the path of a program, also from the sbin directories."""
    return shutil.which(program, path=_search_path())


def _search_path() -> str:
    return os.environ.get("PATH", "") + EVERYWHERE


def cache() -> Path:
    """Return the directory of what is kept between runs: kernels and initramfs."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "canshaper-lane"


@contextlib.contextmanager
def cache_lock() -> Iterator[None]:
    """Let one process at a time change the cache and the machine's packages."""
    cache().mkdir(parents=True, exist_ok=True)
    with (cache() / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def missing(tools: dict[str, str]) -> list[str]:
    """Return the packages of those programs that are absent."""
    return sorted({package for program, package in tools.items() if not _present(program)})


def _present(program: str) -> bool:
    path = which(program)
    if path is None or program != "busybox":
        return path is not None
    with Path(path).open("rb") as file:  # the initramfs has no libraries
        return b"/lib64/ld-linux" not in file.read(4096)


def cannot_install() -> str | None:
    """Return why packages cannot be installed here, or None if they can."""
    if not which("apt-get"):
        return "there is no apt-get here"
    if os.geteuid() != 0:
        return "only root can install them"
    return None


def install(packages: list[str]) -> None:
    """Install Debian packages; raise NoLane with what to install where that is not possible."""
    if not packages:
        return
    names = " ".join(packages)
    reason = cannot_install()
    if reason:
        raise NoLane(f"please install {names} ({reason})")
    say("installing", names)
    lock = ("-o", "DPkg::Lock::Timeout=120")
    words = ("apt-get", "-q", "-y", *lock, "--no-install-recommends", "install", *packages)
    with_fresh_lists(lambda: output(*words))


def install_test_tools() -> None:
    """Install what only tests need, where that is possible; elsewhere those tests are skipped."""
    absent = missing(TEST_TOOLS)
    if not absent or cannot_install():
        return
    try:
        install(absent)
    except NoLane as error:
        say(f"{error}; tests that need it are skipped")


def with_fresh_lists(action: Callable[[], object]) -> None:
    """Do what needs apt's package lists; if it fails, once more with new ones (root only)."""
    try:
        action()
    except NoLane:
        if os.geteuid() != 0:
            raise
        say("apt-get update")
        output("apt-get", "-q", "update")
        action()


def output(*argv: str, cwd: Path | None = None) -> str:
    """Return what a set-up command prints; raise NoLane with it if the command fails."""
    done = subprocess.run(
        argv,
        cwd=cwd,
        env={
            **os.environ,
            "PATH": _search_path(),
            "DEBIAN_FRONTEND": "noninteractive",
            "LC_ALL": "C",
        },
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode:
        reason = f"setting up failed: {shlex.join(argv)} ended with status {done.returncode}"
        raise NoLane(reason, done.stdout[-2000:])
    return done.stdout
