"""The grapple on a circle, judged by a plain simulation of a point pendulum in the plane."""

import math

import pytest

from canshaper.shaping.gff import Gff
from canshaper.shaping.radial import RadialCompensation
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
