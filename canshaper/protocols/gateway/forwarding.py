"""The frames of joysticks on their way through a gateway, and which others the kernel passes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from canshaper.codec.frame import EFF_FLAG, EFF_MASK, SFF_MASK, Frame
from canshaper.codec.rewrite import RewritingSender
from canshaper.inputs.joystick import JoystickInput
from canshaper.machine.deployment import Deployment
from canshaper.protocols.interface import BusProtocol, DrivenAxis, MessageKey
from canshaper.shaping.states import MOVING, State

# Cycles without a frame of the joystick after which a trip does not wait for the next one.
LATE_CYCLES = 2


class ForwardedJoystick:
    """One joystick message between two buses.

    A frame of the joystick that counts leaves at once with the velocities of the last tick. Without
    one there is no frame, but for the end of a motion: the shaped stop after the joystick was lost,
    and neutral after a trip.

    Args:
        message: sends what leaves.
        cycle_ms: time between two frames of the joystick.
        joystick: the joystick.
        runners: the axes with their velocities in it.

    Attributes:
        moves: whether the last frame may move a valve.
    """

    def __init__(
        self,
        message: RewritingSender,
        cycle_ms: int,
        joystick: JoystickInput,
        runners: Sequence[DrivenAxis],
    ) -> None:
        self._message = message
        self._joystick = joystick
        self._runners = runners
        self._seen = joystick.raw
        self._releases = 0  # as the axes know them
        self.moves = False
        self._passed_ns = 0
        self._late_ns = LATE_CYCLES * cycle_ms * 1_000_000

    def new_frame(self) -> bool:
        """Whether a valid frame of the joystick came since the last call."""
        before, self._seen = self._seen, self._joystick.raw
        return self._seen is not before

    def forward(self, data: bytes, arrived_ns: int, *, stopped: bool) -> Frame:
        """Return the frame of the joystick as it leaves; only the velocities are changed.

        Args:
            data: the frame.
            arrived_ns: when it arrived.
            stopped: the emergency stop is pressed, or missing.
        """
        self._passed_ns = arrived_ns
        stopped = stopped or self._joystick.releases != self._releases  # they trip with the tick
        for runner in self._runners:
            if stopped or runner.stops.trip:  # the loop stood still, or the like: this is old
                runner.put(0)
        self.moves = self._any_moves() and not stopped
        return self._message.onto(data)

    def own(self, now_ns: int) -> Frame | None:
        """Return a frame of our own, where the axes have just moved and the joystick has none."""
        self._releases = self._joystick.releases
        stopping = any(runner.axis.state in MOVING for runner in self._runners)
        tripped = any(runner.axis.state is State.TRIPPED for runner in self._runners)
        lost = self._joystick.lost(now_ns) is not None
        late = tripped and now_ns - self._passed_ns > self._late_ns
        if not (lost or late) or not (stopping or self.moves):
            return None
        self.moves = self._any_moves()
        return self._message.own(enabled=stopping)

    def last(self) -> list[Frame]:
        """Return the last frames before we go: neutral, where the last frame was not."""
        return [self._message.own(enabled=False)] if self.moves else []

    def _any_moves(self) -> bool:
        return any(runner.axis.raw and not runner.stops.trip for runner in self._runners)


class Gateway(BusProtocol):
    """All joysticks whose frames leave as commands.

    Args:
        deployment: one with a gateway.
        axes: its axes.
        joysticks: its joysticks.
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
        for runner in (runner for runner in axes.values() if runner.bound.rewrites):
            by_message.setdefault(runner.valve.key, []).append(runner)
        self.forwarding: dict[MessageKey, ForwardedJoystick] = {}
        for key, runners in by_message.items():
            bound, message = runners[0].bound, runners[0].valve
            assert isinstance(message, RewritingSender)  # of an axis that rewrites
            joystick = joysticks[bound.config.command.joystick]
            cycle_ms = bound.valve_message.cycle_time or 0
            self.forwarding[key] = ForwardedJoystick(message, cycle_ms, joystick, runners)

    def usual(self, frame: Frame) -> bool:
        """Whether the frame is forwarded traffic, and so no unknown id."""
        return frame.bus in self._buses


@dataclass(frozen=True, slots=True, order=True)
class Pattern:
    """Ids that are ``value`` in the bits of ``mask``: the words of ``struct can_filter``.

    The flag of 29 bits is in the mask; that of remote frames is not, so a pattern fits them too.
    """

    value: int
    mask: int

    def fits(self, word: int) -> bool:
        """Whether a frame with this id of the kernel (29 bits with their flag) is one of them."""
        return word & self.mask == self.value


EVERYTHING = (Pattern(0, EFF_FLAG), Pattern(EFF_FLAG, EFF_FLAG))
"""Ids of 11 bits, and ids of 29 bits."""


def exactly(can_id: int, extended: bool) -> Pattern:
    """The one id."""
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
    """Return what is left of ``whole``: for each bit that only ``hole`` tests, the other value."""
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
