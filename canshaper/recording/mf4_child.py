"""Reader of MF4 logs by asammdf, in a process of its own: a damaged file may crash it.

asammdf also prints what it does not understand. The process writes frames to its standard output,
in parts of ``marshal``, and loads nothing else of canshaper.

    python -m canshaper.recording.mf4_child FILE
"""

import heapq
import marshal
import re
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import chain, islice
from operator import itemgetter
from typing import Any

GROUPS = {"": "CAN_DataFrame", "error": "CAN_ErrorFrame", "remote": "CAN_RemoteFrame"}
"""Names of ASAM's bus logging by the kind of a frame."""
PROJECT = "canshaper"
"""Project in the header of our files: the comment of a group names the buses of its channels."""
WHOLE = "an MF4 log that is whole"
AT_ONCE = 20_000
"""Frames that are handed over at once."""
BUS_EVENT = 0x2  # ASAM MDF 4.1, flags of a channel group
ID_MASK = 0x1FFFFFFF
CLASSICAL_BYTES, FD_BYTES = 8, 64


def read(path: str) -> Iterator[list[Any] | dict[str, Any]]:
    """Yield lists of rows of ``TimedFrame``, at last a dictionary with "left out" and "fault".

    "left out" is the number of left-out frames by kind. "fault" is (got, expected) or None; where a
    package is missing, (its name, "").
    """
    left_out: Counter[str] = Counter()
    fault: tuple[str, str] | None = None
    try:
        from asammdf import MDF  # noqa: PLC0415  (an extra)

        with MDF(path) as mdf:
            groups = list(_bus_events(mdf))
            if not groups:
                got = f"{len(mdf.groups)} groups of channels, none of them bus events of CAN"
                fault = got, "an MF4 log with bus logging, or the log of another tool"
            parts = []
            for index, name, count in groups:
                if name == GROUPS[""]:
                    parts.append(_records(mdf, index, count, left_out))
                else:
                    left_out[next(k for k, v in GROUPS.items() if v == name)] += count
            rows = heapq.merge(*parts, key=itemgetter(0)) if len(parts) > 1 else chain(*parts)
            while part := list(islice(rows, AT_ONCE)):
                yield part
    except ModuleNotFoundError as error:
        fault = error.name or str(error), ""
    except Exception as error:  # many kinds, if the file is damaged
        fault = f"{type(error).__name__} {error}".rstrip(), WHOLE
    yield {"left out": dict(left_out), "fault": fault}


def _bus_events(mdf: Any) -> Iterator[tuple[int, str, int]]:
    """Yield (index, name as in ``GROUPS``, number of records) of each group of frames."""
    for index, group in enumerate(mdf.groups):
        name = next((one.name for one in group.channels if one.name in GROUPS.values()), None)
        if name and group.channel_group.flags & BUS_EVENT:
            yield index, name, group.channel_group.cycles_nr


def _records(mdf: Any, index: int, count: int, left_out: Counter[str]) -> Iterator[tuple[Any, ...]]:
    """Yield the frames of a group as rows of ``TimedFrame``; count impossible ones as left out."""
    start = mdf.header.start_time
    start_ns = int(start.timestamp()) * 10**9 + start.microsecond * 1000
    comment = mdf.groups[index].channel_group.comment if mdf.header.project == PROJECT else ""
    names = {int(number): bus for number, bus in re.findall(r"(\d+)=(\S+)", comment)}
    for offset in range(0, count, AT_ONCE):
        signal = mdf.get(GROUPS[""], index, record_offset=offset, record_count=AT_ONCE)
        columns = {name.rpartition(".")[2]: signal[name] for name in signal.samples.dtype.names}
        same = [0] * len(signal)
        times = ((signal.timestamps * 1e9).round().astype("i8") + start_ns).tolist()
        data, ids = columns["DataBytes"], columns["ID"].astype("u4")
        width, content = data.shape[1], data.astype("u1").tobytes()
        lengths = columns["DataLength"].tolist()
        channels = columns["BusChannel"].tolist() if "BusChannel" in columns else same
        texts = {one: names.get(one, str(one)) for one in {*channels}}
        wide = columns["IDE"].tolist() if "IDE" in columns else (ids >> 31).tolist()
        fd = columns["EDL"].tolist() if "EDL" in columns else same
        at = 0
        rows = zip(times, channels, (ids & ID_MASK).tolist(), wide, lengths, fd, strict=True)
        for time_ns, channel, can_id, extended, length, is_fd in rows:
            if length > (FD_BYTES if is_fd else CLASSICAL_BYTES) or can_id >> (
                29 if extended else 11
            ):
                left_out["impossible"] += 1
            else:
                frame = content[at : at + length]
                yield time_ns, texts[channel], can_id, bool(extended), frame
            at += width


if __name__ == "__main__":
    for one in read(sys.argv[1]):
        marshal.dump(one, sys.stdout.buffer)
    sys.stdout.buffer.flush()
