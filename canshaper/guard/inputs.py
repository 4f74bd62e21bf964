"""What the output guard notes of joysticks and emergency stop: from their bytes alone.

What one frame says is believed as far as one frame goes: its length and its checksum have to be
right. Its alive counter is not looked at, so that a frame which the controller refuses for it may
raise what the guard allows, never what the controller does.
"""

from collections import deque

from canshaper.guard.bits import Field, StickBits, span_of
from canshaper.machine.inputs import BoundInput

NEVER = -(10**18)  # ns
Sizes = deque[tuple[float, int]]
"""Each with the time when it was asked for last, the largest first, each later one smaller."""


class Asked:
    """What a stick asks of one axis, and asked of late: amortised constant time.

    Attributes:
        now: what its last frame asks, [-1, 1].
        positive, negative: sizes that it asked before in each direction.
        good_ns: until when the last command may leave again, if nothing forbids it meanwhile.
    """

    __slots__ = ("good_ns", "negative", "now", "positive")

    def __init__(self) -> None:
        self.now = 0.0
        self.good_ns = 0
        self.positive: Sizes = deque()
        self.negative: Sizes = deque()

    def change(self, ask: float, until_ns: int) -> None:
        """Something else is asked; what was asked before, was until then."""
        before, self.now = self.now, ask
        if before in (0.0, ask):
            return
        size, sizes = (before, self.positive) if before > 0.0 else (-before, self.negative)
        while sizes and sizes[-1][0] <= size:
            sizes.pop()
        sizes.append((size, until_ns))

    def clear(self) -> None:
        """Nothing was asked."""
        self.now, self.good_ns = 0.0, 0
        self.positive.clear()
        self.negative.clear()


def largest(sizes: Sizes, since_ns: int) -> float:
    """The largest since a time that does not go back; 0 where there is none."""
    while sizes and sizes[0][1] < since_ns:
        sizes.popleft()
    return sizes[0][0] if sizes else 0.0


class GuardedInput:
    """Frames of one message: right length, right checksum, and from one sender.

    Attributes:
        timeout_ns: age at which the message counts as lost.
        heard_ns: when the last one came.
    """

    __slots__ = ("_check", "_length", "_source", "_source_ns", "heard_ns", "timeout_ns")

    def __init__(self, bound: BoundInput) -> None:
        self._length = bound.message.length
        self._check = bound.protection.check
        self.timeout_ns = bound.config.timeout_ms * 1_000_000
        self._source: int | None = None
        self._source_ns = 0
        self.heard_ns = NEVER

    def from_other(self, source: int, now_ns: int) -> bool:
        """Whether the message is taken from another address, which is not silent yet (J1939)."""
        if source != self._source:
            if self._source is not None and now_ns - self._source_ns <= self.timeout_ns:
                return True
            self._source = source
        self._source_ns = now_ns
        return False

    def note(self, data: bytes, now_ns: int) -> None:
        """Take a frame."""
        raise NotImplementedError


class GuardedStop(GuardedInput):
    """The emergency stop.

    Attributes:
        pressed: as its last frame says.
        stops: what it forbids.
    """

    __slots__ = ("_field", "pressed", "stops")

    def __init__(self, bound: BoundInput, signal: str) -> None:
        super().__init__(bound)
        message = bound.message
        self._field = Field(message.get_signal_by_name(signal), message.length)
        self.pressed = False
        self.stops: list[Asked] = []

    def note(self, data: bytes, now_ns: int) -> None:
        """Take a frame."""
        if len(data) == self._length and not (self._check and not self._check.right(data)):
            self.heard_ns = now_ns
            self.pressed = self._field.raw(data) != 0
            if self.pressed:
                for asked in self.stops:
                    asked.good_ns = 0

    def free_ns(self) -> int:
        """Until when something may move: it is free, and was heard within its timeout."""
        return NEVER if self.pressed else self.heard_ns + self.timeout_ns


class GuardedJoystick(GuardedInput):
    """A joystick: its enable, and what it asks of its axes.

    Attributes:
        released: whether its last frame says that enable is released.
    """

    __slots__ = ("_bits", "_bytes", "_enable", "_part", "_sticks", "released")

    def __init__(self, bound: BoundInput, enable: str) -> None:
        super().__init__(bound)
        message = bound.message
        self._enable = Field(message.get_signal_by_name(enable), message.length)
        self._bits = self._enable.bits
        self._bytes = span_of(self._bits)
        self._part = b""
        self._sticks: list[tuple[StickBits, Asked]] = []
        self.released = False

    def drives(self, stick: StickBits, asked: Asked) -> None:
        """A stick of it commands an axis."""
        self._sticks.append((stick, asked))
        for field in stick.fields:
            self._bits |= field.bits
        self._bytes = span_of(self._bits)

    def note(self, data: bytes, now_ns: int) -> None:
        """Take a frame."""
        if len(data) != self._length or (self._check and not self._check.right(data)):
            return
        part = data[self._bytes]
        if part != self._part:
            self._part = part
            self.released = self._enable.raw(data) == 0
            for stick, asked in self._sticks:
                asked.change(stick.ask(data), self.heard_ns)
                if self.released:
                    asked.good_ns = 0
        self.heard_ns = now_ns

    def clear(self) -> None:
        """Nothing was asked until now."""
        self._part = b""
        for _, asked in self._sticks:
            asked.clear()
