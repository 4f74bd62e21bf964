"""A received message: its length, protection, sequence and age."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping
from typing import Any, Protocol, Self

from canshaper.codec.frame import FrameFault
from canshaper.codec.message import SequenceChecker
from canshaper.machine.inputs import BoundInput
from canshaper.shaping.states import Reason

PartKey = tuple[Hashable, ...]


class Part(Protocol):
    """Part of a controller whose state a reload carries over.

    It copies values only: a reference to the old part would keep the whole old controller.
    """

    def copy_state(self, before: Any, /) -> None:
        """Copy the state of the same part of the old controller."""


def carry_over(before: Mapping[PartKey, Part], parts: Mapping[PartKey, Part]) -> None:
    """Copy the state of each part from the part with the same key and type; others start new.

    Args:
        before: parts of the old controller, by their keys.
        parts: parts of the new controller.
    """
    for key, part in parts.items():
        same = before.get(key)
        if type(same) is type(part):
            part.copy_state(same)


# Python finds a name of the module ten times as fast as a member of an enumeration.
GOOD, CHECKSUM = FrameFault.NONE, FrameFault.CHECKSUM
Raw = dict[str, Any]
"""Raw values of a frame, by signal."""


class Receiver(Protocol):
    """Receives the frames of one message."""

    def receive(self, data: bytes, arrived_ns: int, /) -> FrameFault:
        """Receive a frame, and return its fault, or ``NONE``."""

    def invalidate(self) -> None:
        """Invalidate everything received so far."""


class MessageInput(Receiver, Part, Protocol):
    """Receiver with a state that a reload carries over."""


class Input(ABC):
    """One received message: checks its frames, and keeps the last one that counts.

    The age of a frame counts from its arrival. A release of enable or a press of the emergency stop
    is counted when its frame is read, and has no age: the next tick sees it, however late that is.

    Attributes:
        raw: raw values of the last frame that counts.
    """

    def __init__(self, bound: BoundInput) -> None:
        self._length, self._decode = bound.message.length, bound.layout.decode
        self._chosen = bound.chosen
        config = bound.config
        self._sequence = SequenceChecker(bound.protection, config.alive_max_step, config.qualify)
        self._counter = bound.protection.counter
        self._timeout_ns = config.timeout_ms * 1_000_000
        self._last_frame_ns: int | None = None
        self._refused_ns: int | None = None
        self._received_ns: int | None = None
        self.raw: Raw = {}

    def receive(self, data: bytes, arrived_ns: int) -> FrameFault:
        """Receive a frame, and return its fault; one with a fault of its content alone counts.

        A frame with another multiplexor value, or before enough good ones in a row, does not count,
        though it has no fault.
        """
        if len(data) != self._length:
            return FrameFault.WRONG_LENGTH
        raw = self._decode(data)
        chosen, others = self._chosen, False
        if chosen is not None and (others := raw[chosen.signal] != chosen.value) and chosen.alone:
            return GOOD
        sequence = self._sequence
        if self._last_frame_ns is None or arrived_ns - self._last_frame_ns > self._timeout_ns:
            sequence.resync()
        fault = sequence.check(data, raw[self._counter] if self._counter else 0)
        if fault is CHECKSUM:
            self._refused_ns = arrived_ns
            return fault
        self._last_frame_ns = arrived_ns
        if others:
            return fault
        accepted = sequence.qualified and not fault
        content = self.on_frame(raw, arrived_ns, accepted)
        if not accepted:
            self._refused_ns = arrived_ns
            return fault
        self.raw, self._received_ns = raw, arrived_ns
        return content

    @abstractmethod
    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Take a frame with the right checksum; ``self.raw`` is still that of the frame before.

        Args:
            raw: its raw values.
            arrived_ns: monotonic time of its arrival.
            accepted: whether its sequence is right too. A release of a switch counts without that.

        Returns:
            The fault of its content.
        """

    @property
    def received_ns(self) -> int | None:
        """Arrival of the last frame that counts, monotonic time; None where none does."""
        return self._received_ns

    def invalidate(self) -> None:
        """Invalidate everything received so far, but for a release or a press of the stop."""
        self._received_ns = self._last_frame_ns = None

    def copy_state(self, before: Self) -> None:
        """Continue the sequence of the same message; only new frames give values again."""
        self._sequence.copy_state(before._sequence)
        self._last_frame_ns, self._refused_ns = before._last_frame_ns, before._refused_ns

    def lost(self, now_ns: int) -> Reason | None:
        """Return why the message is lost: refused frames or silence; None while a frame counts."""
        if self._received_ns is not None and now_ns - self._received_ns <= self._timeout_ns:
            return None
        if self._refused_ns is not None and now_ns - self._refused_ns <= self._timeout_ns:
            return Reason.JOYSTICK_UNTRUSTED
        return Reason.JOYSTICK_TIMEOUT


class Switch:
    """Enable switch, in a message that may carry other signals. It agrees while it is on.

    Args:
        source: input of its message.
        signal: its signal.
        on: raw value with which it agrees.

    Attributes:
        agrees: the signal, and the raw value with which it agrees.
        releases: number of frames of right length and checksum in which it did not agree.
        released: whether it is released: from any frame that shows a release to the next accepted
            frame in which it agrees.
    """

    def __init__(self, source: Input, signal: str, on: int) -> None:
        self._source = source
        self.agrees = signal, on
        self.releases = 0
        self.released = False
        self._agreed = False  # in the last accepted frame
        self._doubted = 0  # number of the last release in a frame that was not accepted

    def on_frame(self, raw: Raw, accepted: bool) -> None:
        """Take a frame: any frame can show a release, only an accepted one ends it."""
        signal, on = self.agrees
        agrees = raw[signal] == on
        if accepted:
            self._agreed = agrees
        if not agrees:
            self.releases += 1
            self.released = True
            if not accepted:
                self._doubted = self.releases
        elif accepted:
            self.released = False

    def doubted(self, releases: int) -> bool:
        """Return whether the last accepted frame agrees, and others have shown a release since.

        Args:
            releases: ``self.releases`` at the call before.
        """
        return self._agreed and (self.released or self._doubted > releases)

    def lost(self, now_ns: int) -> Reason | None:
        """Return why its message is lost; None while that is fresh."""
        return self._source.lost(now_ns)


class SwitchInput(Input):
    """A message with switches.

    Attributes:
        switches: its switches, by name.
    """

    def __init__(self, bound: BoundInput, switches: Mapping[str, tuple[str, int]]) -> None:
        super().__init__(bound)
        self.switches = {name: Switch(self, *one) for name, one in switches.items()}

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Give the frame to each switch."""
        for switch in self.switches.values():
            switch.on_frame(raw, accepted)
        return GOOD

    def copy_state(self, before: Self) -> None:
        """Keep a switch released until an accepted frame says otherwise."""
        super().copy_state(before)
        released = {one.agrees: one.released for one in before.switches.values()}
        for switch in self.switches.values():
            switch.released = released.get(switch.agrees, False)
