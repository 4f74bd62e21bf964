"""End stops of the tip: they hold it, let it go, and kick the grapple with the lost speed."""

from itertools import pairwise

import pytest

from canshaper.errors import DesignError
from canshaper_sim import crane as crane_module
from canshaper_sim.actuator import EndParameters
from canshaper_sim.crane import Crane, CraneParameters, CraneState, joint_crane
from canshaper_sim.grapple import Grapple
from canshaper_sim.joints import JointParameters
from tests.sim.drives import LINEAR, TICK_S, all_valves, drive


@pytest.mark.slow
def test_internal_step_has_converged_at_end_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the tip meets its stop within a step, 10 ms and 0.2 ms still agree."""

    def run(start_radius_m: float) -> list[CraneState]:
        crane = Crane(CraneParameters(start_radius_m=start_radius_m))
        commands = [1.0] * 150 + [-1.0] * 50 + [0.0] * 100
        return drive(crane, "near_far", commands, parts=1)

    for start_radius_m in (6.0, 6.003, 6.0071, 6.012):
        coarse = run(start_radius_m)
        with monkeypatch.context() as patch:
            patch.setattr(crane_module, "INTERNAL_STEP_S", 2e-4)
            fine = run(start_radius_m)
        worst = max(abs(a.theta6_rad - b.theta6_rad) for a, b in zip(coarse, fine, strict=True))
        assert worst < 1e-3  # 0.06 deg of the 19 deg that the stop causes


@pytest.mark.parametrize(
    ("axis", "command", "index", "limit"),
    [
        ("near_far", 1.0, 2, 8.0),
        ("near_far", -1.0, 2, 1.8),
        ("lift", 1.0, 3, 7.0),
        ("lift", -1.0, 3, 1.5),
    ],
)
def test_end_stops_hold_the_tip_and_let_it_go(
    axis: str, command: float, index: int, limit: float
) -> None:
    crane = Crane()
    commands = [command] * 400 + [0.0] * 25
    states = drive(crane, axis, commands, parts=1)
    assert states[-1][index] == limit
    assert all(abs(s[index] - 4.0) <= 4.0 for s in states)
    assert crane.state[index + 3] == 0.0
    crane.step(TICK_S, {axis: command})
    crane.step(TICK_S, {axis: command})
    assert crane.axes_at_stop == (axis,)
    # The tip leaves the stop at once and reaches its full speed.
    for _ in range(60):
        crane.step(TICK_S, {axis: -command})
    assert crane.axes_at_stop == ()
    assert (crane.state[index] - limit) * command < -0.3
    full_speed = 1.0 if axis == "near_far" else 0.8
    assert crane.state[index + 3] == pytest.approx(-command * full_speed, rel=0.01)


def test_end_stop_gives_the_grapple_the_impulse_of_the_lost_speed() -> None:
    """A tip stopped from full speed v kicks a hanging grapple to theta6' = -v/l2."""
    # 26 s of travel let the swing of the start die away; damping takes 0.4 % of the kick.
    crane = Crane(all_valves(LINEAR, grapple=Grapple(c6_n_m_s_rad=300.0), radius_max_m=29.0037))
    states = drive(crane, "near_far", [1.0] * 1400, parts=2)
    hit = next(i for i, s in enumerate(states) if s.radius_m == 29.0037)
    before, after = states[hit - 1], states[hit]
    assert (before.theta6_rad, before.theta6_rate_rad_s) == pytest.approx((0.0, 0.0), abs=1e-4)
    assert before.radius_rate_m_s == pytest.approx(1.0, abs=1e-9)
    assert after.radius_rate_m_s == 0.0
    assert after.theta6_rate_rad_s == pytest.approx(-1.0 / 1.2, rel=5e-3)
    # The angle gone through is the way the tip lost, not what the stages happen to see.
    lost_m = 0.01 - (29.0037 - before.radius_m)
    assert after.theta6_rad == pytest.approx(-lost_m / 1.2, rel=2e-2)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slew_has_end_stops_too(sign: float) -> None:
    crane = Crane(CraneParameters(slew_min_rad=-0.9, slew_max_rad=0.9))
    states = drive(crane, "slew", [sign] * 200, parts=1)
    assert (states[-1].theta1_rad, states[-1].theta1_rate_rad_s) == (0.9 * sign, 0.0)
    assert max(abs(s.theta5_rad) for s in states[150:]) > 0.1
    assert drive(crane, "slew", [-sign] * 50, parts=1)[-1].theta1_rad * sign < 0.8


def test_a_start_beyond_the_stop_of_slew_is_refused() -> None:
    with pytest.raises(DesignError, match=r"start_theta1_rad: expected -1000.0 .. 0.9, got 1.0"):
        CraneParameters(slew_max_rad=0.9, start_theta1_rad=1.0)


ENDS = EndParameters(cushion_s=0.4, creep=0.05)


def cushioned(axis: str, sign: float, ends: EndParameters = ENDS) -> list[CraneState]:
    stops = {"slew_min_rad": -1.5, "slew_max_rad": 1.5, "start_radius_m": 5.0}
    return drive(Crane(all_valves(LINEAR, ends=ends, **stops)), axis, [sign] * 300, parts=2)


@pytest.mark.parametrize(
    ("axis", "index", "full", "limit"),
    [("near_far", 2, 1.0, (1.8, 8.0)), ("lift", 3, 0.8, (1.5, 7.0)), ("slew", 1, 0.5, (-1.5, 1.5))],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_cushion_brakes_evenly_on_its_way(
    axis: str, index: int, full: float, limit: tuple[float, float], sign: float
) -> None:
    """By energy: v^2 = 2 a d, and the whole of it takes twice as long as at full speed."""
    states = cushioned(axis, sign)
    end, length, ways = limit[sign > 0.0], 0.4 * full, 0
    assert states[-1][index] == end
    for state in states:
        way, speed = abs(end - state[index]), abs(state[index + 3])
        if 0.01 * length < way < 0.95 * length:
            assert speed == pytest.approx(full * (way / length) ** 0.5, rel=0.02)
            ways += 1
    assert ways == pytest.approx(0.8 * ((0.95**0.5) - 0.1) / 0.01, abs=2)


def test_a_cushion_lets_the_axis_creep_into_its_stop() -> None:
    states = cushioned("near_far", 1.0, EndParameters(cushion_s=0.4, creep=0.3))
    near = [s.radius_rate_m_s for s in states if 8.0 - 0.3**2 * 0.4 < s.radius_m < 8.0]
    assert near[2:] == pytest.approx([0.3] * len(near[2:]), abs=1e-6)
    assert states[-1].radius_m == 8.0


def test_a_cushion_takes_the_kick_from_the_stop() -> None:
    hard, soft = (
        max(abs(s.theta6_rad) for s in cushioned("near_far", 1.0, EndParameters(way_s))[350:])
        for way_s in (0.0, 0.8)
    )
    assert soft < 0.75 * hard


def test_out_of_a_cushion_it_moves_freely() -> None:
    parameters = all_valves(LINEAR, start_radius_m=7.99, ends=ENDS)
    free, held = Crane(all_valves(LINEAR, start_radius_m=7.99)), Crane(parameters)
    assert drive(held, "near_far", [-1.0] * 50) == drive(free, "near_far", [-1.0] * 50)


def test_joints_have_cushions() -> None:
    p = CraneParameters(joints=JointParameters(knuckle_max_deg=-20.0), ends=ENDS)
    crane, speeds = joint_crane(p), []
    for _ in range(400):
        crane.step(TICK_S, {"knuckle": 1.0})
        speeds.append(crane.speed("knuckle"))
    assert max(speeds) == pytest.approx(0.7, rel=1e-3)
    assert speeds[-1] == 0.0
    braking = [b - a for a, b in pairwise(speeds) if b < a - 1e-3 and b > 0.05]
    assert len(braking) > 30  # 0.8 s
    assert braking[1:] == pytest.approx([-0.7 / 0.8 * TICK_S] * (len(braking) - 1), rel=0.02)
