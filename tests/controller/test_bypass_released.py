"""Anti-sway is switched on in motion: what ran without the filter is not run again by it."""

import random

import pytest

from canshaper.controller.axis_control import AxisControl
from canshaper.controller.controller import Controller
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.states import CommandInput, State
from tests.faults.shipped import CONFIG, NAMES
from tests.rigs.files import read

EDGE = 1e-9


def controls(name: str) -> list[AxisControl]:
    return list(Controller(read(CONFIG / f"{name}.yaml")).axes.values())


def unshaped(control: AxisControl, rng: random.Random) -> tuple[OutputLimits, float]:
    """Drive without anti-sway, up to 0.6 s of anything; limits and largest step of rounding."""
    axis, limits = control.axis, control.bound.config.limits.output_limits()
    for _ in range(3):
        axis.tick(CommandInput())
    command, ticks = rng.choice((-1.0, 1.0)), rng.randint(3, round(0.6 / control.period_s))
    for _ in range(ticks):
        axis.tick(CommandInput(command, bypass=True))
        if rng.random() < 0.05:
            command = rng.uniform(-1.0, 1.0)
    return limits, 1.5 / control.bound.valve.steps / (1.0 - limits.deadband)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(3))
def test_for_a_tail_the_output_is_no_faster_than_the_joystick(name: str, seed: int) -> None:
    for control in controls(name):
        rng = random.Random(f"{name} {control.bound.name} {seed} tail")
        limits, rounding = unshaped(control, rng)
        axis, fall = control.axis, limits.fall_per_s * control.period_s
        demand = rng.choice((0.0, rng.uniform(-1.0, 1.0)))
        for tick in range(round(limits.tail_s / control.period_s)):
            if tick and rng.random() < 0.1:
                demand = rng.choice((0.0, rng.uniform(-1.0, 1.0)))
            before = axis.output.setpoint
            axis.tick(CommandInput(demand))
            low, high = min(0.0, demand, before + fall), max(0.0, demand, before - fall)
            assert low - rounding - EDGE <= axis.output.setpoint <= high + rounding + EDGE


@pytest.mark.parametrize("name", NAMES)
def test_what_did_not_run_on_does_not_run_later(name: str) -> None:
    """Neither when the tail is over, nor with a touch of the joystick from rest."""
    for control in controls(name):
        limits, rounding = unshaped(control, random.Random(f"{name} {control.bound.name} later"))
        axis, tail = control.axis, round(limits.tail_s / control.period_s)
        for command, ticks in ((0.7, tail // 2), (0.0, 40)):
            for _ in range(ticks):
                axis.tick(CommandInput(command))
        for _ in range(2 * tail):  # the end of the tail is in these
            axis.tick(CommandInput())
            assert axis.output.steps == 0
        unshaped(control, random.Random(f"{name} {control.bound.name} touch"))
        for _ in range(round(1.0 / limits.fall_per_s / control.period_s) + 2):
            axis.tick(CommandInput())
        assert axis.output.steps == 0
        fall = limits.fall_per_s * control.period_s
        axis.tick(CommandInput(0.5))
        before = axis.output.setpoint
        for _ in range(tail // 2):
            axis.tick(CommandInput())
            assert abs(axis.output.setpoint) <= max(0.0, abs(before) - fall) + rounding + EDGE
            before = axis.output.setpoint


@pytest.mark.parametrize("missed", [0, 3])
def test_after_the_tail_the_filter_runs_on_again(missed: int) -> None:
    control = controls("forwarder-robust")[0]
    axis, limits = control.axis, control.bound.config.limits.output_limits()
    unshaped(control, random.Random(1))
    tail = round(limits.tail_s / control.period_s)
    for _ in range(tail - missed):
        axis.tick(CommandInput(0.8))
    axis.hold(missed)
    before = axis.output.setpoint
    for _ in range(10):
        axis.tick(CommandInput())
    assert axis.state is State.ACTIVE
    assert axis.output.setpoint > before - 0.5 * 10 * limits.fall_per_s * control.period_s > 0.0
