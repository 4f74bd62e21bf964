"""A recording in one file to attach to a report: log, deployment, DBC files, versions, history."""

import json
import shutil
import stat
import zipfile
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath

from canshaper.blackbox.write import ABOUT, BOX, about_of, carried
from canshaper.errors import LogError
from canshaper.machine.deployment import Deployment
from canshaper.recording.history import History

HISTORY, LOG = "history.txt", "recording.log"
# A bundle that someone sends may be made to fill the disk. A log of candump packs 5 to 30 times,
# and an hour of a full bus at 1 Mbit/s has 2 GB.
MOST_MEMBERS = 100
MOST_LOG_BYTES = 4_000_000_000
MOST_FILE_BYTES = 10_000_000
MOST_RATIO, RATIO_FROM_BYTES = 100, 1_000_000


def pack(
    path: Path, log: Path, deployment: Deployment, history: History, facts: dict[str, object]
) -> None:
    """Make a bundle.

    Args:
        path: the bundle, which is replaced where it is there.
        log: the recorded log.
        deployment: whose buses were recorded; its file and DBC files go in, so that the paths in
            the file hold when it is unpacked.
        history: what the status messages reported.
        facts: anything else about the recording.

    Raises:
        OSError: a file cannot be read or written.
    """
    inside, files = carried(deployment)
    about = about_of(deployment, inside, LOG) | facts
    part = path.with_name(path.name + ".part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as bundle:
        bundle.write(log, LOG)
        for name, content in files.items():
            bundle.writestr(name, content)
        bundle.writestr(ABOUT, json.dumps(about, indent=2) + "\n")
        bundle.writestr(HISTORY, "".join(f"{line}\n" for line in history_lines(history)))
    part.replace(path)


def unpack(path: Path, folder: Path) -> tuple[Path, Path]:
    """Unpack a bundle into a folder; from any source, nothing is written or read elsewhere.

    Returns:
        (log, deployment file).

    Raises:
        LogError: it is no bundle, a damaged one, or too large; the message names the member.
    """
    where = f"{path}"
    try:
        with zipfile.ZipFile(path) as bundle:
            where = f"{path}: {ABOUT}"
            bundle.getinfo(ABOUT)
            members = bundle.infolist()
            if len(members) > MOST_MEMBERS:
                raise ValueError(f"expected {MOST_MEMBERS} files at most, got {len(members)}")
            for member in members:
                where = f"{path}: {member.filename}"
                _extract(bundle, member, folder)
        where = f"{path}: {ABOUT}"
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        log, file = ((folder / about[key]).resolve() for key in ("log", "deployment"))
    except OSError as error:
        text = f"expected a bundle that can be read, got {error.strerror or error}"
        raise LogError(f"{where}: {text}") from None
    except Exception as error:  # of many kinds, where the file is damaged
        text = f"expected a file of canshaper record, got {type(error).__name__} {error}"
        raise LogError(f"{where}: not a bundle: {text}") from None
    for one in (log, file):
        if folder.resolve() not in one.parents:
            raise LogError(f"{path}: not a bundle: a path leads out of it")
        if not one.is_file():
            text = f"expected {one.relative_to(folder.resolve())} in it, got none"
            raise LogError(f"{path}: not a bundle: {text}")
    return log, file


def _extract(bundle: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path) -> None:
    """Write one member as a regular file, whatever it says it is.

    Raises:
        ValueError: a name that leads elsewhere, a link, or more bytes than there may be.
    """
    parts = PurePosixPath(member.filename).parts
    kind = stat.S_IFMT(member.external_attr >> 16)
    if not parts or ".." in parts or parts[0] == "/" or "\\" in member.filename:
        raise ValueError("a name that leads out of it")
    if kind not in (0, stat.S_IFREG):
        raise ValueError("a link or another special file")
    most = MOST_LOG_BYTES if member.filename in (LOG, BOX) else MOST_FILE_BYTES
    if member.file_size > most:
        raise ValueError(f"expected {most} bytes at most, got {member.file_size}")
    if member.file_size > max(RATIO_FROM_BYTES, MOST_RATIO * member.compress_size):
        ratio = member.file_size // max(1, member.compress_size)
        raise ValueError(
            f"expected {MOST_RATIO} bytes at most for each that is packed, got {ratio}"
        )
    target = folder.joinpath(*parts)
    target.parent.mkdir(parents=True, exist_ok=True)
    # zipfile hands out no more than file_size, whatever is packed.
    with bundle.open(member) as source, target.open("xb") as file:
        shutil.copyfileobj(source, file)


def history_lines(history: History) -> list[str]:
    """Every change with its time, then the counters as they were last."""
    lines = [f"{time_text(event.time_ns)} {event.text}" for event in history.changes]
    if history.counted_ns is not None:
        counters = " ".join(f"{name}={count}" for name, count in history.counters.items())
        last = time_text(history.counted_ns)
        lines.append(f"{last} counters {counters} last_fault={history.last_fault}")
    return lines


def time_text(time_ns: int) -> str:
    """Time of the day with its date, in UTC, to the millisecond."""
    return datetime.fromtimestamp(time_ns / 1e9, UTC).isoformat(timespec="milliseconds")
