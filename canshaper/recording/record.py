"""Record every frame of the buses into a log, and pack one file to attach to a report.

That file has log, deployment, DBC files, versions and the history of the status messages.
"""

import json
import shutil
import stat
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath

from canshaper.blackbox.write import ABOUT, BOX, about_of, carried
from canshaper.errors import LogError
from canshaper.machine.deployment import Deployment
from canshaper.recording.export import exporting
from canshaper.recording.form import EXTRAS
from canshaper.recording.listen import History, Listener, ReceivedFrame

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
    """Write a bundle: one file with a log and all that a replay of it needs.

    Args:
        path: the bundle; an existing one is replaced.
        log: the recorded log.
        deployment: the recorded machine; its file and DBC files go in under paths that still
            hold when the bundle is unpacked.
        history: history of the status messages.
        facts: other facts about the recording, by name.

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
    """Unpack a bundle into an empty folder; even a hostile one touches nothing outside it.

    Returns:
        (log, deployment file).

    Raises:
        LogError: the file is no bundle, damaged, or too large; the message names the member.
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
    except Exception as error:  # many kinds, if the file is damaged
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
    """Write one member as a regular file.

    Raises:
        ValueError: the member's name leads out of the folder, it is a link, or it is too large.
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
    """Return a line for each change, with its time, then one for the last counters, if any came."""
    lines = [f"{time_text(event.time_ns)} {event.text}" for event in history.changes]
    if history.counted_ns is not None:
        counters = " ".join(f"{name}={count}" for name, count in history.counters.items())
        last = time_text(history.counted_ns)
        lines.append(f"{last} counters {counters} last_fault={history.last_fault}")
    return lines


def time_text(time_ns: int) -> str:
    """Return date and time of the day in UTC, to the millisecond."""
    return datetime.fromtimestamp(time_ns / 1e9, UTC).isoformat(timespec="milliseconds")


# Longest part of the log that a crash of the program may lose, s.
FLUSH_S = 1.0


class Recording:
    """A recording under way, or done.

    Attributes:
        frames: number of frames by kind; the kind of data frames is empty.
        lost: number of frames that the kernel dropped before they were read.
        errors: number of errors that interfaces raised in place of a frame.
        history: history of the status messages.
        seconds: duration so far.
    """

    def __init__(self, deployment: Deployment) -> None:
        self.frames: Counter[str] = Counter()
        self.lost = self.errors = 0
        self._last_error = ""
        self.seconds = 0.0
        self.history = History(deployment)
        self._deployment = deployment

    def __str__(self) -> str:
        text = f"{self.seconds:.1f} s, {self.frames.total()} frames"
        others = ", ".join(f"{count} {kind}" for kind, count in self.frames.items() if kind)
        text += f" ({others})" if others else ""
        if self.errors:
            text += f", {self.errors} ERRORS of the interface, the last {self._last_error}"
        return f"{text}, {self.lost} LOST by the kernel" if self.lost else text

    def run(
        self, path: Path, seconds: float | None, on_progress: Callable[["Recording"], bool]
    ) -> None:
        """Record until the time is over or ``on_progress`` returns False.

        Args:
            path: the log, of candump or by its suffix one of ``EXTRAS``; an existing one is
                replaced.
            seconds: duration; None without end.
            on_progress: called several times a second; returns False to end the recording.

        Raises:
            BusError: a bus cannot be opened, or can no longer be read.
            OSError: the log cannot be written; what was written stays (MF4 is written at the end).
            UsageError: the extra for the format of the log is not installed.
        """
        listener = Listener(self._deployment.config.buses.items())
        try:
            with _opened(path, self._deployment) as (write, flush):
                begin = flushed = time.monotonic()
                while on_progress(self) and (seconds is None or self.seconds < seconds):
                    for frame in listener.frames():
                        write(frame)
                        self.frames[frame.kind] += 1
                        if not frame.kind:
                            self.history.receive(frame)
                    now = time.monotonic()
                    self.seconds, self.lost = now - begin, listener.lost
                    self.errors, self._last_error = listener.errors.total(), listener.last_error
                    if now - flushed >= FLUSH_S:
                        flushed = now
                        flush()
        finally:
            listener.close()


@contextmanager
def _opened(
    path: Path, deployment: Deployment
) -> Iterator[tuple[Callable[[ReceivedFrame], object], Callable[[], object]]]:
    """Open a log; give (function that writes a frame, function that hands all to the kernel)."""
    if path.suffix.lower() in EXTRAS:
        with exporting(path, deployment) as export:
            assert export is not None
            yield export.frame, lambda: None
        return
    with path.open("w", encoding="ascii", newline="\n") as log:
        yield lambda frame: log.write(frame.line()), log.flush
