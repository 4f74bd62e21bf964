"""The carrier under the crane: on a slope the grapple hangs, and swings, as gravity pulls."""

import math

import pytest
from scipy.linalg import eigh

from canshaper.errors import DesignError
from canshaper_sim.crane import Crane, CraneState
from canshaper_sim.grapple import Sway
from canshaper_sim.parameters import changed_parameters
from tests.sim.drives import TICK_S
from tests.sim.test_log import period_s


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


ROCKING = ("carrier.rock_hz=1.2", "carrier.rock_damping=0.02", "carrier.roll_kg_m2=4e4")
LEFT = f"start_theta1_rad={math.pi / 2}"


def test_a_carrier_on_tyres_leans_by_what_hangs_there() -> None:
    """Moment over stiffness; and nothing moves."""
    stiff = 4e4 * (2.0 * math.pi * 1.2) ** 2
    for radius_m in (3.0, 6.0):
        crane = on_slope(*ROCKING, LEFT, f"start_radius_m={radius_m}", "carrier.boom_kg=800")
        lean = 9.81 * radius_m * (340.0 + 400.0) / stiff
        for state in swing(crane, 2.0):
            # The boom points left, which goes down: the grapple hangs outwards.
            assert state.theta6_rad == pytest.approx(-lean, rel=0.01)
            assert state.theta6_rad == pytest.approx(crane.rest_rad[1], abs=1e-6)


def test_a_tip_that_gives_way_makes_the_pendulum_slower() -> None:
    soft = ("carrier.rock_hz=2", "carrier.rock_damping=0", "carrier.roll_kg_m2=1e4")
    free = ("grapple.l1_m=0", "grapple.m1_kg=0", "grapple.c5_n_m_s_rad=0", "grapple.c6_n_m_s_rad=0")
    place = ("start_height_m=6", "carrier.boom_kg=0", "start_radius_m=1.8")

    crane = on_slope(*free, *place, *soft, sway=Sway(theta5_rad=0.03))
    angles = [state.theta5_rad for state in swing(crane, 40.0)]
    # Roll and swing against the vertical, small: mass and stiffness matrix of Lagrange.
    inertia, pull, height_m, length_m = 1e4, 300.0 * 9.81, 6.0, 1.2
    mass = [
        [inertia + 300.0 * height_m**2, 300.0 * height_m * length_m],
        [300.0 * height_m * length_m, 300.0 * length_m**2],
    ]
    stiffness = [[inertia * (4.0 * math.pi) ** 2 - pull * height_m, 0.0], [0.0, pull * length_m]]
    squares = eigh(stiffness, mass, eigvals_only=True)
    assert 2.0 * math.pi / math.sqrt(squares[0]) > 1.02 * 2.0 * math.pi / math.sqrt(9.81 / 1.2)
    assert period_s(angles) == pytest.approx(2.0 * math.pi / math.sqrt(squares[0]), rel=0.003)
