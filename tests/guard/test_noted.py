"""What one joystick or switch keeps of its frames, frame by frame, without a valve."""

import struct

import pytest

from canshaper.guard.bits import JoystickBits
from canshaper.guard.inputs import (
    FOREVER,
    MOST_UNREAD,
    NEVER,
    CommandedAxis,
    GuardedJoystick,
    GuardedSwitch,
)
from canshaper.machine.binding import load_deployment
from tests.faults import shipped
from tests.guard.bench import signs

FORWARDER = load_deployment(shipped.CONFIG / "forwarder.yaml")
LEFT = FORWARDER.joysticks["left"]


def joystick(enable: str | None, *axes: str) -> tuple[GuardedJoystick, list[CommandedAxis]]:
    """The left joystick of the forwarder, driving these axes."""
    one, driven = GuardedJoystick(LEFT, enable), []
    for name in axes:
        bits = JoystickBits(LEFT.message, FORWARDER.axes[name].config.command)
        driven.append(CommandedAxis(bits))
        one.drives(driven[-1])
    return one, driven


def frame(slew: float = 0.0, near_far: float = 0.0, enable: int = 1) -> bytes:
    return struct.pack("<hhI", round(1000 * slew), round(1000 * near_far), enable)


@signs
def test_cleared_it_keeps_neither_what_is_commanded_nor_what_was(sign: int) -> None:
    one, (axis,) = joystick("Enable", "near_far")
    for at, size in enumerate((0.4, -0.4, 0.3, 0.2)):
        one.note(frame(near_far=sign * size), at)
    one.read()
    assert axis.now == sign * 0.2
    assert axis.positive
    assert axis.negative
    axis.valid_until_ns = axis.sure_ns = FOREVER
    one.clear()
    assert axis.now == 0.0
    assert not axis.positive
    assert not axis.negative
    assert axis.valid_until_ns == axis.sure_ns == NEVER


@signs
def test_cleared_it_keeps_no_frame_that_was_not_read(sign: int) -> None:
    one, (axis,) = joystick("Enable", "near_far")
    one.note(frame(near_far=sign * 0.5), 0)
    one.clear()
    one.read()
    assert axis.now == 0.0
    one.note(frame(near_far=sign * 0.5), 1)  # and the same frame counts again
    one.read()
    assert axis.now == sign * 0.5


def test_so_many_frames_wait_and_are_read_together() -> None:
    one, (axis,) = joystick("Enable", "near_far")
    for number in range(1, 2 * MOST_UNREAD + 1):
        one.note(frame(near_far=0.1 + number / 1000), number)
        assert len(one._unread) == number % MOST_UNREAD
        assert axis.now == pytest.approx(
            0.1 + number // MOST_UNREAD * MOST_UNREAD / 1000 if number >= MOST_UNREAD else 0.0
        )


@pytest.mark.parametrize(
    ("enable", "axes", "changed", "waiting"),
    [
        ("Enable", ["near_far"], frame(near_far=0.5), 1),
        ("Enable", ["near_far"], frame(enable=0), 1),
        ("Enable", [], frame(near_far=0.5), 0),
        ("Enable", [], frame(enable=0), 1),
        (None, ["near_far"], frame(near_far=0.5), 1),
        (None, ["near_far"], frame(slew=0.5), 0),
        (None, ["near_far"], frame(slew=0.001), 0),
        (None, ["near_far"], frame(enable=0), 0),
        (None, ["slew", "near_far"], frame(slew=0.5), 1),
        (None, [], frame(slew=0.5, near_far=0.5, enable=0), 0),
    ],
)
def test_a_frame_waits_where_something_changed_that_is_read(
    enable: str | None, axes: list[str], changed: bytes, waiting: int
) -> None:
    one, _ = joystick(enable, *axes)
    one.note(frame(), 0)
    one.read()
    one.note(changed, 1)
    assert len(one._unread) == waiting
    assert one.received_ns == 1


def test_only_the_frame_that_releases_enable_forbids() -> None:
    one, (axis,) = joystick("Enable", "near_far")
    one.note(frame(near_far=0.5), 0)
    axis.valid_until_ns = FOREVER
    one.note(frame(near_far=0.5, enable=0), 1)
    assert axis.valid_until_ns == NEVER
    axis.valid_until_ns = FOREVER  # neutral has left since then, which holds
    one.note(frame(near_far=0.4, enable=0), 2)
    assert one.released
    assert axis.valid_until_ns == FOREVER


@pytest.mark.parametrize(
    ("on", "pressed", "agrees"), [(1, 1, True), (1, 0, False), (0, 0, True), (0, 1, False)]
)
def test_a_switch_agrees_until_its_timeout(on: int, pressed: int, agrees: bool) -> None:
    switch = GuardedSwitch(LEFT, "Enable", on, "enable")
    assert switch.free_ns == NEVER
    switch.note(frame(enable=pressed), 7)
    assert switch.free_ns == (7 + LEFT.config.timeout_ms * 1_000_000 if agrees else NEVER)
