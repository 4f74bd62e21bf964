"""A received message: its length, protection, sequence and age."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping
from typing import Any, Protocol, Self

from canshaper.codec.frame import FrameFault
from canshaper.codec.message import SequenceChecker
from canshaper.machine.inputs import BoundInput
from canshaper.shaping.states import Reason

Key = tuple[Hashable, ...]


class Part(Protocol):
    """A part of a controller with a state of its own.

    It copies values only: a reference to the part before would keep all of that controller.
    """

    def copy_state(self, before: Any, /) -> None:
        """Copy the state of the same part of the controller before."""


def carry_over(before: Mapping[Key, Part], parts: Mapping[Key, Part]) -> None:
    """Copy the state of each part from the part with the same key and type; others start new.

    Args:
        before: parts of the controller that ran before, by what they are on the machine.
        parts: those of the one that follows it.
    """
    for key, part in parts.items():
        same = before.get(key)
        if type(same) is type(part):
            part.copy_state(same)


# A member by way of its class takes ten times as long as a name, for every frame.
GOOD, CHECKSUM = FrameFault.NONE, FrameFault.CHECKSUM
Raw = dict[str, Any]
"""Raw values of a frame, by signal."""


class Receiver(Protocol):
    """Receives the frames of one message."""

    def receive(self, data: bytes, arrived_ns: int, /) -> FrameFault:
        """Receive a frame, and return its fault."""

    def invalidate(self) -> None:
        """Invalidate everything received so far."""


class MessageInput(Receiver, Part, Protocol):
    """Receiver with a state that a reload carries over."""


class Input(ABC):
    """State of one received message.

    Its age begins with the arrival of its frame. A release or a press of the emergency stop counts
    when the frame is read: these events are numbered, not dated, so none is too old to be seen.

    Attributes:
        raw: raw values of the last frame that counted.
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
        """Receive a frame, or return its fault; only a good one counts."""
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
        """Take a frame with the right checksum; ``raw`` still has the frame before.

        Args:
            raw: its raw values.
            arrived_ns: when it arrived.
            accepted: whether it may be used. A switch may say something without that.

        Returns:
            The fault of its content.
        """

    @property
    def received_ns(self) -> int | None:
        """When the last frame arrived that passed every check; None where none counts."""
        return self._received_ns

    def invalidate(self) -> None:
        """Invalidate everything received so far."""
        self._received_ns = self._last_frame_ns = None

    def copy_state(self, before: Self) -> None:
        """Continue the sequence of the same message; its values have to come again to count."""
        self._sequence.copy_state(before._sequence)
        self._last_frame_ns, self._refused_ns = before._last_frame_ns, before._refused_ns

    def lost(self, now_ns: int) -> Reason | None:
        """Reason for which the message is lost; None while its last good frame is fresh."""
        if self._received_ns is not None and now_ns - self._received_ns <= self._timeout_ns:
            return None
        if self._refused_ns is not None and now_ns - self._refused_ns <= self._timeout_ns:
            return Reason.JOYSTICK_UNTRUSTED
        return Reason.JOYSTICK_TIMEOUT


class Switch:
    """Switch that has to agree, in a message that may carry other signals.

    Args:
        source: the message.
        signal: its signal.
        on: raw value that agrees.

    Attributes:
        agrees: the signal, and that value.
        releases: number of frames of right length and checksum in which it did not agree.
        released: whether it is released: since any frame that shows a release, until an accepted
            frame shows that it agrees.
    """

    def __init__(self, source: Input, signal: str, on: int) -> None:
        self._source = source
        self.agrees = signal, on
        self.releases = 0
        self.released = False
        self._agreed = False  # in the last frame that counts
        self._doubted = 0  # number of the last release in a frame that does not

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
        """Whether only frames that were not accepted have shown a release.

        Args:
            releases: their number at the last call.
        """
        return self._agreed and (self.released or self._doubted > releases)

    def lost(self, now_ns: int) -> Reason | None:
        """Why it is not known; None while its message is fresh."""
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
        """A switch that is released stays so until a frame that counts says otherwise."""
        super().copy_state(before)
        released = {one.agrees: one.released for one in before.switches.values()}
        for switch in self.switches.values():
            switch.released = released.get(switch.agrees, False)
