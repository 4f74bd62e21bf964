"""End stops: how far an axis may still move, and what its filter still asks for."""

import random

import pytest

from canshaper.shaping.demand_bounds import EndStops, RunOn, bounds
from canshaper.shaping.moving_axis import MovingAxis
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off

TICK_S = 0.02
MODE = SwayMode.from_period(2.3, 0.05)
STOPS = EndStops(2.0, 8.0, full_speed=1.5, lag_s=0.2)


@pytest.mark.parametrize(
    ("position", "velocity", "run_on", "expected"),
    [
        (5.0, 0.0, (0.0, 0.0), (-2.0, 2.0)),
        (5.0, 0.5, (0.0, 0.0), (-2.0, 1.9)),  # the valve is late
        (5.0, -0.5, (0.0, 0.0), (-1.9, 2.0)),
        (5.0, 0.0, (-0.5, 0.3), (-1.5, 1.7)),
        (5.0, -0.5, (0.0, 0.3), (-1.9, 1.7)),
        (5.0, 0.0, (0.5, -0.3), (-2.0, 2.0)),  # what goes away from a stop gives no room
        (8.3, 0.0, (0.0, 0.0), (-4.2, 0.0)),  # beyond a stop only the way back is open
        (1.7, 0.0, (0.0, 0.0), (0.0, 4.2)),
    ],
)
def test_the_room_is_the_way_to_both_stops_in_seconds_of_full_speed(
    position: float,
    velocity: float,
    run_on: tuple[float, float],
    expected: tuple[float, float],
) -> None:
    assert STOPS.room(position, velocity, run_on) == pytest.approx(expected)


def test_of_a_position_that_falls_with_the_command_the_other_stop_is_ahead() -> None:
    falling = EndStops(2.0, 8.0, full_speed=-1.5, lag_s=0.2)
    assert falling.room(3.5, 0.0, (0.0, 0.0)) == (-3.0, 1.0)


def test_demands_are_bounded_by_the_room_and_never_faster_than_full_speed() -> None:
    assert bounds((-2.0, 2.0), 0.0) == (-1.0, 1.0)
    assert bounds((-0.3, 0.06), 0.0) == pytest.approx((-0.5, 0.1))
    assert bounds((0.0, 0.0), 0.0) == (0.0, 0.0)


def test_what_a_motion_takes_back_takes_room() -> None:
    assert bounds((-0.3, 0.3), 0.12) == pytest.approx((-0.3, 0.5))
    assert bounds((-0.3, 0.3), -0.12) == pytest.approx((-0.5, 0.3))
    assert bounds((-0.3, 0.3), 1.0) == pytest.approx((0.0, 0.5))


@pytest.mark.parametrize("kind", ["off", "zv", "first_order", "gff", "robust"])
def test_the_run_on_is_what_the_filter_does_without_a_demand(kind: str) -> None:
    """An exact sum for a random stroke; the sway model swings with what the filter asks for."""
    parameters = {
        "first_order": {"time_constant_s": 0.3},
        "gff": {"a1": 1.0, "a2": 0.2},
        "robust": {"taps": [0.2, 0.3, 0.1, 0.0, 0.4], "tick_ms": 20},
    }.get(kind, {})

    def made() -> tuple[object, SwayModel]:
        sway = SwayModel(MODE, TICK_S)
        return build_shaper(kind, TICK_S, sway, valve_rate_per_s=5.0, **parameters), sway

    shaper, sway = made()
    run_on = RunOn(*made(), TICK_S, 8.0)  # type: ignore[arg-type]
    hand = random.Random(7)

    def step(demand: float) -> float:
        output: float = shaper.step(demand)  # type: ignore[attr-defined]
        sway.step(output)
        return output

    for _ in range(120):
        demand = hand.uniform(-1.0, 1.0)
        step(demand)
        run_on.add(demand, 1)
    comes = TICK_S * sum(step(0.0) for _ in range(600))
    assert sum(run_on.travel()) == pytest.approx(comes, abs=2e-3)


def test_both_directions_are_counted_apart() -> None:
    run_on = RunOn(Fir([0.0, 1.0]), None, TICK_S, 2.0)
    for demand in (0.5, -0.25):
        run_on.add(demand, 1)
    assert run_on.travel() == pytest.approx((-0.005, 0.0))
    run_on = RunOn(Fir([0.0, 0.0, 1.0]), None, TICK_S, 2.0)
    for demand in (0.5, -0.25):
        run_on.add(demand, 1)
    assert run_on.travel() == pytest.approx((-0.005, 0.01))


def test_a_demand_that_was_held_counts_for_every_tick() -> None:
    once, twice = (RunOn(Fir([0.25] * 4), None, TICK_S, 2.0) for _ in range(2))
    once.add(0.8, 3)
    for _ in range(3):
        twice.add(0.8, 1)
    assert once.travel() == twice.travel()
    once.add(0.0, 10_000)
    assert once.travel() == (0.0, 0.0)


def test_without_a_filter_nothing_runs_on() -> None:
    run_on = RunOn(Off(), None, TICK_S, 2.0)
    run_on.add(1.0, 1)
    assert run_on.travel() == (0, 0)


@pytest.mark.parametrize(("target", "expected"), [(0.5, 0.05), (-0.5, -0.1)])
def test_a_motion_plans_no_position_beyond_an_end(target: float, expected: float) -> None:
    axis = MovingAxis(1.0, TICK_S, SwayModel(MODE, TICK_S), room_m=(-0.002, 0.001))
    axis.add(target, 1.0)
    assert axis.added == pytest.approx(expected)
