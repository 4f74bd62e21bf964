"""Ground and pile under the grapple, against what must hold of any of them."""

import math

import pytest

from canshaper_sim.contact import ContactParameters
from canshaper_sim.crane import LIFT, NEAR_FAR, SLEW, Crane, CraneParameters
from canshaper_sim.grapple import Grapple, Sway

TICK_S = 0.02
# By default the tip stands 4 m high, the end of the grapple at 4 - 0.2 - 1.2 - 0.3 = 2.3 m.
HANGS_M = 2.3
SOFT = ContactParameters().stiffness_n_m


def crane(sway: Sway | None = None, *, damped: bool = True, **contact: float) -> Crane:
    grapple = Grapple() if damped else Grapple(c5_n_m_s_rad=0.0, c6_n_m_s_rad=0.0)
    parameters = CraneParameters(grapple=grapple, contact=ContactParameters(**contact))
    return Crane(parameters, sway)


def end_m(one: Crane) -> float:
    """Height of the end of the grapple."""
    state, grapple = one.state, one.parameters.grapple
    below = grapple.l2_m + one.parameters.contact.reach_m
    return state.height_m - math.cos(state.theta5_rad) * (
        grapple.l1_m + below * math.cos(state.theta6_rad)
    )


def energy_j(one: Crane) -> float:
    """Of link and grapple below a tip that stands, and of the spring of the ground."""
    state, g = one.state, one.parameters.grapple
    l3 = g.l1_m + g.l2_m * math.cos(state.theta6_rad)
    inertia = g.m1_kg * g.l1_m**2 + g.m2_kg * l3**2
    moving = (
        inertia * state.theta5_rate_rad_s**2 + g.m2_kg * (g.l2_m * state.theta6_rate_rad_s) ** 2
    )
    high = -(g.m1_kg * g.l1_m + g.m2_kg * l3) * math.cos(state.theta5_rad)
    depth = max(0.0, one.parameters.contact.ground_m - end_m(one))
    return 0.5 * moving + g.g_m_s2 * high + 0.5 * SOFT * depth**2


def test_above_the_ground_nothing_changes() -> None:
    free, above = Crane(sway=Sway(0.3, -0.2)), crane(Sway(0.3, -0.2), ground_m=1.0)
    for tick in range(500):
        for one in (free, above):
            one.step(TICK_S, {SLEW: 0.4, NEAR_FAR: 0.3 if tick < 100 else 0.0})
    assert above.state == free.state


def test_without_ground_and_damping_energy_stays() -> None:
    one = crane(Sway(0.3, 0.4), damped=False)
    before = energy_j(one)
    for _ in range(500):
        one.step(TICK_S, {})
        assert energy_j(one) == pytest.approx(before, abs=1e-2)


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("sway", [Sway(0.5, 0.0), Sway(0.0, 0.5), Sway(-0.3, 0.4)])
def test_the_ground_takes_energy_and_never_gives_any(friction: float, sway: Sway) -> None:
    one = crane(sway, damped=False, ground_m=HANGS_M + 0.1, friction=friction)
    first = last = energy_j(one)
    for _ in range(500):
        one.step(TICK_S, {})
        now = energy_j(one)
        assert now <= last + 1.0  # of some hundred: the spring of a step of 10 ms
        last = now
    assert last < first - 50.0


def test_a_tip_that_comes_down_leaves_the_grapple_on_the_ground() -> None:
    # With friction above the tangent of its angle it would jack up the boom.
    one = crane(Sway(0.0, 0.2), ground_m=HANGS_M - 0.4, friction=0.0)
    deepest = 0.0
    for _ in range(150):
        one.step(TICK_S, {LIFT: -0.4})
        deepest = max(deepest, one.parameters.contact.ground_m - end_m(one))
    # No deeper than its weight presses the spring, twice that when it comes down at once.
    weight_n = 340.0 * 9.81
    assert one.state.height_m < 3.4
    assert deepest < 2.0 * weight_n / SOFT
    assert abs(one.state.theta6_rad) > math.radians(10.0)  # it leans


def test_what_is_dragged_trails_and_without_friction_does_not() -> None:
    def angle(friction: float) -> float:
        one = crane(ground_m=HANGS_M + 0.03, friction=friction)
        for _ in range(200):
            one.step(TICK_S, {NEAR_FAR: 0.5})
        return one.state.theta6_rad

    assert angle(1.0) > angle(0.0) + math.radians(3.0)


@pytest.mark.parametrize("height_m", [0.5, 1.0])
def test_a_pile_stops_the_grapple_while_the_tip_goes_on(height_m: float) -> None:
    pile = {"ground_m": HANGS_M - 0.1, "pile_height_m": height_m, "pile_radius_m": 5.0}
    one = crane(**pile, pile_width_m=0.8)
    free = crane(ground_m=HANGS_M - 0.1)
    for _ in range(110):
        for driven in (one, free):
            driven.step(TICK_S, {NEAR_FAR: 0.8})
    assert one.state.radius_m == free.state.radius_m
    assert one.state.theta6_rad > free.state.theta6_rad + math.radians(5.0)


def test_a_pile_next_to_the_boom_is_met_by_slewing_on_both_sides_alike() -> None:
    turned = []
    for side in (1.0, -1.0):
        one = crane(ground_m=HANGS_M - 0.1, pile_height_m=0.8, pile_radius_m=3.0, pile_width_m=1.0)
        for _ in range(50):
            one.step(TICK_S, {SLEW: side})
        turned.append(one.state.theta5_rad)
    assert turned[0] == pytest.approx(-turned[1], abs=1e-9)
