"""What speaks for a sway sensor and what against it, idea by idea."""

import math

import pytest

from canshaper.shaping.sway_sensor import Measured
from canshaper.shaping.trust import (
    BOUND,
    Evidence,
    Restlessness,
    Standstill,
    Trust,
    largest_jump,
)

TICK_S = 0.02
NOISE = math.radians(0.1)
SWING_S = 2.18
BIG, SMALL = math.radians(5.0), math.radians(0.05)


def evidence(*errors: float, times: int = 1) -> Evidence:
    """After so many measurements with these errors: known, negated, alone, dragged."""
    known, negated, alone, dragged = errors
    one = Evidence(Measured.ANGLE, NOISE, TICK_S)
    for _ in range(times):
        one.add((known, negated, alone, dragged))
    return one


def test_a_measurement_says_no_more_than_one_and_all_no_more_than_the_bound() -> None:
    assert evidence(SMALL, BIG, BIG, BIG).sign == 1.0
    assert evidence(SMALL, BIG, BIG, BIG, times=100).sign == BOUND
    assert evidence(BIG, SMALL, BIG, BIG, times=100).sign == -BOUND
    assert evidence(BIG, SMALL, BIG, BIG).sign == -1.0


def test_the_ratio_is_that_of_the_mean_squares_over_the_spread_of_the_model() -> None:
    # One measurement counts for a fifth: 20 ms of 80 ms, as an exponential.
    part = 1.0 - math.exp(-TICK_S / 0.08)
    other, known = math.radians(0.4), math.radians(0.2)
    spread = math.radians(0.1) ** 2 + math.radians(0.25) ** 2 + 8.0 * part * known**2
    expected = 0.5 * part * (other**2 - known**2) / spread
    one = evidence(known, other, other, other)
    assert (one.sign, one.own, one.free) == pytest.approx((expected,) * 3)


def test_another_idea_is_ahead_only_where_its_error_is_far_smaller() -> None:
    assert evidence(1.9 * SMALL, SMALL, SMALL, SMALL, times=50).sign == 0.0
    worse = evidence(BIG, 0.4 * BIG, 0.6 * BIG, 0.4 * BIG, times=50)
    assert worse.sign < 0.0 == worse.own
    assert worse.free < 0.0


@pytest.mark.parametrize(
    ("errors", "fault"),
    [
        ((SMALL, BIG, BIG, BIG), None),
        ((BIG, SMALL, BIG, BIG), Trust.WRONG_SIGN),
        ((BIG, BIG, SMALL, BIG), Trust.CONTACT),
        ((BIG, BIG, BIG, SMALL), Trust.CONTACT),
    ],
)
def test_which_idea_is_the_better_one(
    errors: tuple[float, float, float, float], fault: Trust | None
) -> None:
    one = evidence(*errors, times=8)
    assert one.fault(-6.0) is fault
    assert one.fault(-9.0) is None
    assert one.proved(6.0) is (fault is None)
    assert not one.proved(9.0)


def test_a_dragged_grapple_is_not_ruled_out_before_it_is_trusted() -> None:
    assert evidence(SMALL, BIG, BIG, SMALL, times=8).proved(6.0)
    assert not evidence(SMALL, SMALL, BIG, BIG, times=8).proved(6.0)
    assert not evidence(SMALL, BIG, SMALL, BIG, times=8).proved(6.0)


def test_what_speaks_against_it_stays_when_it_begins_again() -> None:
    bad, good = evidence(BIG, *(SMALL,) * 3, times=4), evidence(SMALL, *(BIG,) * 3, times=4)
    for one in (bad, good):
        one.clear()
        assert one.surprise == 0.0
    assert (bad.sign, bad.own, bad.free) == (-4.0, -4.0, -4.0)
    assert (good.sign, good.own, good.free) == (0.0, 0.0, 0.0)


def test_the_surprise_is_the_last_errors_root_mean_square() -> None:
    assert evidence(BIG, 0.0, 0.0, 0.0, times=100).surprise == pytest.approx(BIG)
    assert evidence(BIG, 0.0, 0.0, 0.0, times=4).surprise == pytest.approx(
        BIG * math.sqrt(1.0 - math.exp(-1.0))
    )


@pytest.mark.parametrize(
    ("measured", "period_s", "deg"),
    [
        (Measured.ANGLE, 0.02, 1.5 + 0.5),
        (Measured.ANGLE, 0.01, 1.5 + 0.5),
        (Measured.ANGLE, 0.1, 7.5 + 0.5),
        (Measured.RATE, 0.02, 2.5 + 0.5),
    ],
)
def test_a_jump_grows_with_the_time_between_two_measurements(
    measured: Measured, period_s: float, deg: float
) -> None:
    assert math.degrees(largest_jump(measured, NOISE, period_s)) == pytest.approx(deg)


def still(
    values: list[float], bent_deg: float, *, command_active: bool = True
) -> list[Trust | None]:
    """What each measurement says; degrees, and degrees per second a measurement."""
    one = Standstill(Measured.ANGLE, NOISE, TICK_S, SWING_S)
    bent = math.radians(bent_deg)
    return [one.check(math.radians(value), bent, command_active=command_active) for value in values]


def test_the_same_value_while_the_model_bends_is_stuck_after_an_eighth_of_a_second() -> None:
    # Six periods, seven values, 2.5 deg/s.
    assert still([4.0] * 7, 0.36) == [None] * 6 + [Trust.STUCK]
    assert still([4.0] * 7, -0.36)[-1] is Trust.STUCK
    assert still([4.0] * 7, 0.35)[-1] is None
    assert still([4.0] * 7, 0.36, command_active=False)[-1] is Trust.STUCK


def test_a_value_that_stays_is_contact_while_the_operator_asks() -> None:
    # A tenth of a swing: eleven periods; within 0.35 degrees and three times the noise.
    wavy = [4.0, 4.64] * 6
    assert still(wavy, 0.42) == [None] * 11 + [Trust.CONTACT]
    assert still(wavy, 0.41)[-1] is None
    assert still(wavy, 0.42, command_active=False)[-1] is None
    assert set(still([4.0, 4.66] * 20, 1.0)) == {None}


def test_while_it_stays_longer_what_it_would_have_bent_adds_up() -> None:
    assert still([4.0] * 14, 0.2)[12:] == [Trust.STUCK] * 2
    assert still([4.0] * 14, 0.2)[11] is None


def test_what_has_moved_is_forgotten() -> None:
    one = Standstill(Measured.ANGLE, NOISE, TICK_S, SWING_S)
    for value in [0.0, 0.1, 0.2, *[0.3] * 6]:
        assert one.check(value, 0.1, command_active=True) is None
    assert one.check(0.3, 0.1, command_active=True) is Trust.STUCK
    one.clear()
    for _ in range(6):
        assert one.check(0.3, 0.1, command_active=True) is None


def test_a_velocity_that_goes_to_and_fro_is_distinguished_from_the_operators() -> None:
    one = Restlessness(TICK_S)
    # Full speed and back, twice: a path of 4; the operator's is as long: up to 7 is calm.
    path = [1.0, 0.0, -1.0, 0.0]
    assert not any(one.add(value, value) for value in path)
    assert not any(one.add(0.5 * (-1.0) ** k, 0.0) for k in range(3))
    assert not one.add(0.9, 0.0)
    assert one.add(0.7, 0.0)
