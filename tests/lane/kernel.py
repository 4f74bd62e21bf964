"""The kernel that the tcg lane boots: downloaded from the distribution, unpacked into the cache."""

import gzip
import lzma
import re
import shutil
import struct
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from .outcome import NoLane, say
from .packages import cache, install, missing, output, with_fresh_lists

META_PACKAGES = {
    "std": ("linux-image-amd64", "linux-image-generic"),  # Debian, Ubuntu
    "rt": ("linux-image-rt-amd64",),  # PREEMPT_RT, Debian only
}
CONCRETE = re.compile(r"Depends: (linux-(?:image|binary|modules|modules-extra)-\d\S+)")
# 470 MB -> 219 MB: drivers of hardware that the machine does not have
UNUSED = (
    "sound",
    *("drivers/ata", "drivers/bluetooth", "drivers/crypto", "drivers/edac", "drivers/gpu"),
    *("drivers/hwmon", "drivers/iio", "drivers/infiniband", "drivers/isdn", "drivers/md"),
    *("drivers/media", "drivers/mtd", "drivers/net/ethernet", "drivers/net/wireless"),
    *("drivers/net/wwan", "drivers/platform", "drivers/scsi", "drivers/staging"),
    *("drivers/target", "drivers/thunderbolt", "drivers/video"),
)
SIGNATURE = b"~Module signature appended~\n"


@dataclass(frozen=True)
class Kernel:
    """A bootable image and the directory of its modules."""

    image: Path
    modules: Path

    @property
    def version(self) -> str:
        """Return the kernel release, as ``uname -r`` says it."""
        return self.modules.name

    @property
    def flavour(self) -> str:
        """Return the key in META_PACKAGES that leads to such a kernel."""
        return "rt" if "-rt-" in self.version else "std"


def cached(flavour: str) -> Kernel | None:
    """Return the newest such kernel in the cache; what is there is whole (made by one rename)."""
    kernels = (
        Kernel(image, modules)
        for image in cache().glob("kernels/[0-9]*/vmlinu[xz]")
        for modules in image.parent.glob("lib/modules/*")
    )
    candidates = [kernel for kernel in kernels if kernel.flavour == flavour]
    return max(
        candidates, key=lambda k: [int(n) for n in re.findall(r"\d+", k.version)], default=None
    )


def obtain(flavour: str) -> Kernel:
    """Return the cached kernel; download one first if there is none (no root needed for that)."""
    kernel = cached(flavour)
    if kernel is not None:
        return kernel
    kernels = cache() / "kernels"
    kernels.mkdir(parents=True, exist_ok=True)
    for interrupted in kernels.glob(".new-*"):
        shutil.rmtree(interrupted, ignore_errors=True)
    with tempfile.TemporaryDirectory(dir=kernels, prefix=".new-") as name:
        work = Path(name)
        debs = work / "debs"
        debs.mkdir()
        # lists may be absent, or name a version that has left the mirror
        with_fresh_lists(lambda: _download(debs, META_PACKAGES[flavour]))
        ready = _arrange(work)
        ready.rename(kernels / ready.name)
    kernel = cached(flavour)
    if kernel is None:
        raise NoLane("the downloaded kernel package has no kernel where one was expected")
    return kernel


def _download(folder: Path, metas: Sequence[str]) -> None:
    packages = _concrete_packages(metas)
    say("downloading", *packages)
    output("apt-get", "-q", "download", *packages, cwd=folder)


def _concrete_packages(metas: Sequence[str]) -> list[str]:
    """Return the versioned packages behind the distribution's kernel, modules included."""
    for meta in metas:
        try:
            todo = CONCRETE.findall(output("apt-cache", "depends", meta))
        except NoLane:
            continue
        packages: list[str] = []
        while todo:
            package = todo.pop()
            if package not in packages:
                packages.append(package)
                todo += CONCRETE.findall(output("apt-cache", "depends", package))
        if packages:
            return sorted(packages)
    raise NoLane(f"apt knows none of the packages {', '.join(metas)}")


def _arrange(work: Path) -> Path:
    """Unpack ``work/debs`` to ``work/<version>`` with vmlinux (or vmlinuz) and lib/modules."""
    tree = work / "tree"
    for deb in (work / "debs").glob("*.deb"):
        output("dpkg-deb", "-x", str(deb), str(tree))
    # modules may come from several packages, and below /usr or not
    origins = [*tree.glob("lib/modules/*"), *tree.glob("usr/lib/modules/*")]
    if not origins:
        raise NoLane("the downloaded kernel package has no modules")
    version = origins[0].name
    images = [*tree.glob("boot/vmlinuz-*"), *tree.glob("usr/lib/modules/*/vmlinuz")]
    if not images:
        raise NoLane("the downloaded kernel package has no boot/vmlinuz-*")
    ready = work / version
    modules = ready / "lib/modules" / version
    for origin in origins:
        shutil.copytree(origin, modules, dirs_exist_ok=True, symlinks=True)
    for name in UNUSED:
        shutil.rmtree(modules / "kernel" / name, ignore_errors=True)
    output("depmod", "-b", str(ready), version)
    image = images[0].read_bytes()
    unpacked = vmlinux(image)
    if unpacked is None:
        (ready / "vmlinuz").write_bytes(image)
    else:
        (ready / "vmlinux").write_bytes(unpacked)
    return ready


def vmlinux(image: bytes) -> bytes | None:
    """Return the ELF kernel inside a bzImage; None if it cannot be had.

    Booting it through PVH saves 3 s of decompression on an emulated processor. Offsets: the
    kernel's Documentation/arch/x86/boot.rst.
    """
    if image[0x202:0x206] != b"HdrS":
        return None
    setup_bytes = (image[0x1F1] + 1) * 512
    offset, length = struct.unpack_from("<II", image, 0x248)
    start = setup_bytes + offset
    payload = decompress(image[start : start + length])
    return payload if payload.startswith(b"\x7fELF") else None


def decompress(data: bytes) -> bytes:
    """Return what xz, gzip or zstd packed, ignoring what follows; other data as it is."""
    if data.startswith(b"\xfd7zXZ\0"):
        return lzma.LZMADecompressor().decompress(data)
    if data.startswith(b"\x1f\x8b"):
        return gzip.decompress(data)
    if data.startswith(b"\x28\xb5\x2f\xfd"):
        install(missing({"zstd": "zstd"}))
        # a length of 4 bytes follows a kernel's payload; zstd complains, but only after the data
        return subprocess.run(["zstd", "-dcq"], input=data, capture_output=True, check=False).stdout
    return data


def read_module(path: Path) -> bytes:
    """Return a module ready to load; without its signature, whose check costs time."""
    data = decompress(path.read_bytes())
    if data.endswith(SIGNATURE):
        (length,) = struct.unpack(">I", data[-len(SIGNATURE) - 4 : -len(SIGNATURE)])
        data = data[: -len(SIGNATURE) - 12 - length]  # 12: struct module_signature
    return data


def module_order(modules: Path, names: Iterable[str]) -> list[Path]:
    """Return the files of these modules and of all they need, in the order of loading."""
    needs: dict[str, list[str]] = {}
    for line in (modules / "modules.dep").read_text().splitlines():
        file, _, others = line.partition(":")
        needs[_module_name(file)] = [file, *others.split()]
    builtin = {
        _module_name(file) for file in (modules / "modules.builtin").read_text().splitlines()
    }
    order: dict[str, None] = {}
    for name in names:
        if name in needs:
            order.update(dict.fromkeys(reversed(needs[name])))
        elif name not in builtin:
            raise NoLane(f"kernel {modules.name} has no module {name}")
    return [modules / file for file in order]


def _module_name(file: str) -> str:
    return re.sub(r"\.ko(\.\w+)?$", "", Path(file).name).replace("-", "_")
