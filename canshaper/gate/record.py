"""The gate's record of a machine: identifiers, bits and limits. ``build.py`` fills it in once.

Nothing here changes while the machine runs but three limits of an axis, see ``Gate.set``.
"""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field

from canshaper.gate.checks import Checksum, E2e
from canshaper.gate.fields import Command, Field, Opening, Stick, Word

Key = tuple[str, int, bool]
"""Name of the bus, identifier, and whether that has 29 bits."""


@dataclass(frozen=True, slots=True)
class Protection:
    """Protection of a message."""

    check: Checksum | E2e | None = None  # of its content; None for nothing, or what is not known
    known: bool = True  # whether the gate knows its checksum; of another package it does not
    counter: Field | None = None  # alive counter; with E2E it is in the header
    counts: int = 0  # its values

    def right(self, data: bytes) -> bool:
        """Whether a frame of the right length carries what it should."""
        return self.check is None or self.check.right(data)

    def count(self, data: bytes, word: Word) -> int:
        """Return the alive counter of a frame; 0 where it has none."""
        if self.counter is not None:
            return int(self.counter.raw(word))
        return self.check.count(data) if isinstance(self.check, E2e) else 0


@dataclass(frozen=True, slots=True)
class Message:
    """A message that is received."""

    name: str
    bus: str
    ids: frozenset[int]  # in J1939 with every priority; none where any address may send it
    extended: bool
    length: int
    timeout_ns: int
    protection: Protection
    most_step: int = 0  # largest step of the counter that is still the next one
    qualify: int = 1  # good frames in a row that are needed at the start and after a wrong one
    # Of a multiplexed message the multiplexor, and its value in the frames that are meant; and
    # whether counter or checksum are in these frames only.
    page: tuple[Field, int] | None = None
    alone: bool = False
    group: tuple[int, int] | None = None  # instead of identifiers mask and value of the group
    own: int = -1  # our own address on that bus, which no one else may use; -1 for none


@dataclass(frozen=True, slots=True)
class Switch:
    """A switch that has to agree."""

    message: str  # by name
    field: Field
    on: int  # raw value that agrees
    only_zero: bool = False  # only 0 says that it is released; another value is an error code


@dataclass(frozen=True, slots=True)
class Joystick:
    """A joystick."""

    message: str  # by name
    pressed: Switch  # enables it, by a press
    others: tuple[Switch, ...]  # that enable it too
    reset: Field | None  # resets a trip
    bypass: Field | None  # switches anti-sway off
    stuck_ns: int  # longest deflection without a change


@dataclass(slots=True)
class Axis:
    """One axis and its limits. Speeds are parts of full speed, times are periods of its valve.

    A distance is full speed times seconds, where it is not in m.
    """

    name: str
    joystick: str  # by name
    signal: str  # of the joystick, as the file names it
    stick: Stick
    valve: Key
    command: Command
    openings: tuple[Opening, Opening]  # of the positive and of the negative direction
    period: int  # ticks from one command to the next
    period_s: float
    maximum: float  # fastest output
    rise: float  # fastest change of the output in a period
    fall: float
    tail: int  # for how long the output may stay as fast as was asked
    stop: int  # longest shaped stop
    silent: int  # ticks without a frame after which the valve closes
    faster: bool  # the file allows more than was asked
    reverse: bool  # and against it
    reversal: int  # for how long the output may run on against a stick that is held
    slack: float  # distance that a sound filter may run ahead of what was asked
    forwarded: bool  # its command leaves in the frames of its own joystick, through a gateway
    partner: str = ""  # axis that adds velocity to this one; empty for none
    added: float = 0.0  # largest velocity that is added where no one asks
    most_periods: int = 0  # longest motion of that kind
    path_m: float = 0.0  # farthest way of it; 0 for no bound
    full_m_s: float = 1.0
    stop_m: float = math.inf  # farthest way of the tip when it stops
    tip_m_s: float = 0.0  # full speed of the tip where that is not ``full_m_s``
    # Ends of the numbers that may be set while the machine runs, as in the file.
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    step: float = field(init=False)  # most that one step of the frame changes the velocity
    path: float = field(init=False)  # ``path_m`` and ``stop_m`` as a distance
    run_on: float = field(init=False)

    def __post_init__(self) -> None:
        self.step = max(slope for one in self.openings for slope in one.slopes)
        self._scale()

    def velocity(self, steps: int) -> float:
        """Part of full speed that a command of so many steps gives."""
        if steps > 0:
            return self.openings[0].velocity(steps)
        return -self.openings[1].velocity(-steps) if steps else 0.0

    def set(self, key: str, value: float) -> None:
        """Change a number, never beyond the range of the file; without one it stays."""
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
    """A valve message: what it looks like apart from its commands. Of bits byte 0 is the lowest."""

    length: int
    axes: tuple[str, ...]
    fixed: int  # bits that never change
    fixed_value: int
    ours: int  # bits that may differ from the joystick's frame that this one was made from
    protection: Protection
    # Signals with the values that they may have: control words of CiA 408; and those of a frame of
    # our own in the place of a joystick's, in which the switch may be 1 only while it is held.
    words: tuple[tuple[Field, frozenset[int]], ...] = ()
    own: tuple[tuple[Field, frozenset[float]], ...] = ()
    enable: Field | None = None
    group: int = 0  # mask of its group in J1939, which no other address may send; 0 for none


@dataclass(frozen=True, slots=True)
class Record:
    """All that the gate knows."""

    messages: dict[str, Message]
    joysticks: dict[str, Joystick]
    axes: dict[str, Axis]
    valves: dict[Key, Valve]
    stop: Switch | None  # the emergency stop
    others: dict[Key, tuple[frozenset[int], frozenset[bytes]]]  # may leave: lengths, contents
    places: dict[str, Hashable]  # interface and channel of each bus, whatever the file calls it
    listens: bool = False  # another controller sends the valve frames, and none of ours leaves

    @property
    def unchecked(self) -> list[str]:
        """Messages whose checksum is of another package, which the gate does not know."""
        received = [name for name, one in self.messages.items() if not one.protection.known]
        valves = [one for one in self.valves.values() if not one.protection.known]
        return received + [f"the valve of {' and '.join(one.axes)}" for one in valves]
