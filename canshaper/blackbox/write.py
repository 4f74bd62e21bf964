"""Writes a black box into a bundle with the deployment file and its DBC files."""

import errno
import json
import os
import platform
import re
import time
import zlib
from collections.abc import Iterable
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from canshaper.blackbox.file import SUFFIX, chunks
from canshaper.blackbox.ring import Segment
from canshaper.gate.cycle import boottime_ns
from canshaper.machine.deployment import Deployment

ABOUT, FOLDER, OUTSIDE = "about.json", "deployment", "outside"
BOX = f"recording{SUFFIX}"
# Most files of one deployment; older ones are removed. Each has 0.1 to 3 MB.
MOST_FILES = 20
PACKAGES = ("python-can", "cantools", "bitstruct", "pydantic", "PyYAML", "msgpack", "crccheck")


def last_number(folder: Path, stem: str) -> int:
    """Return the highest number of a deployment's black boxes in a folder; 0 without one."""
    try:
        return max(_numbered(folder, stem), default=0)
    except OSError:
        return 0


def _numbered(folder: Path, stem: str) -> dict[int, Path]:
    numbered = re.compile(rf"{re.escape(stem)}-(\d+)\.zip")
    return {int(m[1]): p for p in folder.iterdir() if (m := numbered.fullmatch(p.name))}


def write_box(
    folder: Path, deployment: Deployment, segments: Iterable[Segment], why: str, number: int
) -> Path:
    """Write a black box into a folder, and remove its oldest ones beyond ``MOST_FILES``.

    The file is on the disk when this returns its path, so it survives a power cut. Until then an
    older file with the same number stays. While the disk is full, the oldest files are removed.

    Args:
        folder: folder, created if it is missing.
        deployment: deployment that was running.
        segments: recorded segments.
        why: reason for the file.
        number: number of the file.

    Raises:
        OSError: the file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stem = deployment.path.stem
    path = folder / f"{stem}-{number:04d}.zip"
    for part in folder.glob(f"{stem}-*.zip.part"):  # left by a killed process
        part.unlink(missing_ok=True)
    there = _numbered(folder, stem)
    old = sorted(there.keys() - {number})
    while True:
        try:
            _write(path, deployment, [*segments], why)
            break
        except OSError as error:
            path.with_name(f"{path.name}.part").unlink(missing_ok=True)
            if error.errno not in (errno.ENOSPC, errno.EDQUOT) or not old:
                raise
            there[old.pop(0)].unlink()
    for one in old[: max(0, len(old) + 1 - MOST_FILES)]:
        there[one].unlink()
    return path


def _write(path: Path, deployment: Deployment, segments: list[Segment], why: str) -> None:
    import zipfile  # noqa: PLC0415  (only the process that writes needs it, not the daemon)

    part = path.with_name(path.name + ".part")
    inside, files = carried(deployment)
    about = about_of(deployment, inside, BOX) | {"why": why}
    with part.open("wb") as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as bundle:
            with bundle.open(BOX, "w") as box:
                for chunk in chunks(header_of(deployment, why), segments):
                    box.write(chunk)
            for name, content in files.items():
                bundle.writestr(name, content)
            bundle.writestr(ABOUT, json.dumps(about, indent=2) + "\n")
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)
    directory = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)


def header_of(deployment: Deployment, why: str) -> dict[str, Any]:
    """Return the header, which a replay reads first.

    Returns:
        ``buses``: names of the buses, at the index that records use; ``listen_only``;
        ``identity``: lines on deployment and program; ``carried``: SHA-256 of the files in the
        bundle; ``why``: reason for the file; ``clock_ns`` and ``time_ns``: present time by the
        clock of the records and since 1970.
    """
    return {
        "buses": list(deployment.config.buses),
        "listen_only": deployment.listen_only,
        "identity": deployment.identity.lines(),
        "carried": [
            sha256(_text(deployment)[1].encode()).hexdigest(),
            *deployment.identity.content,
        ],
        "why": why,
        "clock_ns": boottime_ns(),
        "time_ns": time.time_ns(),
    }


def carried(deployment: Deployment) -> tuple[str, dict[str, bytes]]:
    """Return the files of a deployment as they were loaded, with paths that hold in a bundle.

    Returns:
        (name of the deployment file in the bundle, content of every file by its name there).
    """
    names, text = _text(deployment)
    packed = [file.packed for file in deployment.messages.files]
    files = {n: zlib.decompress(p) for n, p in zip(names[1:], packed, strict=True)}
    return names[0], files | {names[0]: text.encode()}


def _text(deployment: Deployment) -> tuple[list[str], str]:
    """Return (names of deployment and DBC files in a bundle, deployment file with paths there)."""
    file = deployment.path.resolve()
    text = deployment.source.content.decode("utf-8")
    sources = [(name, Path(os.path.normpath(file.parent / name))) for name in deployment.config.dbc]
    relative = [source for name, source in sources if not Path(name).is_absolute()]
    root = Path(os.path.commonpath([file.parent, *(source.parent for source in relative)]))
    names, moved = [str(Path(FOLDER) / file.relative_to(root))], dict[str, str]()
    for i, (name, source) in enumerate(sources):
        if Path(name).is_absolute():
            inside = Path(OUTSIDE, str(i), source.name)  # two files may have the same name
            names.append(str(FOLDER / inside))
            moved[name] = os.path.relpath(root / inside, file.parent)
        else:
            moved[name] = name
            names.append(str(Path(FOLDER) / source.relative_to(root)))
    if len(relative) < len(sources):  # all at once, the longest first: one path may be in another
        paths = "|".join(map(re.escape, sorted(moved, key=len, reverse=True)))
        text = re.sub(paths, lambda match: moved[match[0]], text)
    return names, text


def about_of(deployment: Deployment, inside: str, log: str) -> dict[str, Any]:
    """Return the content of ``about.json`` of a bundle.

    Args:
        deployment: deployment that was running.
        inside: name of the deployment file in the bundle.
        log: name of the log in the bundle.
    """
    return {
        "deployment": inside,
        "log": log,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "buses": {n: f"{b.interface} {b.channel}" for n, b in deployment.config.buses.items()},
        "versions": versions(),
        "identity": deployment.identity.lines(),
    }


def versions() -> dict[str, str]:
    """Return the versions of program, interpreter, packages and kernel, by name."""
    installed = {"canshaper": version("canshaper"), "python": platform.python_version()}
    for name in PACKAGES:
        try:
            installed[name] = version(name)
        except PackageNotFoundError:
            installed[name] = "not installed"
    installed["kernel"] = f"{platform.system()} {platform.release()} {platform.version()}"
    installed["machine"] = platform.machine()
    return installed
