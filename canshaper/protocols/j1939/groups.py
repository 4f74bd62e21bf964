"""Messages of J1939 that are known by their group, whatever their priority."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from canshaper.codec.frame import GLOBAL, Frame, FrameFault
from canshaper.inputs.input import Receiver
from canshaper.protocols.interface import DrivenAxis


@dataclass(frozen=True, slots=True)
class SourceEvent:
    """A message came from a new address, ``source``; we use ``received``, which may be the same."""

    bus: str
    message: str
    source: int
    received: int

    @property
    def text(self) -> str:
        """Line for the log."""
        text = f"bus={self.bus} message={self.message} source={self.source:#04x}"
        return (
            text
            if self.source == self.received
            else f"{text} ignored, received={self.received:#04x}"
        )


class AnySource:
    """An input from the first address that sends; from another once the first falls silent.

    Args:
        bus: name of the bus.
        message: name of the message.
        received: the input.
        timeout_ns: age limit of the input; an address silent for longer is replaced.
        controls: axes that the input moves. Another address is another joystick: when it takes
            over, the axes need neutral first.

    Attributes:
        events: new addresses since the owner emptied the list.
    """

    def __init__(
        self,
        bus: str,
        message: str,
        received: Receiver,
        timeout_ns: int,
        controls: Sequence[DrivenAxis] = (),
    ) -> None:
        self.events: list[SourceEvent] = []
        self._bus, self._message = bus, message
        self._input = received
        self._timeout_ns = timeout_ns
        self._controls = controls
        self._source: int | None = None
        self._ignored: set[int] = set()
        self._last_frame_ns = 0

    def receive(self, frame: Frame, arrived_ns: int) -> FrameFault:
        """Receive a frame; one from a second address is a fault while the first one sends."""
        source = frame.can_id & 0xFF
        if source != self._source:
            if self._source is not None:
                if arrived_ns - self._last_frame_ns <= self._timeout_ns:
                    return self._other(source, self._source)
                # No tick need have seen the silence in between.
                self._input.invalidate()
                for control in self._controls:
                    control.stops.invalid = True
            self._source = source
            self._ignored.clear()
            self.events.append(SourceEvent(self._bus, self._message, source, source))
        self._last_frame_ns = arrived_ns
        return self._input.receive(frame.data, arrived_ns)

    def invalidate(self) -> None:
        """Invalidate everything received so far."""
        self._input.invalidate()

    def copy_state(self, before: Self) -> None:
        """Keep the address in use; another address has to wait until it falls silent."""
        self._source, self._last_frame_ns = before._source, before._last_frame_ns
        self._ignored = set(before._ignored)

    def _other(self, source: int, received: int) -> FrameFault:
        if source not in self._ignored:
            self._ignored.add(source)
            self.events.append(SourceEvent(self._bus, self._message, source, received))
        return FrameFault.SECOND_SENDER


class ReceivedGroup:
    """The inputs of one group: each from one source address, or one from any address.

    Args:
        own: our address on the bus, from which no one else may send; None without one.

    Attributes:
        of: input by the source address from which it is received.
        rest: the input from any other address, or None.
    """

    def __init__(self, own: int | None) -> None:
        self._own = own
        self.of: dict[int, Receiver] = {}
        self.rest: AnySource | None = None

    def receive(self, frame: Frame, arrived_ns: int) -> FrameFault:
        """Receive a frame; one from our address is a fault, one without an input is ignored."""
        source = frame.can_id & 0xFF
        if source == self._own:
            return FrameFault.SECOND_SENDER
        if (one := self.of.get(source)) is not None:
            return one.receive(frame.data, arrived_ns)
        return self.rest.receive(frame, arrived_ns) if self.rest else FrameFault.NONE


class CommandedByOthers:
    """Receives other nodes' commands to our valves, from any address and at any priority."""

    def __init__(self, controls: Sequence[DrivenAxis]) -> None:
        self._controls = [
            (control, _destination(control.bound.valve.message.key[1])) for control in controls
        ]

    def receive(self, frame: Frame, arrived_ns: int) -> FrameFault:
        """Trip the axes whose valves are addressed: two controllers must not drive one crane."""
        to, fault = _destination(frame.can_id), FrameFault.NONE
        for control, destination in self._controls:
            if to in (destination, GLOBAL):
                control.stops.foreign_sender(arrived_ns)
                fault = FrameFault.SECOND_SENDER
        return fault


def _destination(can_id: int) -> int:
    """Return the PDU specific byte: the destination, or part of a group without destination."""
    return can_id >> 8 & 0xFF
