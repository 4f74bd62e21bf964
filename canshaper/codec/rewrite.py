"""Joystick frames that a gateway forwards with other velocities, by us or by can-gw."""

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
        bus: name of the other bus.
        message: definition of the message in the DBC.
        source: source address of a J1939 message.
        protection: protection of its frames, which we compute again.
        enable: name of the signal of its enable switch.
        ours: names of the signals that the axes write.

    Attributes:
        start: raw value of every signal in a frame of our own: neutral for the axes, rest or "not
            available" for all others.
        enable: name of the signal of its enable switch.
        ours: names of the signals that the axes write.
        ours_mask: mask of the bits of ``ours``, byte 0 the lowest.
        mask_of_all: ``ours_mask`` and the bits of the alive counter.
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
        """Return the mask of the bits of these signals, byte 0 the lowest."""
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
        """Return the bits of ``ours`` at neutral, byte 0 the lowest."""
        return int.from_bytes(self.fields.layout.encode(self.start), "little") & self.ours_mask

    def sender(self) -> "RewritingSender":
        """Return a new sender of this message, with the counter at its first value."""
        return RewritingSender(self)


class RewritingSender(Sender):
    """Builds what leaves: joystick frames with our velocities, own frames where none comes."""

    def __init__(self, message: RewrittenMessage) -> None:
        super().__init__(message)
        self._mask, self._length = message.mask_of_all, message.fields.message.length
        self._enable, self._start = message.enable, message.fields.start[message.enable]

    def onto(self, data: bytes) -> Frame:
        """Return the next frame: the joystick's ``data`` with our velocities and protection."""
        ours = int.from_bytes(self.frame().data, "little") & self._mask
        word = int.from_bytes(data, "little") & ~self._mask | ours
        changed = word.to_bytes(self._length, "little")
        if self._check is not None:
            changed = self._check.protect(changed, self._count)
        return new_frame(Frame, (*self.key, changed))

    def instead(self, frame: Frame) -> Frame:
        """Return ``frame``, which was not sent, with the axes' present velocities and its count."""
        self.take_back()
        return self.onto(frame.data)

    def own(self, *, enabled: bool) -> Frame:
        """Return a frame of our own: velocities now, enable 1 or its start value, all else rest."""
        self.raw[self._enable] = 1 if enabled else self._start
        return self.frame()


def _at_rest(signal: Signal, start: Any) -> Any:
    """Return the raw value of 0 if the range has both signs and start is no fault; else start."""
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
# linux/can/gw.h: CRC over the bytes only; or also over a byte chosen by the low half of byte 1.
PLAIN, BY_COUNTER = 0, 2


def neutral_fault(protection: Protection, length: int) -> str | None:
    """Return why can-gw cannot protect a changed frame of ``length`` bytes again, or None."""
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
    """Return (type, content) of can-gw's attributes, and a mask of bits that must be 0 before.

    ``neutral_fault`` has no objection. In the mask byte 0 is the lowest.
    """
    check = protection.check
    last = length - 1
    if check is None:
        return (), 0
    if isinstance(check, Checksum):
        kernel = CHECKSUMS[check.kind].kernel
        if isinstance(kernel, Xor):
            # can-gw includes the checksum's own byte, which therefore must be 0 before.
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
