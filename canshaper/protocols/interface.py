"""Interface between controller and protocols, and between protocols and axes."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Protocol

from canshaper.codec.frame import Frame, FrameFault, MessageKey
from canshaper.codec.message import Sender
from canshaper.inputs.input import MessageInput, Part, PartKey
from canshaper.inputs.stops import StopCauses
from canshaper.inputs.value import Feedback
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.axis import ShapedAxis

if TYPE_CHECKING:
    from canshaper.inputs.sway_sensor import SensorNode


class Event(Protocol):
    """An event that is logged."""

    @property
    def text(self) -> str:
        """Line for the log."""


class DrivenAxis(Protocol):
    """An axis as a protocol sees it."""

    @property
    def bound(self) -> BoundAxis:
        """Configuration and codecs of the axis."""

    @property
    def valve(self) -> Sender:
        """Sender of the message of its valve."""

    @property
    def axis(self) -> ShapedAxis:
        """The shaped axis: state machine, filter and limits."""

    @property
    def feedback(self) -> Feedback | None:
        """Feedback of its valve; None without one."""

    @property
    def stops(self) -> StopCauses:
        """Causes that stop the axis or keep it from starting."""

    def put(self, steps: int) -> None:
        """Put a setpoint (steps of its signal) into the message of its valve."""

    def measured_by(self, node: "SensorNode") -> None:
        """Use measurements of its sway sensor only while this node works."""


class FrameHandler(Protocol):
    """Receives frames that no exact identifier selects, such as those of a J1939 group."""

    def receive(self, frame: Frame, arrived_ns: int, /) -> FrameFault:
        """Receive a frame, and return its fault or NONE."""


class ForwardingRule(Protocol):
    """Frames of a joystick that leave as commands to valves."""

    @property
    def moves(self) -> bool:
        """Whether the last frame may move a valve."""

    def new_frame(self) -> bool:
        """Return whether a valid frame of the joystick came since the last call."""

    def forward(self, data: bytes, arrived_ns: int, *, stopped: bool) -> Frame:
        """Return the joystick's frame with our velocities; these are 0 where ``stopped``."""

    def own(self, now_ns: int) -> Frame | None:
        """Return a frame of our own if joystick frames are missing while a motion has to end."""

    def last(self) -> list[Frame]:
        """Return the neutral frames to send last; none unless the last frame may move a valve."""


class BusProtocol:
    """One protocol on all buses of a machine.

    By default every method does nothing; each protocol has to define ``usual``.

    Attributes:
        inputs: receivers of the protocol's own messages, by identifier.
        forwarding: rules for joystick frames that leave instead of a valve message, by the
            identifier of the valve message.
    """

    inputs: Mapping[MessageKey, MessageInput] = {}
    forwarding: Mapping[MessageKey, ForwardingRule] = {}

    @property
    def silent(self) -> frozenset[str]:
        """Buses on which only this protocol may send now."""
        return frozenset()

    def handler(self, frame: Frame) -> FrameHandler | None:
        """Return the handler of a frame that ``inputs`` does not receive, or None."""

    def usual(self, frame: Frame) -> bool:
        """Return whether a frame that no DBC file lists is normal, and no fault, here."""
        raise NotImplementedError

    def silence(self, now_ns: int) -> FrameFault:
        """Return a fault if another node has just fallen silent, else NONE."""
        return FrameFault.NONE

    def frames(self, now_ns: int) -> Iterable[Frame]:
        """Return the protocol's own frames that are due now (not commands or status)."""
        return ()

    def changes(self) -> Iterable[Event]:
        """Return the events for the log since the last call."""
        return ()

    def stalled(self) -> None:
        """Take note that the loop stood still: frames were missed on all buses."""

    def on_bus_off(self, bus: str) -> None:
        """Take note that our controller is off this bus: frames are missed there."""

    def send_failed(self, frame: Frame) -> None:
        """Take note that a frame did not reach its bus."""

    def invalidate(self, bus: str | None = None) -> None:
        """Invalidate what was received on one bus or on all, except in ``inputs``."""

    def leave(self) -> None:
        """Prepare the end: the next frame of every valve is the last one."""

    def parts(self, places: Mapping[str, PartKey]) -> Iterator[tuple[PartKey, Part]]:
        """Yield (key, part) for a reload, not of ``inputs``; ``places``: key of a bus by name."""
        yield from ()
