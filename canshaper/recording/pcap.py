"""Captures of SocketCAN by tcpdump and Wireshark: pcap and pcapng (draft-ietf-opsawg-pcapng)."""

import struct
from collections.abc import Iterator
from io import BufferedReader

from canshaper.codec.frame import ERR_FLAG, RTR_FLAG, id_of
from canshaper.recording.channels import MOST_BYTES, Place, TimedFrame

SOCKETCAN = 227  # its link type
UNITS_NS = {0xA1B2C3D4: 1000, 0xA1B23C4D: 1}  # by the first number of a pcap
SECTION, INTERFACE, PACKET = b"\n\r\r\n", 1, 6
NAME, RESOLUTION = 2, 9  # options of an interface
MOST_BLOCK = 1 << 24


def pcap(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    """Either of them, by its first bytes."""
    head = file.peek(4)[:4]
    try:
        if head == SECTION:
            yield from _blocks(file, place)
            return
        for order, name in (("<", "little"), (">", "big")):
            if unit_ns := UNITS_NS.get(int.from_bytes(head, name)):  # type: ignore[arg-type]
                yield from _records(file, place, order, unit_ns)
                return
    except (struct.error, IndexError, OverflowError):
        raise place.error("a damaged part", "a capture that is whole") from None
    raise place.error(f"the first bytes {head!r}", "a capture: pcap or pcapng")


def _read(file: BufferedReader, place: Place, count: int) -> bytes:
    data = file.read(min(count, MOST_BLOCK))
    if len(data) < count:
        raise place.cut_off("its last part is not whole")
    return data


def _records(file: BufferedReader, place: Place, order: str, unit_ns: int) -> Iterator[TimedFrame]:
    _check_link(struct.unpack(f"{order}20xL", _read(file, place, 24))[0] & 0xFFFF, place)
    while file.peek(1):
        second, part, count, _ = struct.unpack(f"{order}4L", _read(file, place, 16))
        time_ns = second * 1_000_000_000 + part * unit_ns
        yield from _frame(_read(file, place, count), time_ns, "", place)


def _blocks(file: BufferedReader, place: Place) -> Iterator[TimedFrame]:
    order, interfaces = "<", list[tuple[str, int]]()
    while file.peek(1):
        head = _read(file, place, 12)
        if head[:4] == SECTION:  # in its own order of bytes
            order, interfaces = "<" if head[8] == 0x4D else ">", []
        kind, length = struct.unpack_from(f"{order}2L", head)
        body = head[8:] + _read(file, place, max(length - 12, 0))
        if kind == INTERFACE:
            _check_link(struct.unpack_from(f"{order}H", body)[0], place)
            interfaces.append(_interface(body, order, str(len(interfaces))))
        elif kind == PACKET:
            number, high, low, count = struct.unpack_from(f"{order}4L", body)
            name, per_s = interfaces[number]
            time_ns = ((high << 32) + low) * 1_000_000_000 // per_s
            yield from _frame(body[20 : 20 + count], time_ns, name, place)


def _interface(body: bytes, order: str, name: str) -> tuple[str, int]:
    """Name of an interface, and units of its times in a second."""
    per_s, at = 1_000_000, 8
    while at + 8 <= len(body):
        code, count = struct.unpack_from(f"{order}2H", body, at)
        value = body[at + 4 : at + 4 + count]
        if code == NAME:
            name = value.decode("utf-8", "replace").strip("\0")
        elif code == RESOLUTION:
            per_s = 2 ** (value[0] & 0x7F) if value[0] & 0x80 else 10 ** value[0]
        at += 4 + count + -count % 4
    return name, per_s


def _check_link(link: int, place: Place) -> None:
    if link != SOCKETCAN:
        expected = f"{SOCKETCAN}, SocketCAN (capture at one interface, such as can0, not any)"
        raise place.error(f"the link type {link}", expected)


def _frame(data: bytes, time_ns: int, channel: str, place: Place) -> Iterator[TimedFrame]:
    """The data frame of a packet, if it is one."""
    place.number += 1
    word = int.from_bytes(data[:4])
    if len(data) < 8 or not data[4] <= min(len(data) - 8, MOST_BYTES):
        place.left_out["impossible"] += 1
    elif word & (ERR_FLAG | RTR_FLAG):
        place.left_out["error" if word & ERR_FLAG else "remote"] += 1
    else:
        yield TimedFrame(time_ns, channel, *id_of(word), data[8 : 8 + data[4]])
