"""Protection of a message: checksum and alive counter, as AUTOSAR E2E and simpler schemes use them.

The rule of the counter is that of E2E: a step of 1 up to a largest one is good (some were lost), 0
is a repetition and no news, a larger one is a wrong sequence.
"""

from collections.abc import Callable
from functools import reduce
from operator import xor

from crccheck.crc import Crc8Autosar, Crc8Base, Crc8SaeJ1850

from canshaper.can.frame import FrameFault


def _crc8(crc: type[Crc8Base]) -> Callable[[bytes], int]:
    """The same CRC from a table of 256 entries: the library works bit by bit."""
    end: int = crc.calc(b"", initvalue=0)
    start: int = crc.calc(b"") ^ end
    table = bytes(crc.calc(bytes([i]), initvalue=0) ^ end for i in range(256))

    def check(data: bytes) -> int:
        value = start
        for byte in data:
            value = table[value ^ byte]
        return value ^ end

    return check


CHECKSUMS: dict[str, Callable[[bytes], int]] = {
    "xor": lambda data: reduce(xor, data, 0),
    "sum": lambda data: sum(data) & 0xFF,
    "crc8_sae_j1850": _crc8(Crc8SaeJ1850),
    "crc8_autosar": _crc8(Crc8Autosar),
}
"""Eight-bit checksums by name, over all bytes of a frame but the one that holds the checksum."""

GOOD = FrameFault.NONE  # by way of the class it takes ten times as long


class Guard:
    """Judges the frames of one message.

    Args:
        counter_range: values of the alive counter; 0 where the message has none.
        max_step: largest step of the counter that is still the next one.
        checksum: name of the checksum and the byte that holds it, or None.
        qualify: good frames in a row that are needed at the start and after a wrong one.

    Attributes:
        qualified: whether the last frame, found good, may be used: enough have come in a row.
    """

    def __init__(
        self,
        counter_range: int,
        max_step: int,
        checksum: tuple[str, int] | None,
        qualify: int,
    ) -> None:
        self._range = counter_range
        self._max_step = max_step
        self._checksum = CHECKSUMS[checksum[0]] if checksum else None
        self._byte = checksum[1] if checksum else 0
        self._qualify = qualify
        self._last: int | None = None
        self._anew = True
        self._good = 0
        self.qualified = False

    def begin_anew(self) -> None:
        """The sender was silent: its next counter may be any but the last one."""
        self._anew = True
        self._qualify_anew()

    def judge(self, data: bytes, count: int) -> FrameFault:
        """What is wrong with a frame of the right length whose alive counter is ``count``."""
        if self._checksum is not None:
            at = self._byte
            if self._checksum(data[:at] + data[at + 1 :]) != data[at]:
                self._qualify_anew()
                return FrameFault.CHECKSUM
        if self._range:
            last, self._last = self._last, count
            anew, self._anew = self._anew, False
            if last is not None:
                step = (count - last) % self._range
                if step == 0:
                    self._anew = anew
                    return FrameFault.COUNTER_REPEATED
                if step > self._max_step and not anew:
                    self._qualify_anew()
                    return FrameFault.COUNTER_JUMP
        self._good += 1
        self.qualified = self._good >= self._qualify
        return GOOD

    def _qualify_anew(self) -> None:
        self._good = 0
        self.qualified = False
