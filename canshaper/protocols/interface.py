"""Interface between controller and protocols, and between protocols and axes."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Protocol

from canshaper.codec.frame import Frame, FrameFault
from canshaper.codec.message import Sender
from canshaper.inputs.input import Key, MessageInput, Part
from canshaper.inputs.stops import StopCauses
from canshaper.inputs.value import Feedback
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.axis import ShapedAxis

if TYPE_CHECKING:
    from canshaper.inputs.sway_sensor import SensorNode

MessageKey = tuple[str, int, bool]
"""Bus, identifier, and whether that has 29 bits."""


class Event(Protocol):
    """Anything that is logged."""

    @property
    def text(self) -> str:
        """Line for the log."""


class DrivenAxis(Protocol):
    """An axis as a protocol sees it."""

    @property
    def bound(self) -> BoundAxis:
        """The axis with its codecs."""

    @property
    def valve(self) -> Sender:
        """Sends the message of its valve."""

    @property
    def axis(self) -> ShapedAxis:
        """Its state machine."""

    @property
    def feedback(self) -> Feedback | None:
        """Feedback of its valve."""

    @property
    def stops(self) -> StopCauses:
        """Why it stops or may not begin."""

    def put(self, steps: int) -> None:
        """Put a command into the message of its valve."""

    def measured_by(self, node: "SensorNode") -> None:
        """Use measurements of its sway sensor only while this node works."""


class FrameHandler(Protocol):
    """Receives frames that are known by more than their identifier."""

    def receive(self, frame: Frame, arrived_ns: int, /) -> FrameFault:
        """Receive a frame, and return its fault."""


class ForwardingRule(Protocol):
    """Frames of a joystick that leave as commands to valves."""

    @property
    def moves(self) -> bool:
        """Whether the last frame may move a valve."""

    def new_frame(self) -> bool:
        """Whether a valid frame of the joystick came since the last call."""

    def forward(self, data: bytes, arrived_ns: int, *, stopped: bool) -> Frame:
        """Return the frame of the joystick as it leaves; neutral where ``stopped``."""

    def own(self, now_ns: int) -> Frame | None:
        """Return a frame of our own, where the axes have just moved and the joystick has none."""

    def last(self) -> list[Frame]:
        """Return the last frames before we go."""


class BusProtocol:
    """One protocol on all buses of a machine; by default it does nothing; each defines ``usual``.

    Attributes:
        inputs: what receives its own messages, by their identifiers.
        forwarding: what leaves in the place of a valve message, by the identifier of that.
    """

    inputs: Mapping[MessageKey, MessageInput] = {}
    forwarding: Mapping[MessageKey, ForwardingRule] = {}

    @property
    def silent(self) -> frozenset[str]:
        """Buses on which nothing but frames of this protocol may be sent now."""
        return frozenset()

    def handler(self, frame: Frame) -> FrameHandler | None:
        """Return the handler of a frame that is none of ``inputs``."""

    def usual(self, frame: Frame) -> bool:
        """Whether such a frame is no fault although no DBC file has it."""
        raise NotImplementedError

    def silence(self, now_ns: int) -> FrameFault:
        """Return a fault where something has just fallen silent."""
        return FrameFault.NONE

    def frames(self, now_ns: int) -> Iterable[Frame]:
        """Return the frames due now, besides commands and status."""
        return ()

    def changes(self) -> Iterable[Event]:
        """Return the events for the log since the last call."""
        return ()

    def stalled(self) -> None:
        """Take note that the loop stood still: frames were missed on all buses."""

    def on_bus_off(self, bus: str) -> None:
        """Take note that we are not on this bus now: frames are missed there."""

    def send_failed(self, frame: Frame) -> None:
        """Take note that a frame did not reach its bus."""

    def invalidate(self, bus: str | None = None) -> None:
        """Invalidate what was received so far, of one bus or of all; but for ``inputs``."""

    def leave(self) -> None:
        """Prepare the end: the next frame of every valve is the last one."""

    def parts(self, places: Mapping[str, Key]) -> Iterator[tuple[Key, Part]]:
        """Yield parts that a reload carries over besides ``inputs``; ``places``: keys of buses."""
        yield from ()
