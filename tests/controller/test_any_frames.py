"""Whatever comes from the bus: no exception, and no move that no operator asked for.

The judge reads the joysticks' bytes by itself, with ``struct``, and allows a move of an axis only
after an enabled joystick in neutral and then an enabled one out of neutral.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment

DEPLOYMENT = load_deployment(Path(__file__).parents[2] / "config" / "forwarder.yaml")
TICK_NS = 20_000_000
TIMEOUT_NS = 100_000_000
STOP_NS = 2_000_000_000
MOST_MISSED = 3
# axis: id of the joystick, byte of the joystick, id of the valve
AXES = {"slew": (0x110, 0, 0x200), "near_far": (0x110, 2, 0x201), "lift": (0x111, 0, 0x202)}


@dataclass
class Judge:
    """Motion that an axis may make, from the bytes of its joystick alone."""

    joystick: int
    byte: int
    alive: int | None = None
    received_ns: int = -(10**12)
    neutral_seen: bool = False
    commanded: bool = False
    released: bool = True
    fastest: int = 0

    def receive(self, frame: Frame, now_ns: int) -> None:
        place = (frame.bus, frame.can_id, frame.extended, len(frame.data))
        if place != ("crane", self.joystick, False, 8) or frame.data[7] == self.alive:
            return
        self.alive, self.received_ns = frame.data[7], now_ns
        (joystick,) = struct.unpack_from("<h", frame.data, self.byte)
        enable = frame.data[4] & 3
        self.released = enable == 0
        if enable == 1 and abs(joystick) <= 20:
            self.neutral_seen = True
        if enable == 1 and 20 < abs(joystick) <= 1000 and self.neutral_seen:
            self.commanded = True
            self.fastest = max(self.fastest, abs(joystick))

    def allows(self, raw: int, now_ns: int) -> bool:
        """Whether this raw command of the valve, 0.8 % per bit, may be sent now."""
        if raw == 0:
            return True
        if self.released or not self.commanded or abs(raw) > 125:
            return False
        # 5 % of the valve's deadband are added; one step for rounding
        fast_enough = abs(raw) <= 125 * (0.05 + 0.95 * self.fastest / 1000) + 1
        in_time = (
            now_ns - self.received_ns <= TIMEOUT_NS + STOP_NS + (1 + 2 * MOST_MISSED) * TICK_NS
        )
        return fast_enough and in_time


joysticks = st.sampled_from(
    [0, 0, 0, 15, -20, 21, 300, -500, 1000, -1000, 1001, 32766, 32767, -32768]
)


@st.composite
def joystick_frames(draw: st.DrawFn) -> Frame:
    data = struct.pack(
        "<hhBBBB",
        draw(joysticks),
        draw(joysticks),
        draw(st.sampled_from([1, 1, 1, 1, 0, 2, 3, 5, 17, 21])),
        0,
        0,
        draw(st.integers(0, 255)),
    )
    return Frame("crane", draw(st.sampled_from([0x110, 0x110, 0x111])), False, data)


any_frames = st.builds(
    Frame,
    st.sampled_from(["crane", "crane", "crane", "other"]),
    st.sampled_from([0x110, 0x111, 0x200, 0x300, 0x310]) | st.integers(0, 2**29 - 1),
    st.booleans(),
    st.binary(min_size=8, max_size=8) | st.binary(max_size=12),
)
steps = st.tuples(
    st.lists(joystick_frames() | any_frames, max_size=4),
    st.sampled_from([0, 0, 0, 0, 0, 1, MOST_MISSED, 40]),
    st.sampled_from([1, 1, 1, 2, 7, 30]),
)


def drive(script: list[tuple[list[Frame], int, int]]) -> int:
    """Run a script of (frames, ticks missed, ticks); return how many frames moved a valve."""
    controller = Controller(DEPLOYMENT)
    judges = {valve: Judge(joystick, byte) for joystick, byte, valve in AXES.values()}
    now_ns, moves = 0, 0
    for frames, missed, ticks in script:
        now_ns += missed * TICK_NS
        if missed > MOST_MISSED:  # as the daemon does after more than the timeout
            controller.stalled()
            for judge in judges.values():
                judge.neutral_seen = judge.commanded = False
        for frame in frames:
            controller.receive(frame, now_ns)
            for judge in judges.values():
                judge.receive(frame, now_ns)
        for i in range(ticks):
            sent = controller.tick(now_ns, 0 if i else missed)
            valves = [f for f in sent if f.can_id in judges]
            assert [f.can_id for f in valves] == list(judges)
            for frame in valves:
                (raw,) = struct.unpack_from("<b", frame.data)
                assert judges[frame.can_id].allows(raw, now_ns), (frame, judges[frame.can_id])
                moves += raw != 0
            now_ns += TICK_NS
    return moves


def left(joystick: int, count: int) -> Frame:
    return Frame("crane", 0x110, False, struct.pack("<hhBBBB", joystick, 0, 1, 0, 0, count))


@pytest.mark.slow
@settings(max_examples=4 * settings().max_examples)
@given(script=st.lists(steps, max_size=25), armed=st.booleans())
def test_no_frames_move_a_valve_unasked(
    script: list[tuple[list[Frame], int, int]], armed: bool
) -> None:
    start = [([left(0, 1)], 0, 1), ([left(800, 2)], 0, 4)] if armed else []
    event("moved" if drive(start + script) else "still")


def test_the_judge_sees_moves() -> None:
    script = [([left(0, 1)], 0, 1), ([left(1000, 2)], 0, 1), ([left(1000, 3)], 0, 5)]
    assert drive(script) >= 5
