"""The gate's record of a machine: identifiers, bits and limits. ``build.py`` fills it in once.

While the machine runs only three limits and ``full_m_s`` of an axis may change (``Gate.set``).
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

    check: Checksum | E2e | None = None  # of the content; None without one, or one not known
    known: bool = True  # whether the gate knows the checksum; not that of another package
    counter: Field | None = None  # alive counter; with E2E it is in the header
    counts: int = 0  # number of values of the counter; 0 without one

    def right(self, data: bytes) -> bool:
        """Return whether the checksum or E2E header of a frame of the right length is right."""
        return self.check is None or self.check.right(data)

    def count(self, data: bytes, word: Word) -> int:
        """Return the alive counter of a frame; 0 where it has none."""
        if self.counter is not None:
            return int(self.counter.raw(word))
        return self.check.count(data) if isinstance(self.check, E2e) else 0


@dataclass(frozen=True, slots=True)
class Message:
    """A received message."""

    name: str
    bus: str
    ids: frozenset[int]  # in J1939 with every priority; none where any address may send it
    extended: bool
    length: int
    timeout_ns: int
    protection: Protection
    most_step: int = 0  # largest good step of the counter
    qualify: int = 1  # good frames in a row that are needed at the start and after a wrong one
    page: tuple[Field, int] | None = None  # multiplexor, and its value in the frames that count
    alone: bool = False  # whether counter or checksum are in these frames only
    group: tuple[int, int] | None = None  # (mask, value) of a J1939 group, instead of ``ids``
    own: int = -1  # our own address on that bus, which no one else may use; -1 for none


@dataclass(frozen=True, slots=True)
class Switch:
    """A switch that has to be on."""

    message: str  # name of its message
    field: Field
    on: int  # raw value that means on
    only_zero: bool = False  # only 0 means released; any other value but ``on`` is an error code


@dataclass(frozen=True, slots=True)
class Joystick:
    """A joystick with its switches."""

    message: str  # name of its message
    pressed: Switch  # switch that the operator presses to enable it
    others: tuple[Switch, ...]  # further switches that have to be on
    reset: Field | None  # signal that resets a trip
    bypass: Field | None  # signal that switches anti-sway off
    stuck_ns: int  # longest deflection without a change


@dataclass(slots=True)
class Axis:
    """One axis and its limits. Speeds are parts of full speed, times are periods of its valve.

    Distances are full speed times seconds, except those in m.
    """

    name: str
    joystick: str  # name of its joystick
    signal: str  # signal of its velocity in the file
    stick: Stick
    valve: Key
    command: Command
    openings: tuple[Opening, Opening]  # of the positive and of the negative direction
    period: int  # ticks from one command to the next
    period_s: float
    maximum: float  # fastest output
    rise: float  # fastest change of the output in a period
    fall: float
    tail: int  # how long the output may stay as fast as was demanded before
    stop: int  # longest shaped stop
    silent: int  # ticks without a frame after which the valve closes
    faster: bool  # the file allows an output faster than the demand
    reverse: bool  # the file allows an output against the demand
    reversal: int  # how long the output may run on against a joystick that is held
    slack: float  # distance by which a sound filter may run ahead of the demand
    forwarded: bool  # its command leaves in the frames of its own joystick, through a gateway
    partner: str = ""  # axis that adds velocity to this one; empty for none
    added: float = 0.0  # largest velocity that a partner may add without a demand
    most_periods: int = 0  # longest motion by added velocity
    path_m: float = 0.0  # longest path by added velocity; 0 for no bound
    full_m_s: float = 1.0
    stop_m: float = math.inf  # longest stopping distance of the tip
    tip_m_s: float = 0.0  # full speed of the tip; 0 where it is ``full_m_s``
    # (low, high) of each number that may be set while the machine runs, as in the file.
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    step: float = field(init=False)  # largest change of velocity by one step of the frame
    path: float = field(init=False)  # ``path_m`` as a distance in full speed times seconds
    run_on: float = field(init=False)  # ``stop_m`` as such a distance

    def __post_init__(self) -> None:
        self.step = max(slope for one in self.openings for slope in one.slopes)
        self._scale()

    def velocity(self, steps: int) -> float:
        """Return the part of full speed for a command in signed steps."""
        if steps > 0:
            return self.openings[0].velocity(steps)
        return -self.openings[1].velocity(-steps) if steps else 0.0

    def set(self, key: str, value: float) -> None:
        """Change a limit or ``full_m_s``, clamped to its range in the file; all else stays."""
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
    """A valve message: all of its bits but the commands. In masks byte 0 is the lowest.

    Attributes:
        length: number of bytes.
        axes: names of the axes whose commands it carries.
        fixed: mask of the bits that never change.
        fixed_value: value of these bits.
        ours: mask of the bits that may differ from the joystick's frame, in a gateway.
        protection: counter and checksum.
        words: control words of CiA 408, with the values that they may have.
        own: signals of a frame of our own in place of a joystick's, with the values that they may
            have.
        enable: the enabling switch in such a frame, which may be 1 only while it is held.
        group: mask of its J1939 group, which no other address may send; 0 for none.
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
    """All that the gate knows of a machine."""

    messages: dict[str, Message]
    joysticks: dict[str, Joystick]
    axes: dict[str, Axis]
    valves: dict[Key, Valve]
    stop: Switch | None  # the emergency stop
    others: dict[Key, tuple[frozenset[int], frozenset[bytes]]]  # other messages: lengths, contents
    places: dict[str, Hashable]  # interface and channel of each bus, by its name in the file
    listens: bool = False  # another controller sends the valve frames, and none of ours leaves

    @property
    def unchecked(self) -> list[str]:
        """Messages whose checksum another package computes, so that the gate cannot check it."""
        received = [name for name, one in self.messages.items() if not one.protection.known]
        valves = [one for one in self.valves.values() if not one.protection.known]
        return received + [f"the valve of {' and '.join(one.axes)}" for one in valves]
