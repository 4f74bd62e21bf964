"""Velocity that a two-axis motion adds, against the equations of the path, term by term."""

import math

import pytest

from canshaper.shaping import two_axis_motion
from canshaper.shaping.moving_axis import MOST_STEP, GrapplePath, MovingAxis
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.two_axis_motion import TwoAxisMotion, farthest_m
from tests.shaping.two_axes import NEAR_FAR, OUT_M_S, SLEW, TICK_S, TURN_RAD_S, slewing

EXACT = 1e-12
UNDAMPED = SwayMode(NEAR_FAR.omega_rad_s, 0.0)
WIDE_M = 100.0  # bounds no way


def axis(
    mode: SwayMode, full: float, angle: float, rate: float, applied: float, **more: bool
) -> MovingAxis:
    """An axis in motion; what it joins, it joins at its target: ``reached`` shows that."""
    sway = SwayModel(mode, TICK_S)
    sway.angle, sway.rate = angle, rate
    moving = MovingAxis(full, TICK_S, sway, applied, able=True, **more)
    moving.joins = True
    return moving


def added(slew: MovingAxis, near_far: MovingAxis | None, radius_m: float) -> tuple[float, float]:
    """Positions to which the motion takes both axes, of a grapple at this radius."""
    TwoAxisMotion(slew, near_far, WIDE_M).step(TICK_S, None, radius_m)
    return slew.reached, 0.0 if near_far is None else near_far.reached


def hanging(turn: GrapplePath, out: GrapplePath, radius_m: float) -> tuple[float, float]:
    """Psi - L and R - rho - D of an undamped near-far axis, as the equations have them."""
    lead, _, speed, acceleration = turn
    lead_m, _, rho_1, rho_2 = out
    across, along = SLEW.omega_rad_s**2, NEAR_FAR.omega_rad_s**2
    rho = radius_m + TICK_S * rho_1

    def coriolis(after_s: float) -> float:
        """Along the path, per radius."""
        rate = rho_1 + after_s * rho_2
        radius = rho + after_s * rho_1 + 0.5 * after_s**2 * rho_2
        return 2.0 * rate * (speed + after_s * acceleration) / radius

    h = 1e-4
    change = (coriolis(h) - coriolis(-h)) / (2.0 * h)
    lag_s = 2.0 * SLEW.damping_ratio / SLEW.omega_rad_s
    # Of phi'' what the joint pulls by its angle; the damper's part of Coriolis to first order.
    a_t = rho * (across * lead + coriolis(0.0) - lag_s * change)
    a_r = rho_2 - rho * speed**2
    psi = math.atan(a_t / max(across * rho + a_r, 0.5 * across * rho))
    tip_m = rho * math.cos(psi) + (a_r * math.cos(psi) + a_t * math.sin(psi)) / along
    return psi - lead, tip_m - rho - lead_m


# Full speed of slew, rad/s; lead, rate and velocity of the axes as their models have them.
PATHS = [
    pytest.param(0.5, (0.3, -0.2, 0.4), (0.1, -0.6, 0.9), id="both speed up"),
    pytest.param(0.5, (-0.3, -0.9, 0.6), (-0.08, 0.7, -0.2), id="in and slower"),
    pytest.param(1.2, (0.5, -0.8, 0.9), (0.0, -1.0, 1.0), id="far ahead, steady out"),
    pytest.param(1.2, (0.2, 0.8, -0.3), (0.2, -0.5, 0.9), id="the other way"),
    pytest.param(2.5, (0.1, -0.9, 0.95), (0.05, -0.3, 0.5), id="faster than small angles"),
]
State = tuple[float, float, float]


@pytest.mark.parametrize("radius_m", [1.5, 6.0])
@pytest.mark.parametrize(("full", "turning", "going_out"), PATHS)
def test_the_tip_stands_where_gravity_makes_the_accelerations_of_the_path(
    full: float, turning: State, going_out: State, radius_m: float
) -> None:
    slew = axis(SLEW, full, *turning, commanded=True)
    near_far = axis(UNDAMPED, OUT_M_S, *going_out, commanded=True)
    expected = hanging(slew.path(TICK_S), near_far.path(TICK_S), radius_m)
    assert added(slew, near_far, radius_m) == pytest.approx(expected, rel=0.0, abs=1e-8)
    assert min(map(abs, expected)) > 1e-4


@pytest.mark.parametrize("full", [0.5, 1.2, 2.5])
def test_a_near_far_axis_at_rest_has_no_path_whatever_its_model_has_left(full: float) -> None:
    slew = axis(SLEW, full, 0.3, -0.8, 0.9, commanded=True)
    near_far = axis(UNDAMPED, OUT_M_S, 0.2, -0.5, 0.4)
    expected = hanging(slew.path(TICK_S), (0.0, 0.0, 0.0, 0.0), 3.0)
    assert added(slew, near_far, 3.0) == pytest.approx(expected, rel=0.0, abs=EXACT)


@pytest.mark.parametrize(
    ("full", "left"),  # of gravity across the boom: 1 - (phi' / w5)^2, not below a half
    [(0.5, None), (1.2, None), (2.5, 0.5)],
)
def test_the_boom_is_ahead_of_a_grapple_on_a_circle_by_one_angle_at_every_radius(
    full: float, left: float | None
) -> None:
    alone = axis(SLEW, full, 0.3, -0.85, 0.9, commanded=True)
    lead, _, speed, _ = alone.path(TICK_S)
    if left is None:
        left = 1.0 - (speed / SLEW.omega_rad_s) ** 2
    psi = math.atan(lead / left)
    assert added(alone, None, 0.0)[0] == pytest.approx(psi - lead, rel=0.0, abs=EXACT)
    for radius_m in (2.0, 9.0):
        slew = axis(SLEW, full, 0.3, -0.85, 0.9, commanded=True)
        near_far = axis(UNDAMPED, OUT_M_S, 0.0, 0.0, 0.0)
        assert added(slew, near_far, radius_m)[0] == pytest.approx(psi - lead, rel=0.0, abs=EXACT)


@pytest.mark.parametrize("path_m", [0.03, 0.05])
def test_near_far_is_not_moved_out_farther_than_the_path(path_m: float) -> None:
    """A boom that stands ahead of a grapple without speed needs the tip farther out."""
    slew = axis(SLEW, 1.0, 0.4, 0.0, 0.0, commanded=True)
    near_far = axis(UNDAMPED, OUT_M_S, 0.0, 0.0, 0.0)
    assert hanging(slew.path(TICK_S), (0.0, 0.0, 0.0, 0.0), 6.0)[1] > 0.05
    TwoAxisMotion(slew, near_far, path_m).step(TICK_S, None, 6.0)
    assert near_far.reached == path_m


def test_what_was_added_by_a_radius_ends_without_one_and_keeps_its_place() -> None:
    slew = axis(SLEW, TURN_RAD_S, 0.3, -0.8, 0.9, commanded=True)
    near_far = axis(UNDAMPED, OUT_M_S, 0.0, 0.0, 0.0)
    near_far.added, near_far.reached, near_far.joins = -0.25, -0.04, False
    motion = TwoAxisMotion(slew, near_far, WIDE_M)
    ends = []
    for _ in range(3):
        motion.step(TICK_S, None)
        ends.append(near_far.added)
        assert near_far.reached == -0.04
    assert ends == pytest.approx([-0.25 + MOST_STEP, -0.25 + 2 * MOST_STEP, 0.0])


def carried(elapsed_s: float, later_m: float) -> float:
    """Way of near-far, where the tip is at 3 m and, so much later, elsewhere."""
    slew = axis(SLEW, 1.2, 0.3, -0.8, 0.9, commanded=True)
    near_far = axis(UNDAMPED, OUT_M_S, 0.0, 0.0, 0.0, commanded=True)
    motion = TwoAxisMotion(slew, near_far, WIDE_M)
    motion.step(TICK_S, 3.0)
    near_far.reached, near_far.joins = 0.0, True
    motion.step(elapsed_s, later_m)
    return near_far.reached


def moved_at(radius_m: float) -> float:
    """Way of near-far for a grapple at this radius."""
    slew = axis(SLEW, 1.2, 0.3, -0.8, 0.9, commanded=True)
    near_far = axis(UNDAMPED, OUT_M_S, 0.0, 0.0, 0.0, commanded=True)
    return added(slew, near_far, radius_m)[1]


def test_the_grapple_is_behind_the_tip_by_its_lead_and_by_what_was_added() -> None:
    measured, known = (
        axis(UNDAMPED, 0.8, 0.25, -0.3, 0.5, commanded=True),
        axis(UNDAMPED, 0.8, 0.25, -0.3, 0.5, commanded=True),
    )
    slew = axis(SLEW, 1.2, 0.3, -0.8, 0.9, commanded=True)
    measured.reached = 0.1
    TwoAxisMotion(slew, measured, WIDE_M).step(TICK_S, 3.0)
    assert measured.reached == pytest.approx(
        added(slew, known, 3.0 - 0.8 * 0.25 - 0.1)[1], rel=0.0, abs=EXACT
    )


@pytest.mark.parametrize(
    ("elapsed_s", "radius_m"), [(0.02, 3.01), (0.5, 3.25), (1.0, 3.5), (1.5, 3.5), (9.0, 3.5)]
)
def test_a_measured_radius_corrects_the_carried_one_within_a_second_and_no_farther(
    elapsed_s: float, radius_m: float
) -> None:
    assert carried(elapsed_s, 3.5) == pytest.approx(moved_at(radius_m), rel=0.0, abs=EXACT)


def test_a_measured_radius_corrects_the_carried_one_within_the_time_constant(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(two_axis_motion, "RADIUS_S", 2.0)
    assert carried(0.5, 3.4) == pytest.approx(moved_at(3.1), rel=0.0, abs=EXACT)


@pytest.mark.parametrize("elapsed_s", [0.03, 0.5])
def test_a_part_that_comes_back_is_whole_and_no_more(elapsed_s: float) -> None:
    """However the steps divide the time in which it comes back."""
    slew = axis(SLEW, TURN_RAD_S, 0.3, -0.8, 0.9, commanded=True)
    near_far = axis(UNDAMPED, OUT_M_S, 0.0, 0.0, 0.0)
    motion = TwoAxisMotion(slew, near_far, WIDE_M)
    slew.able = False
    motion.step(0.2, 3.0)
    slew.able = True
    for _ in range(7):
        motion.step(elapsed_s, 3.0)
    target = near_far.reached
    near_far.added, near_far.reached = 0.0, target + 0.001
    motion.step(0.0, 3.0)
    assert near_far.added == pytest.approx(-0.001 / (OUT_M_S * TICK_S), rel=1e-9)
    assert near_far.damps


def test_after_a_stop_it_begins_again_from_nothing_where_both_are() -> None:
    motion, _, near_far = slewing()
    near_far.sent = -0.25
    motion.step(TICK_S, 3.0)
    near_far.sent = 0.0
    way = near_far.way
    motion.stop()
    assert (near_far.joins, near_far.way) == (True, way)
    assert way < 0.0
    for _ in range(9):
        motion.step(TICK_S, 3.0)
        assert not near_far.damps  # not whole before a fifth of a second
    for _ in range(2):
        motion.step(TICK_S, 3.0)
    assert near_far.damps


def test_it_damps_no_more_where_it_was_moved_as_far_as_it_may() -> None:
    motion, _, near_far = slewing(path_m=0.25)
    near_far.damped = -0.25
    motion.step(TICK_S, 3.0)
    assert not near_far.damps
    near_far.damped = math.nextafter(-0.25, 0.0)
    motion.step(TICK_S, 3.0)
    assert near_far.damps


def test_it_damps_where_it_can_just_stop_before_its_bound() -> None:
    motion, _, near_far = slewing()
    near_far.farthest = 0.2
    near_far.largest = near_far.room(1.0)
    motion.step(TICK_S, 3.0)
    assert near_far.damps
    near_far.largest *= 1.0 + 1e-9
    motion.step(TICK_S, 3.0)
    assert not near_far.damps


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_damps_as_long_as_there_is_room_between_its_way_and_its_bound(sign: float) -> None:
    motion, _, near_far = slewing()
    near_far.farthest, near_far.largest = 0.2, 0.25
    # From 0.25, by 0.1 less in each tick, it stops within 9 mm.
    for way, damps in ((0.12, True), (0.19, True), (0.192, False), (0.21, False)):
        near_far.way = sign * way
        motion.step(TICK_S, 3.0)
        assert near_far.damps is damps, way


@pytest.mark.parametrize("path_m", [0.3, 1.0])
def test_near_far_is_moved_by_the_path_and_as_far_again_where_it_damps(path_m: float) -> None:
    assert farthest_m(path_m, damps=False) == path_m
    assert farthest_m(path_m, damps=True) == path_m + path_m
