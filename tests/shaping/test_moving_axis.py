"""An axis as the motion of two sees it, in numbers that are exact in binary."""

import math

import pytest

from canshaper.shaping.moving_axis import MovingAxis
from canshaper.shaping.sway import SwayMode, SwayModel

# w = 4 rad/s, zeta = 1/4: w^2 = 16, 2 zeta w = 2, 2 zeta / w = 1/8.
MODE = SwayMode(4.0, 0.25)
PERIOD_S = 0.125


def moving(full_speed: float = 0.5) -> MovingAxis:
    """Return an axis at rest."""
    return MovingAxis(full_speed, PERIOD_S, SwayModel(MODE, PERIOD_S))


def test_the_coefficients_are_those_of_the_sway_mode() -> None:
    axis = moving()
    assert (axis.stiffness, axis.damping, axis.lag_s) == (16.0, 2.0, 0.125)
    axis.follow(SwayModel(SwayMode(2.0, 0.5), PERIOD_S))
    assert (axis.stiffness, axis.damping, axis.lag_s) == (4.0, 2.0, 0.5)


def test_what_is_held_goes_on_at_its_share_of_full_speed() -> None:
    axis = moving()
    axis.reached, axis.added = 1.0, -0.25
    axis.held(0.5)
    assert axis.reached == 1.0 - 0.25 * 0.5 * 0.5


def test_the_path_is_the_swing_to_the_second_order_from_the_state_of_the_model() -> None:
    """The state is that of 1/4 s from now; the path is asked for 1/2 s after that."""
    axis = moving(full_speed=2.0)
    axis.sway.angle, axis.sway.rate, axis.applied, axis.ahead_s = 1.0, 0.5, 0.25, 0.25
    # Lead 1, rate 0.5 + 0.25; acceleration of the lead -(16 * 1 + 2 * 0.75).
    lead, rate, acceleration = 1.0, 0.75, -17.5
    later = lead + 0.5 * rate + 0.5 * 0.5**2 * acceleration
    later_rate = rate + 0.5 * acceleration
    assert (later, later_rate) == (-0.8125, -8.0)
    # The grapple: 0.25 + 8 fast, and pulled by 16 * 0.8125 + 2 * 8 towards the tip.
    assert axis.path(0.75) == (2.0 * -0.8125, 2.0 * -8.0, 2.0 * 8.25, 2.0 * -29.0)


def test_the_path_now_is_the_state_of_the_model() -> None:
    axis = moving(full_speed=2.0)
    axis.sway.angle, axis.sway.rate, axis.applied = 1.0, 0.5, 0.25
    assert axis.path(0.0) == (2.0, 1.5, -1.0, 2.0 * 17.5)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_room_is_used_up_by_a_velocity_that_falls_to_rest(sign: float) -> None:
    """It falls by 1/2 each 1/8 s, and stops 1/4 m from where the operator left it."""
    axis = moving()
    axis.fall_per_s, axis.farthest, axis.way = 4.0, 0.25, sign * 0.0625
    assert (1.5 + 1.0 + 0.5) * 0.5 * 0.125 == 0.25 - 0.0625
    assert axis.room(sign) == 1.5
    assert (2.0 + 1.5 + 1.0 + 0.5) * 0.5 * 0.125 == 0.25 + 0.0625
    assert axis.room(-sign) == 2.0


def test_the_bound_of_the_way_binds_no_axis_that_its_operator_moves() -> None:
    axis = moving()
    axis.farthest = axis.way = 0.25
    axis.add(1.0, 1.0)
    assert axis.added == 0.0
    axis.commanded = True
    axis.add(1.0, 1.0)
    assert axis.added == 0.1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_full_speed_itself_is_added_and_no_more(sign: float) -> None:
    axis = moving()
    axis.added = sign * 0.9375
    axis.add(sign * 0.125 * 0.5, 1.0)
    assert (axis.added, axis.reached) == (sign, sign * 0.0625)
    axis.add(sign * 1.0, 1.0)
    assert (axis.added, axis.reached) == (sign, sign * 0.125)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_less_than_a_millionth_of_full_speed_is_nothing(sign: float) -> None:
    axis = moving(full_speed=8.0)  # 1 m in a period
    axis.add(sign * 1e-6, 1.0)
    assert axis.added == axis.reached == sign * 1e-6
    axis = moving(full_speed=8.0)
    axis.add(sign * math.nextafter(1e-6, 0.0), 1.0)
    assert axis.added == axis.reached == 0.0


def test_what_a_fading_part_leaves_out_is_not_made_up_for() -> None:
    axis = moving(full_speed=8.0)
    axis.add(0.0625, 0.5)
    assert (axis.added, axis.reached) == (0.03125, 0.0625)
    axis.add(0.0625, 1.0)
    assert (axis.added, axis.reached) == (0.0, 0.0625)


def test_what_the_largest_step_leaves_out_is_made_up_for() -> None:
    axis = moving(full_speed=8.0)
    axis.add(0.125, 1.0)
    assert axis.added == axis.reached == 0.1
    axis.add(0.125, 1.0)
    assert (axis.added, axis.reached) == (0.125 - 0.1, 0.125)
