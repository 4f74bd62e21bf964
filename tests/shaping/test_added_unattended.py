"""When an axis is unattended, and the time for which a motion may move it that comes back then."""

import pytest

from canshaper.shaping.axis import UNATTENDED_TICKS, ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.off import Off
from canshaper.shaping.states import CommandInput
from canshaper.shaping.sway import SwayMode, SwayModel

TICK_S, TAIL = 0.02, 5
LIMITS = OutputLimits(tail_s=TAIL * TICK_S, rise_per_s=10.0, fall_per_s=10.0)


def axis() -> ShapedAxis:
    """An axis in neutral, which a motion may move for ten ticks."""
    one = ShapedAxis(TICK_S, LIMITS, sway=SwayModel(SwayMode(2.86, 0.05), TICK_S), shaper=Off())
    one.allow_added(0.25, 10 * TICK_S)
    return one


@pytest.mark.parametrize("command", [0.0, 0.021, -1.0])
def test_it_is_unattended_when_its_joystick_rested_for_longer_than_the_tail(command: float) -> None:
    one = axis()
    if command:
        one.tick(CommandInput())
        one.tick(CommandInput(command))
    for _ in range(TAIL + UNATTENDED_TICKS):
        one.tick(CommandInput())
        assert not one.unattended
    one.tick(CommandInput())
    assert one.unattended


def test_missed_ticks_count() -> None:
    one = axis()
    one.tick(CommandInput())
    one.tick(CommandInput(1.0))
    one.tick(CommandInput())
    one.hold(TAIL + UNATTENDED_TICKS - 1)
    assert not one.unattended
    one.tick(CommandInput())
    assert one.unattended


def test_the_time_that_is_given_back_moves_it_again() -> None:
    one = axis()
    one.tick(CommandInput())
    for _ in range(30):
        one.tick(CommandInput(), 0.2)
    assert one.raw == 0
    one.renew_added_time()
    one.tick(CommandInput(), 0.2)
    assert one.raw
