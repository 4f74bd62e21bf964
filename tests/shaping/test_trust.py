"""Evidence for and against a sway sensor, idea by idea."""

import math

import pytest

from canshaper.shaping.sway import Measured
from canshaper.shaping.trust import (
    BOUND,
    Evidence,
    Path,
    Restlessness,
    Standstill,
    Trust,
    largest_jump,
)

TICK_S = 0.02
NOISE = math.radians(0.1)
SWING_S = 2.18
BIG, SMALL = math.radians(5.0), math.radians(0.05)


def evidence(*errors: float, times: int = 1, measured: Measured = Measured.ANGLE) -> Evidence:
    """After so many measurements with these errors: known, negated, alone, dragged."""
    known, negated, alone, dragged = errors
    one = Evidence(measured, NOISE, TICK_S)
    for _ in range(times):
        one.add((known, negated, alone, dragged))
    return one


def test_a_measurement_says_no_more_than_one_and_all_no_more_than_the_bound() -> None:
    assert evidence(SMALL, BIG, BIG, BIG).sign == 1.0
    assert evidence(SMALL, BIG, BIG, BIG, times=100).sign == BOUND
    assert evidence(BIG, SMALL, BIG, BIG, times=100).sign == -BOUND
    assert evidence(BIG, SMALL, BIG, BIG).sign == -1.0


# One measurement counts for a fifth: 20 ms of 80 ms, as an exponential.
PART = 1.0 - math.exp(-TICK_S / 0.08)
MODELS = [(Measured.ANGLE, 0.25), (Measured.RATE, 0.7)]


def spread(model_deg: float, smaller: float) -> float:
    """Variance of noise, model and eight times the smaller error."""
    return math.radians(0.1) ** 2 + math.radians(model_deg) ** 2 + 8.0 * PART * smaller**2


@pytest.mark.parametrize(("measured", "model_deg"), MODELS)
def test_the_ratio_is_that_of_the_mean_squares_over_the_spread_of_the_model(
    measured: Measured, model_deg: float
) -> None:
    other, known = math.radians(0.4), math.radians(0.2)
    expected = 0.5 * PART * (other**2 - known**2) / spread(model_deg, known)
    one = evidence(known, other, other, other, measured=measured)
    assert (one.sign, one.own, one.free) == pytest.approx((expected,) * 3, rel=1e-12)


@pytest.mark.parametrize(("measured", "model_deg"), MODELS)
def test_what_speaks_against_it_is_what_its_mean_square_has_beyond_four_times_the_others(
    measured: Measured, model_deg: float
) -> None:
    other, known = math.radians(0.2), math.radians(1.0)
    expected = -0.5 * PART * (known**2 - 4.0 * other**2) / spread(model_deg, other)
    one = evidence(known, other, other, other, measured=measured)
    assert (one.sign, one.own, one.free) == pytest.approx((expected,) * 3, rel=1e-12)


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


def test_it_is_proved_beyond_the_least_ratio_not_at_it() -> None:
    for sign, own in ((6.0, 7.0), (7.0, 6.0)):
        one = evidence(SMALL, BIG, BIG, BIG)
        one.sign, one.own = sign, own
        assert not one.proved(6.0)
        assert one.proved(math.nextafter(6.0, 0.0))


def test_a_fault_is_below_the_least_ratio_not_at_it() -> None:
    for bad in ((BIG, SMALL, BIG, BIG), (BIG, BIG, SMALL, BIG), (BIG, BIG, BIG, SMALL)):
        one = evidence(*bad, times=6)
        assert min(one.sign, one.own, one.free) == -6.0
        assert one.fault(-6.0) is None
        assert one.fault(math.nextafter(-6.0, 0.0)) is not None


def test_what_speaks_as_much_for_a_contact_as_for_the_other_sign_is_a_contact() -> None:
    assert evidence(BIG, SMALL, SMALL, BIG, times=8).fault(-6.0) is Trust.CONTACT
    assert evidence(BIG, SMALL, BIG, SMALL, times=8).fault(-6.0) is Trust.CONTACT


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


def test_when_it_begins_again_no_error_from_before_is_left() -> None:
    errors = SMALL, 2.0 * SMALL, 3.0 * SMALL, 4.0 * SMALL
    one, new = evidence(SMALL, BIG, BIG, BIG, times=4), evidence(*errors)
    one.clear()
    one.add(errors)
    assert (one.sign, one.own, one.free) == (new.sign, new.own, new.free)
    assert 0.0 < new.sign < new.own < new.free < 1.0


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
    values: list[float],
    bent_deg: float,
    *,
    command_active: bool = True,
    measured: Measured = Measured.ANGLE,
) -> list[Trust | None]:
    """Each measurement; degrees, and degrees per second a measurement."""
    one = Standstill(measured, NOISE, TICK_S, SWING_S)
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


def test_a_rate_that_stays_has_more_room_and_needs_more_of_a_swing() -> None:
    # Within 1 degree per second and three times the noise, for 20 degrees per second.
    wavy = [4.0, 5.29] * 6
    assert still(wavy, 1.67, measured=Measured.RATE) == [None] * 11 + [Trust.CONTACT]
    assert still(wavy, 1.66, measured=Measured.RATE)[-1] is None
    assert set(still([4.0, 5.31] * 20, 4.0, measured=Measured.RATE)) == {None}


def test_it_is_stuck_beyond_the_least_bend_not_at_it() -> None:
    least = math.radians(2.5)
    for sign in (1.0, -1.0):
        for bend, trust in ((least, None), (math.nextafter(least, 1.0), Trust.STUCK)):
            one = Standstill(Measured.ANGLE, NOISE, TICK_S, SWING_S)
            for _ in range(6):
                assert one.check(0.25, 0.0, command_active=True) is None
            assert one.check(0.25, sign * bend, command_active=True) is trust


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


def bent(one: Standstill, value: float, bent_deg: float, times: int) -> list[Trust | None]:
    """Measurements of one value again and again."""
    return [one.check(value, math.radians(bent_deg), command_active=False) for _ in range(times)]


@pytest.mark.parametrize("before_deg", [0.4, 4.0])
def test_where_it_moves_on_and_stays_again_the_bend_is_that_of_the_second_stay(
    before_deg: float,
) -> None:
    one = Standstill(Measured.ANGLE, NOISE, TICK_S, SWING_S)
    assert bent(one, 0.0, before_deg, 14)[-1] is Trust.STUCK
    assert set(bent(one, 0.5, 0.35, 7)) == {None}
    # 0.35 and six times 0.36 would not do, seven times that and 0.35 do.
    assert bent(one, 0.5, 0.36, 1) == [Trust.STUCK]


@pytest.mark.parametrize("before_deg", [0.4, 4.0])
def test_when_it_begins_again_no_bend_from_before_is_left(before_deg: float) -> None:
    one = Standstill(Measured.ANGLE, NOISE, TICK_S, SWING_S)
    assert bent(one, 0.5, before_deg, 14)[-1] is Trust.STUCK
    one.clear()
    assert set(bent(one, 0.5, 0.35, 7)) == {None}
    assert bent(one, 0.5, 0.36, 1) == [Trust.STUCK]


def test_it_is_restless_beyond_one_and_a_half_paths_and_full_speed_not_at_it() -> None:
    for command, path in ((0.0, 1.0), (0.5, 1.75), (1.0, 2.5)):
        assert not Restlessness(TICK_S).add(path, command)
        assert Restlessness(TICK_S).add(math.nextafter(path, 3.0), command)


def test_the_operators_path_counts_for_four_seconds_that_of_the_velocity_for_two() -> None:
    one = Restlessness(0.5)
    # The command rises once; the velocity goes half-way to and fro, a path of 2 in four ticks.
    rest, to_and_fro = [0.0] * 4, [0.5, 0.0] * 2
    said = [one.add(value, 1.0) for value in (*rest, *to_and_fro, *to_and_fro)]
    assert said == [False] * 8 + [True] * 4
    # What the velocity did is forgotten after as many ticks as it took.
    assert [one.add(0.0, 1.0) for _ in range(4)] == [True, False, False, False]


def test_the_length_of_a_path_is_that_of_its_last_steps() -> None:
    path = Path(3)
    assert path.add(0.0) == 0.0
    values, steps = [1.0, 3.0, -1.0, 7.0, 7.0, 7.0, 7.0], [1.0, 2.0, 4.0, 8.0, 0.0, 0.0, 0.0]
    lengths = [path.add(value) for value in values]
    assert lengths == [sum(steps[max(0, k - 2) : k + 1]) for k in range(len(steps))]
    assert lengths == [1.0, 3.0, 7.0, 14.0, 12.0, 8.0, 0.0]
