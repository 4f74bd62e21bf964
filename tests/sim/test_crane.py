"""The crane in motion: accuracy, symmetry, held commands, refusals, speed."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from canshaper_sim.crane import AXES, Crane, CraneParameters
from canshaper_sim.grapple import Sway, TipMotion, accelerations
from canshaper_sim.valve import ValveParameters
from tests.sim.drives import TICK_S, all_valves, drive, mixed_commands


@pytest.mark.parametrize("rate_1_s", [math.inf, 5.0])
def test_agrees_with_a_general_ode_solver(rate_1_s: float) -> None:
    """DOP853 over tip and sway together, broken at every corner of the spools' travel."""
    lag_s = 0.1
    valve = ValveParameters(deadband=0.0, rate_limit_1_s=rate_1_s, lag_s=lag_s)
    start = Sway(0.1, -0.2, 0.3, 0.1)
    crane = Crane(all_valves(valve), start)
    p = crane.parameters
    full = (p.slew_full_speed_rad_s, p.near_far_full_speed_m_s, p.lift_full_speed_m_s)

    def slope_of(spool: float, target: float) -> float:
        return 0.0 if abs(target - spool) < 1e-12 else math.copysign(rate_1_s, target - spool)

    def rhs_with(
        since_s: float, spools: list[float], slopes: list[float]
    ) -> Callable[[float, Any], list[float]]:
        def rhs(t: float, y: Any) -> list[float]:
            flow = [r + k * (t - since_s) for r, k in zip(spools, slopes, strict=True)]
            rates = [(f - v) / lag_s for f, v in zip(flow, y[:3], strict=True)]
            speed = [full[i] * y[i] for i in range(3)]
            acceleration = [full[i] * rates[i] for i in range(3)]
            tip = TipMotion(
                y[4], speed[1], acceleration[1], speed[0], acceleration[0], acceleration[2]
            )
            return [*rates, *speed, y[8], y[9], *accelerations(p.grapple, tuple(y[6:10]), tip)]

        return rhs

    pose = [p.start_theta1_rad, p.start_radius_m, p.start_height_m]
    y: list[float] = [0.0, 0.0, 0.0, *pose, *start]
    spools = [0.0, 0.0, 0.0]
    now_s = 0.0
    worst = 0.0
    for k, commands in enumerate(mixed_commands(400)):
        crane.step(TICK_S, commands)
        targets = [commands[a] for a in AXES]
        if rate_1_s == math.inf:
            spools = list(targets)
        end_s = (k + 1) * TICK_S
        while end_s - now_s > 1e-12:
            slopes = [slope_of(r, t) for r, t in zip(spools, targets, strict=True)]
            arrivals = [
                (t - r) / s for r, t, s in zip(spools, targets, slopes, strict=True) if s != 0.0
            ]
            part_s = min([end_s - now_s, *arrivals])
            solved = solve_ivp(
                rhs_with(now_s, list(spools), slopes),
                (now_s, now_s + part_s),
                y,
                method="DOP853",
                rtol=1e-11,
                atol=1e-12,
            )
            y = [float(v) for v in solved.y[:, -1]]
            spools = [r + s * part_s for r, s in zip(spools, slopes, strict=True)]
            now_s += part_s
        s = crane.state
        worst = max(worst, *(abs(a - b) for a, b in zip(s[7:11], y[6:10], strict=True)))
        assert s[1:4] == pytest.approx(y[3:6], abs=1e-6)
    assert worst < 3e-6  # rad and rad/s, at the internal step of 10 ms


def test_directions_of_the_axes() -> None:
    crane = Crane()
    for _ in range(40):
        crane.step(TICK_S, {"slew": 0.3, "near_far": 0.3, "lift": 0.3})
    s = crane.state
    assert s.theta1_rad > 0.0
    assert s.radius_m > 3.0
    assert s.height_m > 4.0
    # The grapple stays behind the tip at first: against the slew, and inwards.
    crane = Crane()
    for _ in range(15):
        crane.step(TICK_S, {"slew": 0.3, "near_far": 0.3})
    assert crane.state.theta5_rad < 0.0 < crane.state.theta6_rad


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
        min_size=1,
        max_size=30,
    )
)
def test_mirrored_slew_gives_mirrored_swing(commands: list[tuple[float, float, float]]) -> None:
    """The machine has no preferred side: theta1 and theta5 change sign, all else stays."""
    left, right = Crane(), Crane()
    for slew, near_far, lift in commands:
        for _ in range(5):
            left.step(TICK_S, {"slew": slew, "near_far": near_far, "lift": lift})
            right.step(TICK_S, {"slew": -slew, "near_far": near_far, "lift": lift})
    mirrored = tuple(-v if i in (1, 4, 7, 9) else v for i, v in enumerate(left.state))
    assert mirrored == pytest.approx(tuple(right.state), abs=1e-12)


def test_swing_does_not_depend_on_the_heading() -> None:
    north = Crane()
    east = Crane(CraneParameters(start_theta1_rad=1.3))
    for commands in mixed_commands(200):
        north.step(TICK_S, commands)
        east.step(TICK_S, commands)
    assert north.state[7:] == east.state[7:]
    assert east.state.theta1_rad - north.state.theta1_rad == pytest.approx(1.3, abs=1e-12)


def test_an_axis_without_a_frame_keeps_its_command() -> None:
    reported, silent = Crane(), Crane()
    for k, commands in enumerate(mixed_commands(100)):
        reported.step(TICK_S, mixed_commands(100)[k - k % 40])
        silent.step(TICK_S, commands if k % 40 == 0 else {})
    assert reported.state == silent.state


def test_initial_sway_swings_on_its_own() -> None:
    crane = Crane(sway=Sway(0.1, -0.2, 0.0, 0.3))
    assert crane.state[7:] == (0.1, -0.2, 0.0, 0.3)
    for _ in range(500):
        crane.step(TICK_S, {})
    s = crane.state
    assert s[1:7] == (0.0, 3.0, 4.0, 0.0, 0.0, 0.0)
    assert 0.0 < abs(s.theta5_rad) < 0.1
    assert s.time_s == pytest.approx(10.0, abs=1e-9)


def test_a_grapple_swung_over_is_reported() -> None:
    crane = Crane(sway=Sway(theta6_rate_rad_s=3.0))
    drive(crane, "slew", [0.0] * 100)
    assert not crane.swung_over
    crane = Crane(sway=Sway(theta5_rate_rad_s=6.0))
    drive(crane, "slew", [0.0] * 100)
    assert crane.swung_over


def test_odd_step_lengths_give_the_same_motion() -> None:
    """25 ms and 7 ms steps are divided into equal internal steps; nothing is lost."""
    fine, coarse = Crane(), Crane()
    for _ in range(100):
        for _ in range(25):
            fine.step(0.007, {"slew": 0.6, "near_far": -0.1})
        for _ in range(7):
            coarse.step(0.025, {"slew": 0.6, "near_far": -0.1})
    assert coarse.state == pytest.approx(tuple(fine.state), abs=1e-6)


@pytest.mark.parametrize(
    ("dt_s", "commands", "message"),
    [
        (0.0, {}, "dt_s: expected a positive value, got 0.0"),
        (math.nan, {}, "dt_s: expected a positive value, got nan"),
        (0.02, {"boom": 0.1}, "axis: expected one of slew, near_far, lift, got 'boom'"),
        (0.02, {"slew": math.nan}, "command: expected a finite value, got nan"),
    ],
)
def test_impossible_steps_are_refused(
    dt_s: float, commands: dict[str, float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Crane().step(dt_s, commands)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"slew_full_speed_rad_s": 0.0}, r"slew_full_speed_rad_s: expected 0.01 .. 3.0, got 0.0"),
        ({"start_radius_m": 9.0}, r"start_radius_m: expected 1.8 .. 8.0, got 9.0"),
        ({"radius_max_m": 1.0}, r"start_radius_m: expected 1.8 .. 1.0, got 3.0"),
        ({"start_height_m": math.nan}, r"start_height_m: expected 1.5 .. 7.0, got nan"),
    ],
)
def test_impossible_cranes_are_refused(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(CraneParameters(), **changes)
