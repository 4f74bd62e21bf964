"""Writer of a drive as MF4 (ASAM MDF 4.10): bus logging of its frames, and values with units.

Times are seconds as floats since a whole second, which is exact to the ns for 20 days.
"""

import struct
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks import v4_constants as v4
from asammdf.blocks.v4_blocks import SourceInformation

from canshaper.bus.packet import BRS
from canshaper.codec.layout import FD_LENGTHS
from canshaper.recording.channels import MOST_BYTES
from canshaper.recording.form import Channel, Group, Point, Row
from canshaper.recording.listen import ReceivedFrame
from canshaper.recording.mf4_child import GROUPS, PROJECT

_COLUMNS = (
    ("BusChannel", "u1"),
    ("ID", "<u4"),
    ("IDE", "u1"),
    ("DLC", "u1"),
    ("DataLength", "u1"),
    ("Dir", "u1"),
    ("EDL", "u1"),
    ("BRS", "u1"),
    ("ESI", "u1"),
    ("DataBytes", f"({MOST_BYTES},)u1"),
)
_pack = struct.Struct(f"<qBIBBBBBBB{MOST_BYTES}s").pack
_RECORD = np.dtype([("time", "<i8"), *_COLUMNS])
HELD = 50_000
"""Records of a group in memory; the others are in a temporary file, until the end."""
_COMPRESSED = 2  # transposed and deflated
_ID_MASK = 0x1FFFFFFF
_ESI = 0x02  # linux/can.h, CANFD_ESI


class Mf4Writer:
    """Collects a drive in a temporary file and writes the MF4 file at the end.

    Args:
        path: the file; an existing one is replaced.
        buses: names of the buses; the first bus is channel 1.

    Raises:
        OSError: the file cannot be written.
    """

    def __init__(self, path: Path, buses: Sequence[str]) -> None:
        path.open("wb").close()  # said now, not after an hour of driving
        self._path = path
        self._mdf: Any = MDF(version="4.10")
        self._mdf.header.project = PROJECT
        self._channels = {bus: number for number, bus in enumerate(buses, start=1)}
        self._lengths = {length: code for code, length in enumerate(FD_LENGTHS)}
        self._start_ns: int | None = None
        self._frames = {kind: bytearray() for kind in GROUPS}
        self._tables: list[_Table] = []
        self._events: list[tuple[int, str]] = []
        self._groups: dict[str, int] = {}

    def frame(self, frame: ReceivedFrame, *, sent: bool = False) -> None:
        """Write a frame as it was on its bus, which is one of ``buses``."""
        time_ns, bus, _, can_id, extended, data, kind, flags = frame
        self._begin(time_ns)
        length = len(data)
        bits = flags or 0
        held = self._frames[kind]
        held += _pack(
            time_ns,
            self._channels[bus],
            can_id & _ID_MASK,
            extended,
            self._lengths.get(length, length),
            length,
            sent,
            flags is not None,
            bits & BRS > 0,
            bits & _ESI > 0,
            data,
        )
        if len(held) > HELD * _RECORD.itemsize:
            self._write_frames(kind)

    def _begin(self, time_ns: int) -> None:
        if self._start_ns is None:
            self._start_ns = time_ns // 10**9 * 10**9
            self._mdf.header.start_time = datetime.fromtimestamp(self._start_ns // 10**9, UTC)

    def _seconds(self, times_ns: Any) -> Any:
        return (np.asarray(times_ns, np.int64) - (self._start_ns or 0)) * 1e-9

    def _write_frames(self, kind: str) -> None:
        held = self._frames[kind]
        records = np.frombuffer(bytes(held), _RECORD)
        held.clear()
        name = GROUPS[kind]
        columns = np.empty(len(records), [(f"{name}.{one}", form) for one, form in _COLUMNS])
        for column, _ in _COLUMNS:
            columns[f"{name}.{column}"] = records[column]
        times = self._seconds(records["time"])
        if name in self._groups:
            self._mdf.extend(self._groups[name], [(times, None), (columns, None)])
            return
        source = SourceInformation(source_type=v4.SOURCE_BUS, bus_type=v4.BUS_TYPE_CAN)
        signal = Signal(columns, times, name=name, source=source)
        buses = " ".join(f"{number}={bus}" for bus, number in self._channels.items())
        self._groups[name] = self._mdf.append(signal, acq_name="CAN", comment=buses)
        self._mdf.groups[self._groups[name]].channel_group.acq_source = source

    def group(self, group: Group) -> Row:
        """Return a function that writes the values of a new group."""
        table = _Table(group)
        self._tables.append(table)

        def row(time_ns: int, values: Sequence[float]) -> None:
            self._begin(time_ns)
            table.rows.append((time_ns, *values))
            if len(table.rows) >= HELD:
                table.write(self._mdf, self._seconds)

        return row

    def event(self, time_ns: int, text: str) -> None:
        """Write an event as a text of the channel "events"."""
        self._begin(time_ns)
        self._events.append((time_ns, text))

    def pose(self, time_ns: int, boom: Sequence[Point], grapple: Point) -> None:
        """Write nothing: MF4 has no scenes, and the group "crane" has the values."""

    def close(self) -> None:
        """Write all that was collected into the file, which is empty until then."""
        try:
            for kind, held in self._frames.items():
                if held:
                    self._write_frames(kind)
            for table in self._tables:
                if table.rows:
                    table.write(self._mdf, self._seconds)
            if self._events:
                times, texts = zip(*self._events, strict=True)
                lines = np.array([text.encode() for text in texts])
                signal = Signal(lines, self._seconds(times), name="events", encoding="utf-8")
                self._mdf.append(signal, acq_name="events")
            self._mdf.save(self._path, overwrite=True, compression=_COMPRESSED)
        finally:
            self._mdf.close()


class _Table:
    """Values of a group that are not yet in the file."""

    def __init__(self, group: Group) -> None:
        self.rows: list[tuple[float, ...]] = []
        self._group, self._index = group, -1

    def write(self, mdf: Any, seconds: Any) -> None:
        """Append the rows to those already written; ``seconds`` converts their times from ns."""
        times, *columns = zip(*self.rows, strict=True)
        self.rows.clear()
        channels = self._group.channels
        samples = [
            np.array(column, np.float64 if one.texts is None else np.int64)
            for one, column in zip(channels, columns, strict=True)
        ]
        if self._index >= 0:
            mdf.extend(self._index, [(one, None) for one in (seconds(times), *samples)])
            return
        at = seconds(times)
        signals = [
            Signal(values, at, name=one.name, unit=one.unit, conversion=_texts(one))
            for one, values in zip(channels, samples, strict=True)
        ]
        self._index = mdf.append(
            signals, acq_name=self._group.name, comment=self._group.name, common_timebase=True
        )


def _texts(channel: Channel) -> dict[str, object] | None:
    """Return the texts of a code's values as asammdf takes them; None if it is no code."""
    if channel.texts is None:
        return None
    names: dict[str, object] = {"default_addr": b"unknown"}
    for index, (value, text) in enumerate(channel.texts.items()):
        names |= {f"val_{index}": value, f"text_{index}": text.encode()}
    return names
