"""Frames that are forwarded: how their bytes change, and whether the kernel can do it."""

import struct
from typing import Any

from cantools.database.can import Message, Signal

from canshaper.checksums.algorithms import AUTOSAR, SAE_J1850, Crc8, Xor
from canshaper.checksums.kinds import CHECKSUMS, Checksum
from canshaper.codec.e2e import Profile1, Profile2, Profile4, Profile5
from canshaper.codec.frame import Frame, new_frame
from canshaper.codec.message import Protection, Sender, SentMessage
from canshaper.codec.signals import named_fault, raw_limits


class RewrittenMessage(SentMessage):
    """The message of a joystick as it leaves on the other bus.

    Args:
        bus: name of that bus.
        message: its definition.
        source: its source address, where it is one of J1939.
        protection: that of its frames, computed again.
        enable: name of its enable switch.
        ours: names of the signals that the axes put in.

    Attributes:
        start: raw value of every signal in a frame of our own: neutral for the axes, rest or "not
            available" for all others.
        enable: name of its enable switch.
        ours: names of the signals that the axes put in.
        ours_mask: bits of the velocities, byte 0 the lowest.
        mask_of_all: ``ours_mask`` with the bits of the alive counter.
    """

    rewrites = True

    def __init__(
        self,
        bus: str,
        message: Message,
        source: int | None,
        protection: Protection,
        *,
        enable: str,
        ours: frozenset[str],
    ) -> None:
        super().__init__(bus, message, source, protection)
        self.ours, self.enable = ours, enable
        for signal in message.signals:
            self.start[signal.name] = _at_rest(signal, self.start[signal.name])
        self.ours_mask = self._mask(ours)
        counter = protection.counter
        self.mask_of_all = self.ours_mask | (self._mask({counter}) if counter else 0)

    def _mask(self, names: frozenset[str] | set[str]) -> int:
        """Bits of these signals."""
        zeros: dict[str, Any] = dict.fromkeys(self.start, 0)
        message, layout = self.fields.message, self.fields.layout
        ones = {
            s.name: -1 if s.is_signed else raw_limits(s)[1]
            for s in message.signals
            if s.name in names
        }
        low, high = (layout.encode({**zeros, **some}) for some in ({}, ones))
        return int.from_bytes(low, "little") ^ int.from_bytes(high, "little")

    def neutral_bits(self) -> int:
        """The velocities of a machine that stands, byte 0 the lowest."""
        return int.from_bytes(self.fields.layout.encode(self.start), "little") & self.ours_mask

    def sender(self) -> "RewritingSender":
        """Make its sender, with the counter at the beginning."""
        return RewritingSender(self)


class RewritingSender(Sender):
    """Sender of the rewritten message: in place of joystick frames, and where none comes."""

    def __init__(self, message: RewrittenMessage) -> None:
        super().__init__(message)
        self._mask, self._length = message.mask_of_all, message.fields.message.length
        self._enable, self._start = message.enable, message.fields.start[message.enable]

    def onto(self, data: bytes) -> Frame:
        """Return the next frame: the joystick's with our velocities, protected again."""
        ours = int.from_bytes(self.frame().data, "little") & self._mask
        word = int.from_bytes(data, "little") & ~self._mask | ours
        changed = word.to_bytes(self._length, "little")
        if self._check is not None:
            changed = self._check.protect(changed, self._count)
        return new_frame(Frame, (*self.key, changed))

    def instead(self, frame: Frame) -> Frame:
        """Return the frame again, with the axes' present velocities and the same count."""
        self.take_back()
        return self.onto(frame.data)

    def own(self, *, enabled: bool) -> Frame:
        """Return a frame without one of the joystick: nothing in it is older than the axes."""
        self.raw[self._enable] = 1 if enabled else self._start
        return self.frame()


def _at_rest(signal: Signal, start: Any) -> Any:
    """Raw value that asks for nothing: the start value, and no velocity but 0."""
    low, high = signal.minimum, signal.maximum
    name = str((signal.choices or {}).get(start, ""))
    if low is None or high is None or not low < 0 < high or named_fault(name):
        return start
    rest = 0.0 - signal.offset / signal.scale
    return rest if signal.is_float else round(rest)


# linux/can/gw.h: attributes of a rule that compute a checksum.
CS_XOR, CS_CRC8 = 5, 6
_XOR = struct.Struct("=bbbB")  # cgw_csum_xor
_CRC8 = struct.Struct("=bbbBB256sB20s")  # cgw_csum_crc8
# linux/can/gw.h: no more than the bytes; a byte by the low half of byte 1 after them.
PLAIN, BY_COUNTER = 0, 2


def neutral_fault(protection: Protection, length: int) -> str | None:
    """Why the kernel cannot protect a frame of so many bytes again that it has changed, or None."""
    check = protection.check
    if isinstance(check, Checksum):
        kernel = CHECKSUMS[check.kind].kernel
        if kernel is None:
            return f"can-gw of the kernel knows no checksum of the kind {check.kind}"
        if isinstance(kernel, Crc8) and check.byte not in (0, length - 1):
            return f"can-gw of the kernel computes {check.kind} in the first or last byte only"
    if isinstance(check, Profile4 | Profile5):
        return "can-gw of the kernel knows no CRC of more than 8 bits"
    if isinstance(check, Profile1) and check.starts[0] != check.starts[1]:
        return "can-gw of the kernel knows no data ID that alternates"
    return None


def kernel_check(protection: Protection, length: int) -> tuple[tuple[tuple[int, bytes], ...], int]:
    """The check as can-gw computes it, and bits that have to be 0 before; no ``neutral_fault``."""
    check = protection.check
    last = length - 1
    if check is None:
        return (), 0
    if isinstance(check, Checksum):
        kernel = CHECKSUMS[check.kind].kernel
        if isinstance(kernel, Xor):
            # Over all bytes, its own among them, which therefore is 0 before.
            return ((CS_XOR, _XOR.pack(0, last, check.byte, kernel.start)),), 0xFF << 8 * check.byte
        assert kernel is not None
        first = 1 if check.byte == 0 else 0
        return _crc8(kernel, (first, last - 1 + first, check.byte), kernel.start, kernel.end), 0
    if isinstance(check, Profile1):
        return _crc8(SAE_J1850, (1, last, 0), check.starts[0], 0), 0
    assert isinstance(check, Profile2)
    ids = b"".join(check.ids)
    return _crc8(AUTOSAR, (1, last, 0), AUTOSAR.start, AUTOSAR.end, ids), 0


def _crc8(
    crc: Crc8, places: tuple[int, int, int], start: int, end: int, by_counter: bytes = b""
) -> tuple[tuple[int, bytes], ...]:
    profile = BY_COUNTER if by_counter else PLAIN
    return ((CS_CRC8, _CRC8.pack(*places, start, end, crc.table, profile, by_counter)),)
