"""The valve: each element of the chain by itself, their order, and exactness of the steps."""

import math
import random
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from canshaper_sim.valve import Valve, ValveParameters

IDEAL = ValveParameters(deadband=0.0, rate_limit_1_s=math.inf)


def speeds(
    parameters: ValveParameters, commands: list[float], hold_s: float, steps: int = 1
) -> list[float]:
    """Speed at the end of every held command, advanced in `steps` equal steps each."""
    valve = Valve(parameters)
    measured = []
    for command in commands:
        valve.set_command(command)
        for _ in range(steps):
            valve.advance(hold_s / steps)
        measured.append(valve.speed)
    return measured


@pytest.mark.parametrize(
    ("command", "flow"),
    [(0.0, 0.0), (0.05, 0.0), (-0.05, 0.0), (0.525, 0.5), (-0.525, -0.5), (1.0, 1.0), (1.7, 1.0)],
)
def test_deadband_then_full_flow_at_full_command(command: float, flow: float) -> None:
    assert ValveParameters(deadband=0.05).flow(command) == pytest.approx(flow, abs=1e-15)


def test_deadband_comes_before_the_flow_limit() -> None:
    # (0.8 - 0.1)/0.9 = 0.778 is limited to 0.6; the other order would give (0.6 - 0.1)/0.9.
    assert ValveParameters(deadband=0.1, flow_limit=0.6).flow(0.8) == 0.6


def test_lag_alone_is_the_exponential() -> None:
    measured = speeds(IDEAL, [0.7] * 50, 0.01)
    for i, speed in enumerate(measured):
        assert speed == pytest.approx(0.7 * (1.0 - math.exp(-0.01 * (i + 1) / 0.1)), abs=1e-14)


def test_rate_limit_then_lag_agrees_with_an_ode_solver() -> None:
    """Ramp of the spool up to its target, and a reversal under way, against DOP853."""
    parameters = ValveParameters(deadband=0.0, rate_limit_1_s=5.0, lag_s=0.08)
    # 1.0 is reached after 0.2 s; at 0.3 s the command reverses: -0.5 is reached 0.3 s later.
    corners = [(0.0, 0.0), (0.2, 1.0), (0.3, 1.0), (0.6, -0.5), (0.8, -0.5)]
    valve = Valve(parameters)
    valve.set_command(1.0)
    valve.advance(0.123)
    valve.advance(0.177)
    at_reversal = valve.speed
    valve.set_command(-0.5)
    valve.advance(0.5)

    speed = 0.0
    expected = []
    for (start_s, spool), (end_s, next_spool) in pairwise(corners):
        slope = (next_spool - spool) / (end_s - start_s)
        solved = solve_ivp(
            lambda t, v, s=start_s, r=spool, k=slope: [(r + k * (t - s) - v[0]) / 0.08],
            (start_s, end_s),
            [speed],
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
        )
        speed = float(solved.y[0, -1])
        expected.append(speed)
    assert at_reversal == pytest.approx(expected[1], abs=1e-10)
    assert valve.speed == pytest.approx(expected[3], abs=1e-10)


def test_rate_limit_comes_after_the_flow_limit() -> None:
    """The spool travels only to the limit: 0.5 at 5/s takes 0.1 s, then the lag settles."""
    parameters = ValveParameters(deadband=0.0, flow_limit=0.5, lag_s=0.01)
    valve = Valve(parameters)
    valve.set_command(1.0)
    _, _, speed, rate = valve.advance(0.1)
    assert speed + 0.01 * rate == pytest.approx(0.5, abs=1e-12)
    valve.set_command(0.0)
    _, _, speed, rate = valve.advance(0.05)
    assert speed + 0.01 * rate == pytest.approx(0.25, abs=1e-12)


@pytest.mark.parametrize("dead_time_s", [0.0, 0.02, 0.033, 0.2])
def test_step_length_does_not_change_the_answer(dead_time_s: float) -> None:
    source = random.Random(1)
    commands = [source.uniform(-1.2, 1.2) for _ in range(200)]
    parameters = ValveParameters(dead_time_s=dead_time_s)
    coarse = speeds(parameters, commands, 0.02)
    fine = speeds(parameters, commands, 0.02, steps=13)
    assert coarse == pytest.approx(fine, abs=1e-12)


def test_dead_time_shifts_the_whole_answer() -> None:
    source = random.Random(2)
    commands = [source.uniform(-1.0, 1.0) for _ in range(100)]
    prompt = speeds(ValveParameters(), commands + [0.0] * 4, 0.02)
    late = speeds(ValveParameters(dead_time_s=0.08), commands + [0.0] * 4, 0.02)
    assert late[:4] == [0.0] * 4
    assert late[4:] == pytest.approx(prompt[:-4], abs=1e-12)


def test_dead_time_need_not_be_a_multiple_of_the_step() -> None:
    late = Valve(replace(IDEAL, dead_time_s=0.033))
    late.set_command(1.0)
    for _ in range(5):
        late.advance(0.02)
    assert late.speed == pytest.approx(1.0 - math.exp(-(0.1 - 0.033) / 0.1), abs=1e-12)


def test_a_tap_shorter_than_the_dead_time_is_not_lost() -> None:
    """The command is back at neutral before its press has reached the spool."""
    tap = [1.0, 1.0] + [0.0] * 40
    prompt = speeds(ValveParameters(), tap, 0.02)
    late = speeds(ValveParameters(dead_time_s=0.1), tap, 0.02)
    assert max(prompt) > 0.05
    assert late[5:] == pytest.approx(prompt[:-5], abs=1e-12)


def test_the_rates_of_a_step_are_the_derivatives_at_its_ends() -> None:
    valve = Valve(ValveParameters())
    source = random.Random(3)
    for _ in range(300):
        valve.set_command(source.uniform(-1.0, 1.0))
        before = valve.speed
        rate, _, after, _ = valve.advance(1e-6)
        assert (after - before) / 1e-6 == pytest.approx(rate, abs=1e-4)
        before, rate = valve.advance(0.015)[2:]
        assert valve.speed == before
        assert (valve.advance(1e-6)[2] - before) / 1e-6 == pytest.approx(rate, abs=1e-4)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=10),
    st.sampled_from([ValveParameters(), replace(IDEAL, dead_time_s=0.013), IDEAL]),
)
def test_the_middle_of_a_step_is_the_end_of_half_of_it(
    commands: list[float], parameters: ValveParameters
) -> None:
    whole, halves = Valve(parameters), Valve(parameters)
    for command in commands:
        whole.set_command(command)
        halves.set_command(command)
        start_rate, middle, end, end_rate = whole.advance(0.02)
        first, last = halves.advance(0.01), halves.advance(0.01)
        assert (start_rate, end_rate) == pytest.approx((first[0], last[3]), abs=1e-9)
        assert (middle, end) == pytest.approx((first[2], last[2]), abs=1e-12)


@given(
    st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=40),
    st.sampled_from([ValveParameters(), IDEAL, ValveParameters(flow_limit=0.4, lag_s=0.05)]),
)
def test_speed_stays_within_the_flow_limit(
    commands: list[float], parameters: ValveParameters
) -> None:
    for speed in speeds(parameters, commands, 0.02):
        assert abs(speed) <= parameters.flow_limit + 1e-12


def test_neutral_brings_the_speed_to_zero() -> None:
    measured = speeds(ValveParameters(), [1.0] * 50 + [0.04] * 200, 0.02)
    assert measured[49] == pytest.approx(1.0, abs=1e-3)
    assert abs(measured[-1]) < 1e-15


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("dead_time_s", 0.3, "0.0 .. 0.2"),
        ("dead_time_s", -0.01, "0.0 .. 0.2"),
        ("deadband", 0.6, "0.0 .. 0.5"),
        ("deadband", math.nan, "0.0 .. 0.5"),
        ("flow_limit", 0.0, "0.05 .. 1.0"),
        ("flow_limit", 1.1, "0.05 .. 1.0"),
        ("rate_limit_1_s", 0.0, "0.1 .. inf"),
        ("lag_s", 0.0, "0.01 .. 1.0"),
    ],
)
def test_parameters_out_of_range_are_refused(name: str, value: float, expected: str) -> None:
    with pytest.raises(ValueError, match=rf"valve: {name}: expected {expected}, got {value}"):
        replace(ValveParameters(), **{name: value})


@pytest.mark.parametrize("command", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_no_number_is_refused(command: float) -> None:
    with pytest.raises(ValueError, match="valve: command"):
        Valve().set_command(command)


def test_hysteresis_is_a_play_between_command_and_spool() -> None:
    parameters = ValveParameters(deadband=0.0, hysteresis=0.04, rate_limit_1_s=math.inf)
    commands = [0.5, 0.49, 0.47, 0.45, 0.46, 0.48, 0.5, 0.0]
    measured = speeds(parameters, commands, 3.0)
    assert measured == pytest.approx([0.48, 0.48, 0.48, 0.47, 0.47, 0.47, 0.48, 0.02], abs=1e-9)
    assert speeds(replace(parameters, hysteresis=0.0), commands, 3.0) == pytest.approx(commands)
