"""What the output guard notes of joysticks and emergency stop: from their bytes alone.

What one frame says is believed as far as one frame goes: its length and its checksum have to be
right. Its alive counter is not looked at, so that a frame which the controller refuses for it may
raise what the guard allows, never what the controller does.
"""

from abc import ABC, abstractmethod
from collections import deque

from canshaper.guard.bits import MOST_KNOWN, Field, JoystickBits, span_of
from canshaper.machine.inputs import BoundInput

NEVER, FOREVER = -(10**18), 10**19  # ns
NEUTRAL, FORTH, BACK = range(3)
Sizes = deque[tuple[float, int]]
"""Each with the time when it was commanded last, the largest first, each later one smaller."""
# Frames of a joystick whose commands are read together; not so many that the last one waits.
MOST_UNREAD = 32


class CommandedAxis:
    """An axis as its joystick commands it, now and of late: amortised constant time.

    Attributes:
        now: command of the last frame, [-1, 1].
        positive, negative: sizes commanded before in each direction, where the next one was less.
        joystick: how its frames are read.
        joystick_commands: those that were read, by their bytes.
        valid_until_ns: until when the last command may leave again, if nothing forbids it
            meanwhile.
        demanded: whether something else stands for its joystick, see ``GuardedAxis.demand``.
        sure, sure_ns: speed that was commanded at least in the direction of the last command, and
            until when that holds, if nothing forbids it meanwhile.
    """

    __slots__ = (
        "demanded",
        "joystick",
        "joystick_commands",
        "negative",
        "now",
        "positive",
        "sure",
        "sure_ns",
        "valid_until_ns",
    )

    def __init__(self, joystick: JoystickBits) -> None:
        self.joystick = joystick
        self.joystick_commands: dict[bytes, float] = {}
        self.now = 0.0
        self.demanded = False
        self.positive: Sizes = deque()
        self.negative: Sizes = deque()
        self.sure, self.sure_ns = 0.0, NEVER
        self.valid_until_ns = NEVER

    def learn(self, data: bytes) -> float:
        """Read the command in a frame."""
        if len(self.joystick_commands) >= MOST_KNOWN:
            self.joystick_commands.clear()
        command = self.joystick_commands[data[self.joystick.span]] = self.joystick.command(data)
        return command

    def take(self, command: float, until_ns: int) -> None:
        """The next command; the one before held until then."""
        before = self.now
        # More than before in the same direction: the one before is no bound any more.
        if command < before > 0.0:
            keep(self.positive, before, until_ns)
        elif command > before < 0.0:
            keep(self.negative, -before, until_ns)
        self.now = command

    def forbid(self) -> None:
        """Nothing holds that was looked up before."""
        self.valid_until_ns = self.sure_ns = NEVER

    def clear(self) -> None:
        """Nothing was commanded."""
        self.now = 0.0
        self.positive.clear()
        self.negative.clear()
        self.forbid()


def keep(sizes: Sizes, size: float, until_ns: int) -> None:
    """So much was commanded until then."""
    while sizes and sizes[-1][0] <= size:
        sizes.pop()
    sizes.append((size, until_ns))


def largest(sizes: Sizes, since_ns: int) -> float:
    """The largest since a time that does not go back; 0 where there is none."""
    while sizes and sizes[0][1] < since_ns:
        sizes.popleft()
    return sizes[0][0] if sizes else 0.0


class GuardedInput(ABC):
    """Frames of one message: right length, right checksum, and from one sender.

    Attributes:
        timeout_ns: age at which the message counts as lost.
        received_ns: when the last one came.
    """

    __slots__ = (
        "_check",
        "_choice",
        "_length",
        "_plain",
        "_source",
        "_source_ns",
        "received_ns",
        "timeout_ns",
    )

    def __init__(self, bound: BoundInput) -> None:
        self._length = bound.message.length
        self._check = bound.protection.check
        self._choice: tuple[Field, int] | None = None
        if chosen := bound.chosen:
            signal = bound.message.get_signal_by_name(chosen.signal)
            self._choice = Field(signal, self._length), chosen.value
        self._plain = self._check is None and self._choice is None
        self.timeout_ns = bound.config.timeout_ms * 1_000_000
        self._source: int | None = None
        self._source_ns = 0
        self.received_ns = NEVER

    def from_other(self, source: int, now_ns: int) -> bool:
        """Whether the message is taken from another address, which is not silent yet (J1939)."""
        if source != self._source:
            if self._source is not None and now_ns - self._source_ns <= self.timeout_ns:
                return True
            self._source = source
        self._source_ns = now_ns
        return False

    def accepts(self, data: bytes) -> bool:
        """Whether a frame of the right length is right in itself, and of those that are meant."""
        if self._check and not self._check.verify(data):
            return False
        return self._choice is None or self._choice[0].raw(data) == self._choice[1]

    @abstractmethod
    def note(self, data: bytes, now_ns: int) -> None:
        """Take a frame."""


class GuardedSwitch:
    """A switch that has to agree: the emergency stop, or one that enables a joystick.

    Args:
        bound: its message.
        signal: its signal.
        on: raw value with which it agrees.
        limit: what it is, for the log.

    Attributes:
        free_ns: until when something may move: it agrees, and was received within its timeout.
        stops: what it forbids.
    """

    __slots__ = ("_field", "_on", "_timeout_ns", "free_ns", "limit", "stops")

    def __init__(self, bound: BoundInput, signal: str, on: int, limit: str) -> None:
        message = bound.message
        self._field = Field(message.get_signal_by_name(signal), message.length)
        self._on, self.limit = on, limit
        self._timeout_ns = bound.config.timeout_ms * 1_000_000
        self.free_ns = NEVER
        self.stops: list[CommandedAxis] = []

    def note(self, data: bytes, now_ns: int) -> None:
        """Take a frame that counts."""
        if self._field.raw(data) == self._on:
            self.free_ns = now_ns + self._timeout_ns
        else:
            self.free_ns = NEVER
            for axis in self.stops:
                axis.forbid()


class GuardedSwitches(GuardedInput):
    """A message with nothing but switches.

    Attributes:
        switches: them.
    """

    __slots__ = ("switches",)

    def __init__(self, bound: BoundInput) -> None:
        super().__init__(bound)
        self.switches: list[GuardedSwitch] = []

    def note(self, data: bytes, now_ns: int) -> None:
        """Take a frame."""
        if len(data) == self._length and (self._plain or self.accepts(data)):
            self.received_ns = now_ns
            for switch in self.switches:
                switch.note(data, now_ns)


class GuardedJoystick(GuardedInput):
    """A joystick: its enable, and the commands of its axes.

    Args:
        bound: its message.
        enable: signal of its own switch that is pressed to enable it, where it has that.

    Attributes:
        released: whether its last frame says that enable is released.
        switches: others in its message, that enable it or other joysticks.
        needed: the switches that enable it, but for its own.
    """

    __slots__ = (
        "_axes",
        "_bits",
        "_enable",
        "_part",
        "_span",
        "_switch",
        "_switched",
        "_unread",
        "needed",
        "released",
        "switches",
    )

    def __init__(self, bound: BoundInput, enable: str | None) -> None:
        super().__init__(bound)
        message = bound.message
        self._enable: Field | None = None
        self._bits, self._switch, self._switched = 0, slice(0, 0), b""
        if enable is not None:
            self._enable = Field(message.get_signal_by_name(enable), message.length)
            self._bits = self._enable.bits
            self._switch = span_of(self._bits)
        self._span = span_of(self._bits) if self._bits else self._switch
        self.switches: list[GuardedSwitch] = []
        self.needed: list[GuardedSwitch] = []
        self._part = b""
        self._unread: list[tuple[bytes, int]] = []  # and when the one before it came
        self._axes: list[tuple[slice, dict[bytes, float], CommandedAxis]] = []
        self.released = False

    def drives(self, axis: CommandedAxis) -> None:
        """A joystick of it commands an axis."""
        self._axes.append((axis.joystick.span, axis.joystick_commands, axis))
        for field in axis.joystick.fields:
            self._bits |= field.bits
        self._span = span_of(self._bits)

    def note(self, data: bytes, now_ns: int) -> None:
        """Take a frame: a switch counts at once, a command when it is looked at."""
        if len(data) != self._length or not (self._plain or self.accepts(data)):
            return
        for switch in self.switches:
            switch.note(data, now_ns)
        part = data[self._span]
        if part != self._part:
            self._part = part
            self._unread.append((data, self.received_ns))
            switched = data[self._switch]
            if switched != self._switched and self._enable is not None:
                self._switched = switched
                self.released = self._enable.raw(data) == 0
                if self.released:
                    for _, _, axis in self._axes:
                        axis.forbid()
            if len(self._unread) == MOST_UNREAD:
                self.read()
        # A stamp that lies back makes no frame before it older: the stop for it begins now.
        before_ns = self.received_ns
        self.received_ns = now_ns if now_ns > before_ns else before_ns

    def read(self) -> None:
        """Read the commands of the frames that came since this was called last."""
        for span, commands, axis in self._axes:
            if axis.demanded:
                continue
            for data, received_ns in self._unread:
                command = commands.get(data[span])
                if command is None:
                    command = axis.learn(data)
                axis.take(command, received_ns)
        self._unread.clear()

    def clear(self) -> None:
        """Nothing was commanded until now."""
        self._part = b""
        self._unread.clear()
        for _, _, axis in self._axes:
            axis.clear()
