"""The equations of the hanging grapple against independent numbers and against physics."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from canshaper_sim.grapple import Grapple, Sway, TipMotion, accelerations, advance

REST = TipMotion(3.0, 0.0, 0.0, 0.0, 0.0, 0.0)
RESTING = (REST, REST, REST)


def tip_of(sample: dict[str, float]) -> TipMotion:
    return TipMotion(
        sample["x"],
        sample["xd"],
        sample["xdd"],
        sample["theta1d"],
        sample["theta1dd"],
        sample["zdd"],
    )


def test_defaults_are_the_reference_grapple(reference: dict[str, Any]) -> None:
    p = reference["parameters"]
    assert Grapple() == Grapple(p["l1"], p["l2"], p["m1"], p["m2"], p["c5"], p["c6"], p["g"])


def test_accelerations_agree_with_all_samples(reference: dict[str, Any]) -> None:
    assert len(reference["eom_samples"]) == 20
    for sample in reference["eom_samples"]:
        got = accelerations(
            Grapple(),
            (sample["theta5"], sample["theta6"], sample["theta5d"], sample["theta6d"]),
            tip_of(sample),
        )
        # The samples are printed to ten digits.
        assert got == pytest.approx((sample["theta5dd"], sample["theta6dd"]), abs=1e-8)


def test_linear_modes(reference: dict[str, Any]) -> None:
    mode5, mode6 = Grapple().mode5, Grapple().mode6
    linear = reference["linear"]
    assert (mode5.omega_rad_s, mode5.zeta) == pytest.approx(
        (linear["mode5"]["w"], linear["mode5"]["zeta"]), rel=1e-9
    )
    assert (mode6.omega_rad_s, mode6.zeta) == pytest.approx(
        (linear["mode6"]["w"], linear["mode6"]["zeta"]), rel=1e-9
    )
    radius = reference["parameters"]["x0"]
    assert radius * mode5.gain_1_m == pytest.approx(linear["G11"]["num_s2"], rel=1e-9)
    assert mode6.gain_1_m == pytest.approx(linear["G22"]["num_s2"], rel=1e-9)


@pytest.mark.parametrize("joint", [5, 6])
def test_small_sway_swings_with_its_linear_mode(joint: int) -> None:
    """Period and decay of the simulated swing are those of mode5 and mode6."""
    grapple = Grapple(l1_m=0.3, l2_m=1.5, m1_kg=60.0, m2_kg=500.0)
    mode = grapple.mode5 if joint == 5 else grapple.mode6
    small = 1e-4
    sway = Sway(theta5_rad=small) if joint == 5 else Sway(theta6_rad=small)
    step_s = 0.005
    rates: list[float] = []
    angles: list[float] = []
    for _ in range(4000):
        sway = advance(grapple, sway, step_s, RESTING)
        angles.append(sway[joint - 5])
        rates.append(sway[joint - 3])
    # The instants at which the swing turns, by interpolation of the rate between two steps.
    turns = [
        (i + before / (before - after), angles[i])
        for i, (before, after) in enumerate(pairwise(rates))
        if before * after < 0.0
    ]
    half_swings = len(turns) - 1
    half_period_s = (turns[-1][0] - turns[0][0]) * step_s / half_swings
    decay = math.log(abs(turns[0][1] / turns[-1][1])) / half_swings
    damped = mode.omega_rad_s * math.sqrt(1.0 - mode.zeta**2)
    assert math.pi / half_period_s == pytest.approx(damped, rel=1e-6)
    assert decay == pytest.approx(mode.zeta * mode.omega_rad_s * half_period_s, rel=1e-4)


def energy(grapple: Grapple, sway: Sway) -> float:
    """Kinetic and potential energy (J) below a resting tip, from the positions of the masses."""
    t5, t6, w5, w6 = sway
    l1, l2 = grapple.l1_m, grapple.l2_m
    l3 = l1 + l2 * math.cos(t6)
    l3_rate = -l2 * math.sin(t6) * w6
    radial_rate = -l2 * math.cos(t6) * w6
    tangential_rate = l3_rate * math.sin(t5) + l3 * math.cos(t5) * w5
    height_rate = -l3_rate * math.cos(t5) + l3 * math.sin(t5) * w5
    kinetic = 0.5 * grapple.m2_kg * (radial_rate**2 + tangential_rate**2 + height_rate**2)
    kinetic += 0.5 * grapple.m1_kg * (l1 * w5) ** 2
    height_sum = grapple.m1_kg * l1 * math.cos(t5) + grapple.m2_kg * l3 * math.cos(t5)
    return kinetic - grapple.g_m_s2 * height_sum


def test_energy_is_conserved_without_damping() -> None:
    grapple = replace(Grapple(), c5_n_m_s_rad=0.0, c6_n_m_s_rad=0.0)
    sway = Sway(math.radians(34.0), math.radians(40.0), 0.2, -0.3)
    swing = energy(grapple, sway) - energy(grapple, Sway())
    for _ in range(30_000):
        sway = advance(grapple, sway, 0.002, RESTING)
        drift = energy(grapple, sway) - energy(grapple, Sway()) - swing
        assert abs(drift) < 1e-7 * swing


def test_damping_takes_energy_out_at_the_joints() -> None:
    grapple = Grapple()
    sway = Sway(0.5, 0.4, 0.0, 0.0)
    before = energy(grapple, sway)
    lost = 0.0
    step_s = 0.001
    for _ in range(5000):
        after = advance(grapple, sway, step_s, RESTING)
        for damping, rates in (
            (grapple.c5_n_m_s_rad, (sway[2], after[2])),
            (grapple.c6_n_m_s_rad, (sway[3], after[3])),
        ):
            lost += damping * 0.5 * (rates[0] ** 2 + rates[1] ** 2) * step_s
        sway = after
    assert before - energy(grapple, sway) == pytest.approx(lost, rel=1e-5)


def test_hangs_outwards_under_the_centrifugal_force() -> None:
    """Steady slewing: the equilibrium of theta6 is the force balance of a point mass."""
    slew_rate = 0.5
    turning = TipMotion(3.0, 0.0, 0.0, slew_rate, 0.0, 0.0)
    low, high = -0.5, 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        falls = accelerations(Grapple(), (0.0, middle, 0.0, 0.0), turning)[1] > 0.0
        low, high = (middle, high) if falls else (low, middle)
    grapple_radius = 3.0 - 1.2 * math.sin(low)
    assert math.tan(-low) == pytest.approx(slew_rate**2 * grapple_radius / 9.81, rel=1e-9)


def test_free_fall_of_the_tip_takes_the_weight_away() -> None:
    falling = REST._replace(height_acceleration_m_s2=-9.81)
    assert accelerations(Grapple(), (0.4, 0.3, 0.0, 0.0), falling) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [("l2_m", 0.0), ("l1_m", -0.1), ("m2_kg", -1.0), ("c5_n_m_s_rad", -1.0), ("g_m_s2", math.nan)],
)
def test_impossible_parameters_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"grapple: {name}: expected .*, got "):
        replace(Grapple(), **{name: value})
