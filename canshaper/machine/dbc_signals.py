"""Faults of the signals of a message that no one uses, from its text in a DBC file.

Messages that are used are checked by cantools.
"""

import re

# Bytes of a message whose signals are compared: the most that ISO 15765-2 sends in one.
LONGEST = 4095
_GAP = r"[ \t\n]*+(?://[^\n]*\n[ \t\n]*+)*+"
_SIGNAL = re.compile(
    _GAP.join((r"SG_\b", r"(\w++)", r"(\w*+)", ":", r"([^ \t\n|/]++)", r"\|")).encode()
    + _GAP.join(("", r"([^ \t\n@/]++)", "@", r"(\d++)")).encode()
)
_NUMBER = re.compile(rb"\d{1,5}")


def signals_fault(text: bytes, length: int) -> tuple[list[bytes], str | None]:
    """Names of the signals of a message, and the first fault or None.

    Args:
        text: the signals of the message.
        length: bytes of the message.
    """
    rows = _SIGNAL.findall(text)
    fault = _fault(rows, length) if length <= LONGEST else None
    return [row[0] for row in rows], fault


def _fault(rows: list[tuple[bytes, ...]], length: int) -> str | None:
    multiplexers = sum(mark.endswith(b"M") for _, mark, *_ in rows)
    every = 0  # bits that any signal has; the lowest bit of the first byte is the lowest
    used: dict[bytes, int] = {b"": 0}  # those of each value of the multiplexer
    masks: list[tuple[bytes, int]] = []
    names: set[tuple[bytes, bytes]] = set()
    for name, mark, first, count, order in rows:
        mask = _mask(first, count, order, length)
        if mask is None:
            return f"has {length} bytes, and the signal {name.decode()} is not within them"
        chosen = b"" if mark.endswith(b"M") else mark
        if multiplexers > 1 and mark.startswith(b"m"):
            continue  # which of them exclude each other is not said here
        if (name, chosen) in names:
            return f"has two signals of the name {name.decode()}"
        names.add((name, chosen))
        before = used[b""] | used.get(chosen, 0) if chosen else every
        if before & mask:
            other = next(n for n, m in masks if m & mask & before)
            return f"has overlapping signals, {other.decode()} and {name.decode()}"
        used[chosen] = used.get(chosen, 0) | mask
        every |= mask
        masks.append((name, mask))
    return None


def _mask(first: bytes, count: bytes, order: bytes, length: int) -> int | None:
    """Bits of a signal in its message, or None where it has others."""
    if not (_NUMBER.fullmatch(first) and _NUMBER.fullmatch(count)):
        return None
    begin, bits = int(first), int(count)
    if order == b"0":  # from the highest bit downwards, and on in the next byte
        begin = begin // 8 * 8 + 7 - begin % 8
    left = 8 * length - begin - bits
    if bits == 0 or left < 0:
        return None
    ones = (1 << bits) - 1
    if order == b"0":
        return int.from_bytes((ones << left).to_bytes(length, "big"), "little")
    return ones << begin
