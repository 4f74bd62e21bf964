"""Forwarding of joystick frames through a gateway; patterns of the ids that the kernel passes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from canshaper.codec.frame import EFF_FLAG, EFF_MASK, SFF_MASK, Frame, MessageKey
from canshaper.codec.rewrite import RewritingSender
from canshaper.inputs.joystick import JoystickInput
from canshaper.machine.deployment import Deployment
from canshaper.protocols.interface import BusProtocol, DrivenAxis
from canshaper.shaping.states import MOVING, State

# Cycles without a frame of the joystick after which a trip does not wait for the next one.
LATE_CYCLES = 2


class ForwardedJoystick:
    """One joystick message that we forward from one bus to the other.

    A valid frame of the joystick leaves at once with the velocities of the last tick. Without a
    joystick frame we send none, except to end a motion: the shaped stop after the joystick was
    lost, and neutral after a trip.

    Args:
        message: sender of the rewritten frames.
        cycle_ms: time between two frames of the joystick.
        joystick: the joystick.
        controls: axes whose velocities are in the message.

    Attributes:
        moves: whether the last frame may move a valve.
    """

    def __init__(
        self,
        message: RewritingSender,
        cycle_ms: int,
        joystick: JoystickInput,
        controls: Sequence[DrivenAxis],
    ) -> None:
        self._message = message
        self._joystick = joystick
        self._controls = controls
        self._seen = joystick.raw
        self._releases = 0  # releases of the joystick that the axes have seen
        self.moves = False
        self._passed_ns = 0
        self._late_ns = LATE_CYCLES * cycle_ms * 1_000_000

    def new_frame(self) -> bool:
        """Return whether a valid frame of the joystick came since the last call."""
        before, self._seen = self._seen, self._joystick.raw
        return self._seen is not before

    def forward(self, data: bytes, arrived_ns: int, *, stopped: bool) -> Frame:
        """Return the joystick's frame with our velocities; nothing else but protection changes.

        Args:
            data: bytes of the frame.
            arrived_ns: time by ``boottime_ns`` at which the frame arrived.
            stopped: whether the emergency stop is pressed, or missing; then all velocities are 0.
        """
        self._passed_ns = arrived_ns
        stopped = stopped or self._joystick.releases != self._releases  # they trip with the tick
        for control in self._controls:
            if stopped or control.stops.trip:  # the loop stood still, or the like: this is old
                control.put(0)
        self.moves = self._any_moves() and not stopped
        return self._message.onto(data)

    def own(self, now_ns: int) -> Frame | None:
        """Return a frame of our own if joystick frames are missing while a motion has to end."""
        self._releases = self._joystick.releases
        stopping = any(control.axis.state in MOVING for control in self._controls)
        tripped = any(control.axis.state is State.TRIPPED for control in self._controls)
        lost = self._joystick.lost(now_ns) is not None
        late = tripped and now_ns - self._passed_ns > self._late_ns
        if not (lost or late) or not (stopping or self.moves):
            return None
        self.moves = self._any_moves()
        return self._message.own(enabled=stopping)

    def last(self) -> list[Frame]:
        """Return the neutral frame to send last; none unless the last frame may move a valve."""
        return [self._message.own(enabled=False)] if self.moves else []

    def _any_moves(self) -> bool:
        return any(
            control.axis.output.steps and not control.stops.trip for control in self._controls
        )


class Gateway(BusProtocol):
    """The gateway as a protocol: all joysticks whose frames we forward as commands.

    Args:
        deployment: a machine with a gateway.
        axes: axes of the machine.
        joysticks: joysticks of the machine.
    """

    def __init__(
        self,
        deployment: Deployment,
        axes: Mapping[str, DrivenAxis],
        joysticks: Mapping[str, JoystickInput],
    ) -> None:
        gateway = deployment.config.gateway
        assert gateway is not None  # only such deployments have one
        self._buses = gateway.between
        by_message: dict[MessageKey, list[DrivenAxis]] = {}
        for control in (control for control in axes.values() if control.bound.rewrites):
            by_message.setdefault(control.valve.key, []).append(control)
        self.forwarding: dict[MessageKey, ForwardedJoystick] = {}
        for key, controls in by_message.items():
            bound, message = controls[0].bound, controls[0].valve
            assert isinstance(message, RewritingSender)  # of an axis that rewrites
            joystick = joysticks[bound.config.command.joystick]
            cycle_ms = bound.valve_message.cycle_time or 0
            self.forwarding[key] = ForwardedJoystick(message, cycle_ms, joystick, controls)

    def usual(self, frame: Frame) -> bool:
        """Return whether the frame is on a bus of the gateway, where no id is unknown."""
        return frame.bus in self._buses


@dataclass(frozen=True, slots=True, order=True)
class Pattern:
    """Ids, with their flag, that equal ``value`` in the bits of ``mask`` (``struct can_filter``).

    The mask has the flag of 29-bit ids, but not that of remote frames: a pattern fits these too.
    """

    value: int
    mask: int

    def fits(self, word: int) -> bool:
        """Return whether the pattern fits a kernel id (29 bits with their flag)."""
        return word & self.mask == self.value


EVERYTHING = (Pattern(0, EFF_FLAG), Pattern(EFF_FLAG, EFF_FLAG))
"""Patterns that fit every id: one for 11 bits, one for 29 bits."""


def exactly(can_id: int, extended: bool) -> Pattern:
    """Return the pattern that fits this one id."""
    return (
        Pattern(can_id | EFF_FLAG, EFF_MASK | EFF_FLAG)
        if extended
        else Pattern(can_id, SFF_MASK | EFF_FLAG)
    )


def all_but(excluded: Iterable[Pattern]) -> list[Pattern]:
    """Return patterns that fit every id except those of ``excluded``; no two overlap."""
    left = list(EVERYTHING)
    for pattern in sorted(set(excluded)):
        left = [part for whole in left for part in _without(whole, pattern)]
    return sorted(left)


def _without(whole: Pattern, hole: Pattern) -> list[Pattern]:
    """Return patterns for the ids of ``whole`` outside ``hole``.

    Each fixes one more of the bits that only ``hole`` tests, at the other value.
    """
    if (whole.value ^ hole.value) & whole.mask & hole.mask:
        return [whole]  # they do not meet
    left = []
    value, mask = whole.value, whole.mask
    for bit in (1 << n for n in reversed(range(EFF_MASK.bit_length()))):
        if hole.mask & ~mask & bit:
            mask |= bit
            left.append(Pattern(value | ~hole.value & bit, mask))
            value |= hole.value & bit
    return left
