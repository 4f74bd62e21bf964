"""End stops of the tip: they hold it, let it go, and kick the grapple with the lost speed."""

import pytest

from canshaper_sim import crane as crane_module
from canshaper_sim.crane import Crane, CraneParameters, CraneState
from canshaper_sim.grapple import Grapple
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
