"""The machine's first file system: busybox, modules and the guest's scripts.

It comes in two parts, which the kernel unpacks one after the other: ``base`` is the same for
every run and cached, ``for_run`` holds the settings and the command of one run.
"""

import hashlib
import io
import os
import shlex
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path

from . import systemd
from .job import Job, can_names, ip_batch
from .kernel import Kernel, module_order, read_module
from .outcome import NoLane
from .packages import cache, which

SCRIPTS = Path(__file__).parent / "scripts"
# What booting and the interfaces need; everything else is there for modprobe.
MODULES = (
    *("virtio_pci", "virtio_console", "9pnet_virtio", "9p", "overlay"),
    *("can", "can_raw", "can_dev", "vcan", "vxcan", "kvaser_pci"),
)
FOLDER, SCRIPT, PLAIN = stat.S_IFDIR | 0o755, stat.S_IFREG | 0o755, stat.S_IFREG | 0o644
CONSOLE, CONSOLE_NUMBER = stat.S_IFCHR | 0o600, (5, 1)


class Archive:
    """A cpio archive in the "newc" format (the kernel's buffer-format.rst)."""

    def __init__(self) -> None:
        self._out = io.BytesIO()
        self._folders: set[str] = {"."}
        self._count = 0

    def folder(self, name: str) -> None:
        """Add a directory and those above it, each once."""
        if name not in self._folders:
            self._folders.add(name)
            self.add(name, mode=FOLDER)

    def add(
        self, name: str, data: bytes = b"", mode: int = PLAIN, number: tuple[int, int] = (0, 0)
    ) -> None:
        """Add one entry, and the directories above it; ``number`` is that of a device."""
        if parent := os.path.dirname(name):  # noqa: PTH120 - a name in the archive, not a path
            self.folder(parent)
        self._count += 1
        path = os.fsencode(name) + b"\0"
        fields = (self._count, mode, 0, 0, 1, 0, len(data), 0, 0, *number, len(path), 0)
        self._out.write(b"070701" + b"".join(b"%08X" % field for field in fields) + path)
        self._pad(4)
        self._out.write(data)
        self._pad(4)

    def _pad(self, size: int) -> None:
        self._out.write(b"\0" * (-self._out.tell() % size))

    def close(self) -> bytes:
        """Return the whole archive."""
        self.add("TRAILER!!!", mode=0)
        self._pad(512)
        return self._out.getvalue()


def base(kernel: Kernel) -> Path:
    """Return the part that every run shares, made if the cache does not have it."""
    busybox = Path(which("busybox") or "busybox").resolve()
    init = (SCRIPTS / "init.sh").read_bytes()
    files = module_order(kernel.modules, MODULES)
    parts = (init, str(files), str(busybox), busybox.stat().st_mtime_ns, Path(__file__).read_text())
    key = hashlib.sha256(repr(parts).encode()).hexdigest()[:12]
    path = cache() / "initramfs" / f"tcg-{kernel.version}-{key}.cpio"
    if path.exists():
        return path
    archive = Archive()
    for name in ("proc", "sys", "dev", "lower", "upper", "newroot"):
        archive.folder(name)
    archive.add("dev/console", mode=CONSOLE, number=CONSOLE_NUMBER)
    archive.add("bin/busybox", busybox.read_bytes(), SCRIPT)
    archive.add("init", init, SCRIPT)
    names = [f"{place:02}-{file.name.split('.')[0]}.ko" for place, file in enumerate(files)]
    for name, file in zip(names, files, strict=True):
        archive.add(f"modules/{name}", read_module(file))
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as part:
        part.write(archive.close())
    Path(part.name).rename(path)
    return path


def for_run(job: Job, kernel: Kernel, ports: Mapping[str, str]) -> bytes:
    """Return the part of one run; ``ports`` names the guest's devices CTL, OUT and ERR."""
    ip = which("ip")
    if ip is None:
        raise NoLane("ip not found (Debian package iproute2)")
    can = can_names(job.kvaser)
    settings = {"MODULES": str(kernel.modules.resolve()), "IP": ip, **ports}
    settings["NEXT"] = "systemd.sh" if job.systemd else "run.sh"
    settings["NEVER_IDLE"] = "1" if job.steady else ""
    command = 'echo "$$" >/run/lane/pid\n' + job.script("tcg", can)
    files = {
        "settings": "".join(f"{name}={shlex.quote(value)}\n" for name, value in settings.items()),
        "shares": "".join(f"{folder}\n" for folder in job.writable),
        "ip.batch": ip_batch(can),
        "command": command,
    }
    archive = Archive()
    for name, text in files.items():
        archive.add(f"lane/{name}", os.fsencode(text))
    for name, data in systemd.files().items() if job.systemd else ():
        archive.add(f"lane/{name}", data)
    for name in ("root.sh", "systemd.sh", "run.sh"):
        archive.add(f"lane/{name}", (SCRIPTS / name).read_bytes())
    return archive.close()
