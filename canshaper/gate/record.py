"""The gate's record of a machine: identifiers, bits and limits. ``build.py`` fills it in once.

Nothing here changes while the machine runs but three limits of an axis, see ``Gate.set``.
"""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field

from canshaper.gate.checks import Check, E2e
from canshaper.gate.fields import Command, Field, Opening, Stick, Word

Key = tuple[str, int, bool]
"""Name of the bus, identifier, and whether that has 29 bits."""


@dataclass(frozen=True, slots=True)
class Protection:
    """Protection of a message.

    Attributes:
        check: of its content; None for nothing, or for what is not ``known``.
        known: whether the gate knows its checksum; of one of another package it does not.
        counter, counts: alive counter and its values; with E2E the counter is in its header.
    """

    check: Check | None = None
    known: bool = True
    counter: Field | None = None
    counts: int = 0

    def right(self, data: bytes) -> bool:
        """Whether a frame of the right length carries what it should."""
        return self.check is None or self.check.right(data)

    def count(self, data: bytes, word: Word) -> int:
        """The alive counter of a frame; 0 where it has none."""
        if self.counter is not None:
            return int(self.counter.raw(word))
        return self.check.count(data) if isinstance(self.check, E2e) else 0


@dataclass(frozen=True, slots=True)
class Message:
    """A message that is received.

    Attributes:
        ids: its identifiers, in J1939 with every priority; none where any address may send it.
        group: instead of them mask and value of the group.
        own: our own address on that bus, which no one else may use; -1 for none.
        most_step: largest step of the counter that is still the next one.
        qualify: good frames in a row that are needed at the start and after a wrong one.
        page: of a multiplexed message the multiplexor, and its value in the frames that are meant.
        alone: whether counter or checksum are in these frames only.
    """

    name: str
    bus: str
    ids: frozenset[int]
    extended: bool
    length: int
    timeout_ns: int
    protection: Protection
    most_step: int = 0
    qualify: int = 1
    page: tuple[Field, int] | None = None
    alone: bool = False
    group: tuple[int, int] | None = None
    own: int = -1


@dataclass(frozen=True, slots=True)
class Switch:
    """A switch that has to agree.

    Attributes:
        message: name of its message.
        on: raw value that agrees.
        only_zero: only 0 says that it is released; another value is an error code.
    """

    message: str
    field: Field
    on: int
    only_zero: bool = False


@dataclass(frozen=True, slots=True)
class Joystick:
    """A joystick.

    Attributes:
        message: name of its message.
        pressed: the switch that is pressed to enable it.
        own: whether that is in its own message.
        others: the other switches that enable it.
        reset: signal that resets a trip.
        bypass: signal that switches anti-sway off.
        stuck_ns: longest deflection without a change.
    """

    message: str
    pressed: Switch
    own: bool
    others: tuple[Switch, ...]
    reset: Field | None
    bypass: Field | None
    stuck_ns: int


@dataclass(slots=True)
class Axis:
    """One axis and its limits. Speeds are parts of full speed, times are periods of its valve.

    Attributes:
        signal: of the joystick, as the file names it.
        period: ticks from one command to the next; ``period_s`` the same in seconds.
        maximum: fastest output.
        rise, fall: fastest change of the output, in a period.
        tail: for how long the output may stay as fast as was asked.
        stop: longest shaped stop.
        silent: ticks without a frame after which the valve closes.
        faster, reverse: what the file allows beyond that.
        reversal: for how long the output may run on against a stick that is held.
        stop_m: how far the tip may travel when it stops, ``tip_m_s`` its full speed where that is
            not ``full_m_s``; ``run_on`` the distance in full speed times seconds.
        slack: how far a sound filter may run ahead of what was asked, full speed times seconds.
        forwarded: its command leaves in the frames of its own joystick, through a gateway.
        partner: the axis that adds velocity to this one; empty for none.
        added: largest velocity that is added where no one asks.
        most_periods: longest motion of that kind.
        path_m: farthest way of it; 0 for no bound. ``path`` is the same in full speed times
            seconds, and ``full_m_s`` full speed.
        ranges: ends of the numbers that may be set while the machine runs, as in the file.
        step: most that one step of the frame changes the velocity.
    """

    name: str
    joystick: str
    signal: str
    stick: Stick
    valve: Key
    command: Command
    openings: tuple[Opening, Opening]
    period: int
    period_s: float
    maximum: float
    rise: float
    fall: float
    tail: int
    stop: int
    silent: int
    faster: bool
    reverse: bool
    reversal: int
    slack: float
    forwarded: bool
    partner: str = ""
    added: float = 0.0
    most_periods: int = 0
    path_m: float = 0.0
    full_m_s: float = 1.0
    stop_m: float = math.inf
    tip_m_s: float = 0.0
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    step: float = field(init=False)
    path: float = field(init=False)
    run_on: float = field(init=False)

    def __post_init__(self) -> None:
        self.step = max(slope for one in self.openings for slope in one.slopes)
        self._scale()

    def set(self, key: str, value: float) -> None:
        """A number was changed, never beyond the range of the file; without one it stays."""
        if key not in self.ranges or math.isnan(value):
            return
        low, high = self.ranges[key]
        value = min(max(value, low), high)
        if key == "limits.max_pct":
            self.maximum = value / 100.0
        elif key == "limits.rise_per_s":
            self.rise = value * self.period_s
        elif key == "limits.fall_per_s":
            self.fall = value * self.period_s
        elif key == "sway.full_speed_m_s":
            self.full_m_s = value
            self._scale()

    def _scale(self) -> None:
        self.path = self.path_m / self.full_m_s
        self.run_on = self.stop_m / (self.tip_m_s or self.full_m_s)


@dataclass(frozen=True, slots=True)
class Valve:
    """A valve message: what it looks like apart from its commands.

    Attributes:
        fixed, fixed_value: bits that never change, byte 0 the lowest, and what they are.
        ours: bits that may differ from the joystick's frame that this one was made from.
        words: signals with the values that they may have, such as a control word of CiA 408.
        own: of a frame of our own in the place of a joystick's: signals with their values.
        enable: in such a frame the switch, which may be 1 only while it is held.
        group: mask of its group in J1939, which no other address may send; 0 for none.
    """

    length: int
    axes: tuple[str, ...]
    fixed: int
    fixed_value: int
    ours: int
    protection: Protection
    words: tuple[tuple[Field, frozenset[int]], ...] = ()
    own: tuple[tuple[Field, frozenset[float]], ...] = ()
    enable: Field | None = None
    group: int = 0


@dataclass(frozen=True, slots=True)
class Record:
    """All that the gate knows.

    Attributes:
        stop: the emergency stop.
        others: what may leave besides: lengths, and contents where only those may.
        places: interface and channel of each bus: what it is, whatever the file calls it.
        listens: another controller sends the valve frames, and none of ours leaves.
    """

    messages: dict[str, Message]
    joysticks: dict[str, Joystick]
    axes: dict[str, Axis]
    valves: dict[Key, Valve]
    stop: Switch | None
    others: dict[Key, tuple[frozenset[int], frozenset[bytes]]]
    places: dict[str, Hashable]
    listens: bool = False

    @property
    def unchecked(self) -> list[str]:
        """Messages whose checksum is of another package, which the gate does not know."""
        received = [name for name, one in self.messages.items() if not one.protection.known]
        valves = [one for one in self.valves.values() if not one.protection.known]
        return received + [f"the valve of {' and '.join(one.axes)}" for one in valves]
