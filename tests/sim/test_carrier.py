"""The carrier under the crane: on a slope the grapple hangs, and swings, as gravity pulls."""

import math

import pytest

from canshaper.errors import DesignError
from canshaper_sim.crane import Crane, CraneParameters, CraneState
from canshaper_sim.grapple import Grapple, Sway
from canshaper_sim.parameters import changed_parameters
from tests.sim.drives import TICK_S

FREE = Grapple(c5_n_m_s_rad=0.0, c6_n_m_s_rad=0.0)


def on_slope(*changes: str, sway: Sway | None = None) -> Crane:
    return Crane(changed_parameters([*changes]), sway)


def swing(crane: Crane, seconds: float) -> list[CraneState]:
    states = []
    for _ in range(round(seconds / TICK_S)):
        crane.step(TICK_S, {})
        states.append(crane.state)
    return states


@pytest.mark.parametrize(
    ("slew_deg", "theta5_deg", "theta6_deg"),
    [(0.0, 0.0, -10.0), (90.0, -10.0, 0.0), (180.0, 0.0, 10.0), (-90.0, 10.0, 0.0)],
)
def test_down_ahead_the_grapple_hangs_ahead(
    slew_deg: float, theta5_deg: float, theta6_deg: float
) -> None:
    start = f"start_theta1_rad={math.radians(slew_deg)}"
    for state in swing(on_slope("carrier.pitch_deg=10", start), 3.0):
        assert math.degrees(state.theta5_rad) == pytest.approx(theta5_deg, abs=1e-9)
        assert math.degrees(state.theta6_rad) == pytest.approx(theta6_deg, abs=1e-9)


def test_down_to_the_right_it_hangs_to_the_right() -> None:
    state = on_slope("carrier.roll_deg=5").state
    assert math.degrees(state.theta5_rad) == pytest.approx(-5.0)
    assert state.theta6_rad == 0.0


@pytest.mark.parametrize("slew_rad", [0.0, 0.7, 2.0, 4.4])
def test_whichever_way_the_boom_points_it_hangs_upright(slew_rad: float) -> None:
    slope = ("carrier.pitch_deg=9", "carrier.roll_deg=-12", f"start_theta1_rad={slew_rad}")
    states = swing(on_slope(*slope), 2.0)
    steep = math.cos(math.radians(9.0)) * math.cos(math.radians(12.0))
    for state in states:
        tilt = math.cos(state.theta5_rad) * math.cos(state.theta6_rad)
        assert tilt == pytest.approx(steep, abs=1e-12)


def test_along_the_slope_it_swings_as_on_level_ground() -> None:
    sway = Sway(theta6_rad=0.2, theta6_rate_rad_s=-0.3)
    slope = math.radians(15.0)
    states = zip(
        swing(on_slope("carrier.pitch_deg=15", sway=sway), 10.0),
        swing(on_slope(sway=sway), 10.0),
        strict=True,
    )
    for tilted, level in states:
        assert tilted.theta6_rad + slope == pytest.approx(level.theta6_rad, abs=1e-6)
        assert tilted.theta5_rad == 0.0


def test_its_energy_stays_what_it_was() -> None:
    """Of two point masses on a tip that stands, by their places and the pull of the slope."""
    pitch, roll = math.radians(12.0), math.radians(-8.0)
    down = (math.sin(pitch), -math.cos(pitch) * math.sin(roll), -math.cos(pitch) * math.cos(roll))
    slope = [f"carrier.pitch_deg={math.degrees(pitch)}", f"carrier.roll_deg={math.degrees(roll)}"]
    parameters = changed_parameters([*slope, "grapple.c5_n_m_s_rad=0", "grapple.c6_n_m_s_rad=0"])
    crane = Crane(parameters, Sway(0.3, -0.4, 0.5, 0.2))

    def energy(state: CraneState) -> float:
        (theta5, theta6), (rate5, rate6) = state[7:9], state[9:11]
        s5, c5, s6, c6 = math.sin(theta5), math.cos(theta5), math.sin(theta6), math.cos(theta6)
        l1, l3 = FREE.l1_m, FREE.l1_m + FREE.l2_m * c6
        place = (-FREE.l2_m * s6, l3 * s5, -l3 * c5)
        below = l1 * (s5 * down[1] - c5 * down[2])
        speed2 = (FREE.l2_m * rate6) ** 2 + (l3 * rate5) ** 2
        potential = -9.81 * sum(a * b for a, b in zip(place, down, strict=True))
        link = 0.5 * (l1 * rate5) ** 2 - 9.81 * below
        return FREE.m2_kg * (0.5 * speed2 + potential) + FREE.m1_kg * link

    first = energy(crane.state)
    for state in swing(crane, 20.0):
        assert energy(state) == pytest.approx(first, abs=1e-2)  # of 300 J of swing


def test_slewing_turns_the_rest_angles_and_swings_it_as_on_level_ground() -> None:
    """It hangs upright all the time; only its joints turn."""

    def slewed(*changes: str) -> tuple[float, float, list[float]]:
        crane, swings = on_slope(*changes), []
        for command in [1.0] * 150 + [0.0] * 250:
            crane.step(TICK_S, {"slew": command})
            rest5, rest6 = crane.rest_rad
            swings.append(crane.state.theta5_rad - rest5)
        return rest5, rest6, swings

    rest5, rest6, swings = slewed("carrier.pitch_deg=12")
    assert rest5 < -0.15  # nearly across the boom, after 86 degrees
    assert abs(rest6) < 0.02
    assert swings == pytest.approx(slewed()[2], abs=0.04)


def test_a_long_log_hangs_still_on_a_slope() -> None:
    log = ("log.grip_s=1", "log.second_period_s=0.6")
    states = swing(on_slope("carrier.pitch_deg=10", *log), 4.0)
    for state in states:
        assert math.degrees(state.theta6_rad) == pytest.approx(-10.0, abs=0.06)


@pytest.mark.parametrize("name", ["pitch_deg", "roll_deg"])
def test_a_slope_that_no_forwarder_works_on_is_refused(name: str) -> None:
    with pytest.raises(DesignError, match=rf"carrier: {name}: expected -15.0 .. 15.0, got 16"):
        changed_parameters([f"carrier.{name}=16"])


def test_level_ground_changes_nothing() -> None:
    assert CraneParameters().carrier.level
    assert on_slope().state == Crane().state
