"""The grapple on a circle, judged by a plain simulation of a point pendulum in the plane."""

import math

import pytest

from canshaper.shaping.radial import RadialCompensation
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode, SwayModel

LENGTH_M = 1.2
CIRCLE_M = 3.0
FULL_RAD_S = 0.5
TICK_S = 0.005
MODE = SwayMode(math.sqrt(GRAVITY_M_S2 / LENGTH_M), 0.0)


def slew(*, compensated: bool) -> tuple[float, float]:
    """Largest radial and tangential swing (m) after a slew of 3 s, small-angle point pendulum."""
    model = SwayModel(MODE, TICK_S)
    gff = Gff(model, (-4.0, -4.0), -4.0)
    radial = RadialCompensation(MODE, FULL_RAD_S, 1.0, 1.0)
    angle, radius = 0.0, CIRCLE_M
    x, y, vx, vy = CIRCLE_M, 0.0, 0.0, 0.0  # grapple
    told = 0.0
    worst_r = worst_t = 0.0
    for i in range(round(9.0 / TICK_S)):
        slew_added, before = radial.slew(model, told), radial.tip_share(model, told)
        told = gff.wanted(1.0 if i * TICK_S < 3.0 else 0.0)
        model.step(told)
        now = radial.tip_share(model, told)
        near_far_added = radial.near_far(before, now, CIRCLE_M, TICK_S)
        near_far, sent = (near_far_added, told + slew_added) if compensated else (0.0, told)
        for _ in range(10):  # inner steps: the tip moves on, the grapple follows it
            h = TICK_S / 10.0
            angle += FULL_RAD_S * sent * h
            radius += near_far * h
            tip_x, tip_y = radius * math.cos(angle), radius * math.sin(angle)
            vx += MODE.omega_rad_s**2 * (tip_x - x) * h
            vy += MODE.omega_rad_s**2 * (tip_y - y) * h
            x, y = x + vx * h, y + vy * h
        if i * TICK_S > 6.0:
            dx, dy = tip_x - x, tip_y - y
            worst_r = max(worst_r, abs(dx * math.cos(angle) + dy * math.sin(angle)))
            worst_t = max(worst_t, abs(dy * math.cos(angle) - dx * math.sin(angle)))
    return worst_r, worst_t


def test_compensation_leaves_a_grapple_at_rest_in_both_planes() -> None:
    plain_r, plain_t = slew(compensated=False)
    radial, tangential = slew(compensated=True)
    assert plain_r > 0.03
    assert radial < 0.05 * plain_r
    assert tangential < max(0.1 * plain_t, 1e-3)


def test_nothing_is_added_at_rest_or_at_constant_speed() -> None:
    model = SwayModel(MODE, TICK_S)
    radial = RadialCompensation(MODE, FULL_RAD_S, 1.0, 1.0)
    assert radial.slew(model, 0.0) == 0.0
    assert radial.near_far(radial.tip_share(model, 0.0), 1.0, CIRCLE_M, TICK_S) == 0.0
    model.rate = -1.0  # the grapple runs with the tip
    assert radial.slew(model, 1.0) == pytest.approx(0.0)
    share = radial.tip_share(model, 1.0)
    model.step(1.0)
    after = radial.tip_share(model, 1.0)
    assert radial.near_far(share, after, CIRCLE_M, TICK_S) == pytest.approx(0.0)


def test_what_is_added_is_bounded_and_a_number_even_for_a_senseless_model() -> None:
    model = SwayModel(MODE, TICK_S)
    radial = RadialCompensation(MODE, FULL_RAD_S, 1.0, 0.25)
    for model.angle, model.rate in ((5.0, -40.0), (math.nan, 0.0), (1e300, 1e300)):
        share = radial.tip_share(model, 0.0)
        assert abs(radial.slew(model, 0.0)) <= 0.25
        assert abs(radial.near_far(1.0, share, CIRCLE_M, TICK_S)) <= 0.25


# -- with damping, and full speeds that are not 1 --------------------------------------------------

FINE_S = 1e-4
DAMPED = SwayMode(2.9, 0.12)
NEAR_FAR = SwayMode(2.4, 0.2)


def mid_slew() -> list[tuple[float, float, SwayModel]]:
    """Three moments of a swinging slew, FINE_S apart, each with what the model was told."""
    moments = []
    model = SwayModel(DAMPED, FINE_S)
    for i in range(7003):
        told = 0.9 if i < 5000 else 0.4  # in the middle of a change of speed
        model.step(told)
        if i >= 7000:
            copy = SwayModel(DAMPED, FINE_S)
            copy.angle, copy.rate = model.angle, model.rate
            moments.append((i * FINE_S, told, copy))
    return moments


def grapple(model: SwayModel, full_rad_s: float) -> tuple[float, float]:
    """Angular speed of the grapple, and by how much the tip is ahead of it."""
    return -model.rate * full_rad_s, model.angle * full_rad_s


def slope(before: float, after: float) -> float:
    return (after - before) / (2.0 * FINE_S)


@pytest.mark.parametrize("full_rad_s", [0.5, 0.8])
def test_slew_is_given_the_speed_of_the_lead_that_it_does_not_make_itself(
    full_rad_s: float,
) -> None:
    """tan psi = L / s5 along the motion of the model: psi' - L', as differences show it."""
    radial = RadialCompensation(NEAR_FAR, full_rad_s, 0.7, 1.0)
    leads = []
    for _, _, model in (moments := mid_slew()):
        speed, lead = grapple(model, full_rad_s)
        leads.append(math.atan2(lead, 1.0 - speed**2 / DAMPED.omega_rad_s**2) - lead)
    _, told, now = moments[1]
    expected = slope(leads[0], leads[2]) / full_rad_s
    assert abs(expected) > 1e-3
    assert radial.slew(now, told) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("full_rad_s", [0.5, 0.8])
def test_the_damping_of_the_joint_is_answered_by_the_speed_inwards(full_rad_s: float) -> None:
    """(2 zeta6 / w6) D', with D = (w^2 - w5^2 L^2) / w6^2 along the motion of the model."""
    undamped = RadialCompensation(SwayMode(NEAR_FAR.omega_rad_s, 0.0), full_rad_s, 0.7, 1.0)
    damped = RadialCompensation(NEAR_FAR, full_rad_s, 0.7, 1.0)
    inwards = []
    for _, _, model in (moments := mid_slew()):
        speed, lead = grapple(model, full_rad_s)
        inwards.append((speed**2 - (DAMPED.omega_rad_s * lead) ** 2) / NEAR_FAR.omega_rad_s**2)
    _, told, now = moments[1]
    answer = 2.0 * NEAR_FAR.damping_ratio / NEAR_FAR.omega_rad_s * slope(inwards[0], inwards[2])
    assert abs(answer) > 1e-3
    share = damped.tip_share(now, told) - undamped.tip_share(now, told)
    assert share == pytest.approx(answer, rel=1e-4)


def test_the_change_of_the_radius_is_a_speed_of_near_far_in_parts_of_its_full_speed() -> None:
    radial = RadialCompensation(NEAR_FAR, 0.5, 0.7, 0.25)
    # 4 m of 0.2 % within a tick of 50 ms are 0.16 m/s
    assert radial.near_far(0.990, 0.992, 4.0, 0.05) == pytest.approx(0.16 / 0.7)
    assert radial.near_far(0.992, 0.990, 4.0, 0.05) == pytest.approx(-0.16 / 0.7)
    assert radial.near_far(0.9, 1.0, 4.0, 0.05) == 0.25
    assert radial.near_far(1.0, 0.9, 4.0, 0.05) == -0.25
    for bad in (math.nan, math.inf, -math.inf):
        assert radial.near_far(bad, 1.0, 4.0, 0.05) == 0.0
