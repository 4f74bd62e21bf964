"""Writes a black box as a bundle: with the deployment file and its DBC files."""

import json
import os
import platform
import re
import time
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from canshaper.blackbox.file import SUFFIX, chunks
from canshaper.blackbox.ring import Segment
from canshaper.bus.packet import boottime_ns
from canshaper.machine.deployment import Deployment

ABOUT, FOLDER, OUTSIDE = "about.json", "deployment", "outside"
BOX = f"recording{SUFFIX}"
# Files in the folder of one deployment; the oldest go. Each has 0.1 to 3 MB.
MOST_FILES = 20
PACKAGES = ("python-can", "cantools", "bitstruct", "pydantic", "PyYAML", "msgpack", "crccheck")


def write_box(folder: Path, deployment: Deployment, segments: Iterable[Segment], why: str) -> Path:
    """Write a black box into a folder, and remove the oldest where there are too many.

    It is on the disk when this returns: who turns the key off next does not lose it.

    Args:
        folder: it has to be there.
        deployment: whose black box it is.
        segments: what there is.
        why: it is written.

    Raises:
        OSError: it cannot be written.
    """
    import zipfile  # noqa: PLC0415  (the daemon has no need of it, the process that writes has)

    stem = deployment.path.stem
    numbered = re.compile(rf"{re.escape(stem)}-(\d+)\.zip")
    there = {int(m[1]): p for p in folder.iterdir() if (m := numbered.fullmatch(p.name))}
    path = folder / f"{stem}-{max(there, default=0) + 1:04d}.zip"
    part = path.with_name(path.name + ".part")
    inside, files = carried(deployment)
    about = about_of(deployment, inside, BOX) | {"why": why}
    with part.open("wb") as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as bundle:
            with bundle.open(BOX, "w") as box:
                for chunk in chunks(header_of(deployment, why), segments):
                    box.write(chunk)
            for name, content in files.items():
                bundle.writestr(name, content)
            bundle.writestr(ABOUT, json.dumps(about, indent=2) + "\n")
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)
    for number in sorted(there)[: max(0, len(there) + 1 - MOST_FILES)]:
        there[number].unlink()
    return path


def header_of(deployment: Deployment, why: str) -> dict[str, Any]:
    """Return the header, which a replay needs before it begins.

    Returns:
        ``buses``: their names by the numbers in the records; ``listen_only``; ``identity`` of
        deployment and program; ``why`` it was written; ``clock_ns`` and ``time_ns``: now, by the
        clock of the records and since 1970.
    """
    return {
        "buses": list(deployment.config.buses),
        "listen_only": deployment.listen_only,
        "identity": deployment.identity.lines(),
        "why": why,
        "clock_ns": boottime_ns(),
        "time_ns": time.time_ns(),
    }


def carried(deployment: Deployment) -> tuple[str, dict[str, str | bytes]]:
    """The files of a deployment for a bundle, so that the paths in them hold when it is unpacked.

    Returns:
        (name of the deployment file in the bundle, content of every file by its name there).

    Raises:
        OSError: a file cannot be read.
    """
    file = deployment.path.resolve()
    text = file.read_text(encoding="utf-8")
    sources = [(name, Path(os.path.normpath(file.parent / name))) for name in deployment.config.dbc]
    relative = [source for name, source in sources if not Path(name).is_absolute()]
    root = Path(os.path.commonpath([file.parent, *(source.parent for source in relative)]))
    files: dict[str, str | bytes] = {}
    for name, source in sources:
        if Path(name).is_absolute():
            files[str(Path(FOLDER) / OUTSIDE / source.name)] = source.read_bytes()
            text = text.replace(name, os.path.relpath(root / OUTSIDE / source.name, file.parent))
        else:
            files[str(Path(FOLDER) / source.relative_to(root))] = source.read_bytes()
    inside = str(Path(FOLDER) / file.relative_to(root))
    return inside, files | {inside: text}


def about_of(deployment: Deployment, inside: str, log: str) -> dict[str, Any]:
    """Return the content of ``about.json`` of a bundle.

    Args:
        deployment: whose bundle it is.
        inside: name of the deployment file in it.
        log: name of the log in it.
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
    """Return the versions of program, interpreter, packages and kernel."""
    installed = {"canshaper": version("canshaper"), "python": platform.python_version()}
    for name in PACKAGES:
        try:
            installed[name] = version(name)
        except PackageNotFoundError:
            installed[name] = "not installed"
    installed["kernel"] = f"{platform.system()} {platform.release()} {platform.version()}"
    installed["machine"] = platform.machine()
    return installed
