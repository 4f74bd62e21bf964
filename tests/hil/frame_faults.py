"""Faults of the joysticks' frames: how each is made, what must be said of it, what may still move.

What is allowed is counted in valve frames, of which every tick sends one: an emulated machine that
stands still for a while stands still for both sides.
"""

from collections.abc import Callable
from dataclasses import dataclass

from tests.hil.hand import LEFT, RIGHT, STOP, Hand, with_checksum

TICKS_OF = {"timeout": 5, "stop": 100, "frozen": 100}  # of 20 ms, from the deployment file
AT_ONCE = 2  # the frame that the tick was just sending, and one on its way in the log


@dataclass(frozen=True)
class Fault:
    """A fault of the frames.

    Attributes:
        make: makes it; the frames that report it carry the mark of ``begins``.
        begins: whether a logged frame is the first that is not as it should be.
        reason: what the axis must say.
        named: what the service must say, None where no frame is wrong.
        moving: valve frames that may still move after the fault began.
        latched: whether it takes a press of the reset.
    """

    make: Callable[[Hand], None]
    begins: Callable[[bytes, bytes], bool]
    reason: str
    named: str | None
    moving: int
    latched: bool = False
    axis: str = "Slew"


def spoil_left(change: Callable[[bytes], list[bytes]]) -> Callable[[Hand], None]:
    def make(hand: Hand) -> None:
        hand.spoil = lambda can_id, data: change(data) if can_id == LEFT else [data]

    return make


def raw_slew(raw: int) -> Callable[[Hand], None]:
    def change(data: bytes) -> list[bytes]:
        return [with_checksum(raw.to_bytes(2, "little", signed=True) + data[2:])]

    return spoil_left(change)


def silent(can_id: int) -> Callable[[Hand], None]:
    def make(hand: Hand) -> None:
        hand.spoil = lambda sent, data: [] if sent == can_id else [data]

    return make


def freeze_counter(hand: Hand) -> None:
    first: list[bytes] = []

    def change(data: bytes) -> list[bytes]:
        first.append(data)
        return [first[0]]

    spoil_left(change)(hand)


def jump_counter(hand: Hand) -> None:
    step = iter(range(0, 10**9, 50))

    def change(data: bytes) -> list[bytes]:
        return [with_checksum(data[:7] + bytes([next(step) % 256]))]

    spoil_left(change)(hand)


def set_hand(**values: int) -> Callable[[Hand], None]:
    def make(hand: Hand) -> None:
        for name, value in values.items():
            setattr(hand, name, value)

    return make


def contradict(hand: Hand) -> None:
    def change(can_id: int, data: bytes) -> list[bytes]:
        return [data[:5] + b"\x14" + data[6:]] if can_id == RIGHT else [data]  # up and down

    hand.spoil = change


def changed(can_id: int, at: int, value: int) -> Callable[[bytes, bytes], bool]:
    """The first frame of an id that has this byte."""
    mark = can_id.to_bytes(2, "big")
    return lambda key, data: key == mark and len(data) > at and data[at] == value


def frame_of(can_id: int) -> Callable[[bytes, bytes], bool]:
    return lambda key, _data: key == can_id.to_bytes(2, "big")


SHAPED = TICKS_OF["stop"] + AT_ONCE
LOST = TICKS_OF["timeout"] + SHAPED
FAULTS = {
    "silent": Fault(silent(LEFT), frame_of(LEFT), "JOYSTICK_TIMEOUT", None, LOST),
    "frozen counter": Fault(
        freeze_counter, frame_of(LEFT), "JOYSTICK_UNTRUSTED", "COUNTER_REPEATED", LOST
    ),
    "jumping counter": Fault(
        jump_counter, frame_of(LEFT), "JOYSTICK_UNTRUSTED", "COUNTER_JUMP", LOST
    ),
    "wrong checksum": Fault(
        spoil_left(lambda d: [d[:6] + bytes([d[6] ^ 1]) + d[7:]]),
        frame_of(LEFT), "JOYSTICK_UNTRUSTED", "CHECKSUM", LOST,
    ),
    "wrong length": Fault(
        spoil_left(lambda d: [d[:7]]), frame_of(LEFT), "JOYSTICK_TIMEOUT", "WRONG_LENGTH", LOST
    ),
    "error code": Fault(
        raw_slew(32766), changed(LEFT, 1, 0x7F), "JOYSTICK_ERROR", "INVALID_SIGNAL", SHAPED
    ),
    "not available": Fault(
        raw_slew(32767), changed(LEFT, 1, 0x7F), "JOYSTICK_NOT_AVAILABLE", "INVALID_SIGNAL", SHAPED
    ),
    "out of range": Fault(
        raw_slew(2000), changed(LEFT, 1, 0x07), "JOYSTICK_OUT_OF_RANGE", "INVALID_SIGNAL", SHAPED
    ),
    "enable invalid": Fault(
        set_hand(enable=3), changed(LEFT, 4, 3), "SWITCH_INVALID", "INVALID_SIGNAL", SHAPED
    ),
    "contradictory flags": Fault(
        contradict, changed(RIGHT, 5, 0x14), "JOYSTICK_CONTRADICTORY", "INVALID_SIGNAL", SHAPED,
        axis="Lift",
    ),
    "enable lost": Fault(
        set_hand(enable=0), changed(LEFT, 4, 0), "ENABLE_LOST", None, AT_ONCE, latched=True
    ),
    "emergency stop": Fault(
        set_hand(stop=1), changed(STOP, 0, 1), "EMERGENCY_STOP", None, AT_ONCE, latched=True
    ),
    "emergency stop lost": Fault(
        silent(STOP), frame_of(STOP), "EMERGENCY_STOP_LOST", None,
        TICKS_OF["timeout"] + AT_ONCE, latched=True,
    ),
}  # fmt: skip
