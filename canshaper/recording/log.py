"""Reader of a log of CAN frames, one frame at a time, in the formats of ``FORMATS``, also gzipped.

A million lines take no more memory than a hundred.
"""

import gzip
import zlib
from codecs import getincrementaldecoder
from collections import Counter
from collections.abc import Callable, Iterator
from io import BufferedReader, RawIOBase
from pathlib import Path
from typing import Any, NamedTuple

from canshaper.config.source import encoding_of
from canshaper.errors import CutOffError, LogError
from canshaper.recording import asc, binary, candump, captures, tables
from canshaper.recording.channels import LATEST_S, Place, TimedFrame

__all__ = ["CutOffError", "LogError", "LogFile", "TimedFrame"]


class Format(NamedTuple):
    """One format of a log.

    Attributes:
        read: yields the frames of an open log; the place counts its lines or frames.
        says: what writes it, and its channels, in Markdown.
        text: whether the log is text, of lines.
        packs: whether the log may be packed with gzip.
    """

    read: Callable[[BufferedReader, Place], Iterator[TimedFrame]]
    says: str
    text: bool = True
    packs: bool = True


LOG_SAYS = "`candump -L`, candump's screen with times (`-t d` too), python-can's logger, BUSMASTER"
CSV_SAYS = (
    "python-can, without channels; SavvyCAN (GVRET), buses from 0; CANedge, Kvaser, Vector;"
    " also from Excel"
)
PCAP_SAYS = "tcpdump or Wireshark at CAN interfaces, not at `any`"
FORMATS = {
    ".log": Format(candump.log, LOG_SAYS),
    ".asc": Format(asc.asc, "Vector, channels from 1"),
    ".blf": Format(captures.blf, "Vector, channels from 1", text=False),
    ".csv": Format(tables.csv, CSV_SAYS),
    ".db": Format(
        binary.database,
        "python-can's SQLite database, without channels; not packed",
        text=False,
        packs=False,
    ),
    ".mcap": Format(binary.mcap, "[canshaper](#for-other-programs)", text=False),
    ".mf4": Format(binary.mf4, "ASAM MDF 4 of a bus logger", text=False),
    ".trc": Format(asc.trc, "PEAK, versions 1.0 to 2.1"),
    ".txt": Format(candump.kvaser, "Kvaser"),
    ".pcap": Format(captures.pcap, PCAP_SAYS, text=False),
    ".pcapng": Format(captures.pcap, PCAP_SAYS, text=False),
}
"""The formats of a log, by the suffix of its file."""
# Two sockets of one logger are not read in the order in which their frames came.
OUT_OF_ORDER_NS = 20_000_000
# Longer than any break of a drive that is one: a clock was set, or two logs are in one file.
LONGEST_GAP_NS = 12 * 3600 * 1_000_000_000
LATEST_NS = LATEST_S * 1_000_000_000
PROGRESS_EVERY = 8192
BUFFER_BYTES = 1 << 17
# A log of candump packs 5 to 30 times; one that unpacks without end must not keep us.
MOST_RATIO, RATIO_FROM_BYTES = 100, 2_000_000


class LogFile:
    """One log; each iteration reads it from its beginning.

    Args:
        path: the log; its suffix names the format, a further ``.gz`` marks a packed log.
        progress: called now and then with the part that is read, 0 to 1.

    Attributes:
        left_out: number of frames and lines that the last iteration left out, by kind, such as
            "remote" or "impossible".
        disordered: number of frames that stand behind a later frame, by up to
            ``OUT_OF_ORDER_NS``; each comes in the order of the file, with that later time.
    """

    def __init__(self, path: Path, progress: Callable[[float], None] | None = None) -> None:
        self.left_out: Counter[str] = Counter()
        self.disordered = 0
        self._notes: list[str] = []
        self._path = path
        self._progress = progress

    def __iter__(self) -> Iterator[TimedFrame]:
        """Yield every data frame in the order of the file.

        Raises:
            CutOffError: the log is cut off; every whole frame was yielded before.
            LogError: the log cannot be read or is damaged, has no data frame, or mixes clocks.
        """
        place = Place(self._path)
        self.left_out, self._notes, self.disordered = place.left_out, place.notes, 0
        try:
            yield from self._frames(place)
        except EOFError:
            raise place.cut_off("its packing has no end") from None
        except OSError as error:
            raise place.error(error.strerror or str(error), "a log that can be read") from None
        except _UnpackedWithoutEndError:
            got = f"more than {MOST_RATIO} bytes for each that is packed"
            raise place.error(got, "a log of a bus") from None
        except zlib.error as error:
            raise place.error(f"damaged packing ({error})", "a log that is whole") from None

    def warnings(self) -> Iterator[str]:
        """Yield what a person must know of the last iteration before relying on its frames."""
        yield from self._notes
        if self.left_out:
            counts = ", ".join(f"{count} {kind}" for kind, count in self.left_out.items())
            yield f"what is no data frame is left out: {counts}"
        if self.disordered:
            yield f"{self.disordered} frames stand behind later ones; the log's order counts"

    def _frames(self, place: Place) -> Iterator[TimedFrame]:
        """Yield the frames of the log; their times never go back."""
        packed, suffix = _format(place)
        form = FORMATS[suffix]
        place.unit = "line" if form.text else "frame"
        until_progress = 1
        with self._path.open("rb", buffering=0) as raw:
            size = raw.seek(0, 2)
            raw.seek(0)
            file: BufferedReader[Any] = BufferedReader(raw, BUFFER_BYTES)
            if packed:
                file = BufferedReader(_Unpacked(file), BUFFER_BYTES)
            # PowerShell writes UTF-16 with ">".
            if form.text and (encoding := encoding_of(file.peek(4)[:4])):
                file = BufferedReader(_Utf8(file, encoding), BUFFER_BYTES)
            last_ns: int | None = None
            latest_ns = 0
            for frame in form.read(file, place):
                time_ns = frame[0]
                if last_ns is not None and last_ns <= time_ns <= latest_ns:
                    last_ns = time_ns
                    yield frame
                else:
                    last_ns = self._first_or_out_of_order(time_ns, last_ns, place)
                    yield frame._replace(time_ns=last_ns)
                latest_ns = last_ns + LONGEST_GAP_NS
                until_progress -= 1
                if not until_progress:
                    until_progress = PROGRESS_EVERY
                    if self._progress and not raw.closed:
                        self._progress(raw.tell() / size)
        if last_ns is None:
            raise self._empty(place)
        if self._progress:
            self._progress(1.0)

    @staticmethod
    def _empty(place: Place) -> LogError:
        """Return the error for a log without a data frame."""
        if place.left_out:
            kinds = ", ".join(f"{n} {kind}" for kind, n in place.left_out.items())
            return place.error(f"other frames only: {kinds}", "a data frame")
        return place.error("no frame", "a log with frames, its suffix that of its format")

    def _first_or_out_of_order(self, time_ns: int, last_ns: int | None, place: Place) -> int:
        """Return the time of a first frame, or ``last_ns`` for a late one; else raise LogError."""
        if abs(time_ns) > LATEST_NS:
            got = f"a time further than {LATEST_S} s from zero"  # itself too long to be shown
            raise place.error(got, "a date before 2286, or a time from the start of the log")
        if last_ns is None:
            return time_ns
        step_ns = time_ns - last_ns
        if -OUT_OF_ORDER_NS <= step_ns < 0:
            self.disordered += 1
            return last_ns
        got = f"a time {abs(step_ns) / 1e9:.3f} s {'after' if step_ns > 0 else 'before'}"
        expected = "one clock for the whole log (split it here)"
        raise place.error(f"mixed clocks: {got} that of the frame before", expected)


class _UnpackedWithoutEndError(Exception):
    """A packed file grows by more than any log would: someone made it to fill the memory."""


class _Unpacked(RawIOBase):
    """Unpacked content of a gzip file; a file that is cut off gives its content, then the error."""

    def __init__(self, file: BufferedReader) -> None:
        self._packed = file
        self._file = gzip.GzipFile(fileobj=file)
        self._count = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        data = self._file.read1(len(buffer))
        buffer[: len(data)] = data
        self._count += len(data)
        if self._count > max(RATIO_FROM_BYTES, MOST_RATIO * self._packed.tell()):
            raise _UnpackedWithoutEndError
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()


class _Utf8(RawIOBase):
    """The text of a file in another encoding as UTF-8, without a byte order mark."""

    def __init__(self, file: BufferedReader, encoding: str) -> None:
        self._file = file
        self._decoder = getincrementaldecoder(encoding)("replace")
        self._text, self._ended = b"", False

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while not (self._text or self._ended):
            data = self._file.read1()
            self._ended = not data
            self._text = self._decoder.decode(data, self._ended).encode("utf-8", "replace")
        count = min(len(buffer), len(self._text))
        buffer[:count], self._text = self._text[:count], self._text[count:]
        return count


def _format(place: Place) -> tuple[bool, str]:
    """Return whether a log is packed, and the suffix of its format; LogError for another one."""
    suffixes = [s.lower() for s in place.path.suffixes]
    packed = suffixes[-1:] == [".gz"]
    suffix = "".join(suffixes[:-1] if packed else suffixes)
    suffix = f".{suffix.rpartition('.')[2]}"
    form = FORMATS.get(suffix)
    if form is None or (packed and not form.packs):
        whole = " and ".join(name for name, one in FORMATS.items() if not one.packs)
        got = repr(suffix + ".gz" * packed) if suffix != "." else "none"
        expected = f"the suffix {', '.join(FORMATS)}, each but {whole} also with .gz behind"
        raise LogError(f"{place.path}: expected {expected}, got {got}")
    return packed, suffix
