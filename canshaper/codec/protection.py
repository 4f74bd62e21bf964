"""Protection of a message: alive counter and checksum, or a profile of AUTOSAR E2E.

The rule of the counter is that of E2E: a step of 1 up to a largest one is good (some were lost), 0
is a repetition and no news, a larger one is a wrong sequence.
"""

from dataclasses import dataclass
from typing import Any, Self

from canshaper.checksums.kinds import Checksum
from canshaper.codec.e2e import E2e
from canshaper.codec.frame import FrameFault
from canshaper.codec.layout import Layout

GOOD = FrameFault.NONE  # by way of the class it takes ten times as long


@dataclass(frozen=True, slots=True)
class Protection:
    """Protection of one message, as it is bound.

    Attributes:
        counter: signal of the alive counter, where it is one.
        counts: values of the counter, of that signal or of E2E; 0 where there is no counter.
        check: what protects the content.
    """

    counter: str | None = None
    counts: int = 0
    check: Checksum | E2e | None = None


UNPROTECTED = Protection()


class Protector:
    """Protects the frames of one message that is sent: the next counter, and its check.

    Args:
        protection: that of the message.
        layout: that of the message.
    """

    def __init__(self, protection: Protection, layout: Layout) -> None:
        self._counter, self._counts = protection.counter, protection.counts
        self._check = protection.check
        self._encode = layout.encode
        self._count = 0

    def copy_state(self, before: Self) -> None:
        """Go on with the counter where ``before`` stands; from 0 where it is another counter."""
        if (self._counter, self._counts) == (before._counter, before._counts):
            self._count = before._count

    def protect(self, raw: dict[str, Any]) -> bytes:
        """Return the next frame, protected.

        Args:
            raw: raw value of every signal, by name; that of the counter is changed.

        Raises:
            OverflowError: a value is not within the bits of its signal.
        """
        return self.add_check(self.without_check(raw))

    def without_check(self, raw: dict[str, Any]) -> bytes:
        """Return the next frame, as ``protect``, without its check."""
        if self._counts:
            self._count = (self._count + 1) % self._counts
            if self._counter is not None:
                raw[self._counter] = self._count
        return self._encode(raw)

    def take_back(self) -> None:
        """Reuse the count of the last frame, which did not leave, for the next one."""
        self._count = (self._count - 1) % self._counts if self._counts else 0

    def add_check(self, data: bytes) -> bytes:
        """Return the frame with the check for the present count."""
        return data if self._check is None else self._check.protect(data, self._count)


class SequenceChecker:
    """Checks the sequence and the content of the frames of one message that is received.

    Args:
        protection: that of the message.
        max_step: largest step of the counter that is still the next one.
        qualify: good frames in a row that are needed at the start and after a wrong one.

    Attributes:
        qualified: whether the last frame, found good, may be used: enough have come in a row.
    """

    def __init__(self, protection: Protection, max_step: int, qualify: int) -> None:
        self._protection = protection
        self._range = protection.counts
        self._max_step = max_step
        self._check = protection.check
        self._header = protection.check if isinstance(protection.check, E2e) else None
        self._qualify = qualify
        self._last: int | None = None
        self._resynced = True
        self._good = 0
        self.qualified = False

    def copy_state(self, before: Self) -> None:
        """Continue the sequence of the same message, where its protection is the same."""
        if self._protection == before._protection:
            self._last, self._resynced, self._good = before._last, before._resynced, before._good
            self.qualified = self._good >= self._qualify

    def resync(self) -> None:
        """Accept any counter but the last one next, because the sender was silent."""
        self._resynced = True
        self._requalify()

    def check(self, data: bytes, count: int) -> FrameFault:
        """Check a frame of the right length, and return its fault.

        Args:
            data: its bytes.
            count: value of its alive counter; E2E has one of its own, which counts instead.
        """
        if self._check is not None and not self._check.verify(data):
            self._requalify()
            return FrameFault.CHECKSUM
        if self._range:
            if self._header is not None:
                count = self._header.count(data)
            last = self._last
            self._last = count
            if last is not None:
                step = (count - last) % self._range
                if step == 0:
                    return FrameFault.COUNTER_REPEATED
                if step > self._max_step and not self._resynced:
                    self._requalify()
                    return FrameFault.COUNTER_JUMP
            self._resynced = False
        if not self.qualified:
            self._good += 1
            self.qualified = self._good >= self._qualify
        return GOOD

    def _requalify(self) -> None:
        self._good = 0
        self.qualified = False
