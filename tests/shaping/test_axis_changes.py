"""Setpoints after a change of filter or bypass: they join without a jump."""

import itertools
import math
import random
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput, State
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import BLEND_S, Off

Drive = Any  # the class of conftest.py
DriveWith = Callable[..., Any]
TICK_S = 0.02
NEW_MODE = SwayMode(2.2, 0.02)
FREE = OutputLimits(
    rise_per_s=100.0, fall_per_s=100.0, tail_s=2.0, allow_faster=True, allow_reverse=True
)
FINE = 1_000_000  # grid steps: rounding far below what is looked at


def new_filter(sway: SwayModel) -> Gff:
    return Gff(sway, (-2.0, -2.5))


def lagged(sway: SwayModel) -> Gff:
    return Gff(sway, (-4.0, -5.0), -3.0)


def largest_step(sent: Sequence[float]) -> float:
    return max(abs(b - a) for a, b in itertools.pairwise(sent))


def join(drive: Drive, what: str, after_s: float) -> tuple[float, list[float]]:
    """Bypass on or off or a retune in motion; what was sent last, and what in the 0.1 s after."""
    drive.to_ready().run(CommandInput(0.2, bypass=what == "bypass off"), after_s)
    if what == "bypass off":  # leave a swing behind, so that the filter wants something else
        drive.run(CommandInput(0.1, bypass=True), 0.2)
    elif what == "retune":
        drive.axis.retune(NEW_MODE, new_filter)
    last, before = drive.axis.output.setpoint, len(drive.sent)
    drive.run(CommandInput(0.2, bypass=what == "bypass on"), 0.1)
    return last, drive.sent[before:]


@pytest.mark.parametrize("what", ["bypass on", "bypass off", "retune"])
@pytest.mark.parametrize("after_s", [0.1, 0.2, 0.5, 1.0])
def test_a_change_in_motion_joins_and_fades(
    drive_with: DriveWith, what: str, after_s: float
) -> None:
    steps = []
    for tick_s in (0.02, 0.005):
        drive = drive_with(limits=FREE, grid_steps=FINE, tick_s=tick_s)
        last, sent = join(drive, what, after_s)
        assert sent[0] == pytest.approx(last, abs=2e-6)  # nothing jumps,
        steps.append(largest_step([last, *sent]))
        drive.run(CommandInput(0.2, bypass=what == "bypass on"), 12.0)
        assert drive.axis.output.setpoint == pytest.approx(0.2, abs=1e-3)  # and nothing stays;
    # continuous: a quarter of the tick, about a quarter of the largest step.
    assert steps[1] < 0.35 * steps[0] + 1e-5


def test_the_difference_at_a_change_fades_with_its_time_constant(drive_with: DriveWith) -> None:
    class Half:
        def step(self, command: float) -> float:
            return 0.5 * command

    drive = drive_with(Half(), FREE, grid_steps=FINE).moving(0.8)
    for k in range(60):
        drive.tick(CommandInput(0.8, bypass=True))
        expected = 0.8 - 0.4 * math.exp(-k * TICK_S / BLEND_S)
        assert drive.axis.output.setpoint == pytest.approx(expected, abs=2e-6)


def test_the_time_constant_is_the_documented_one() -> None:
    assert BLEND_S == 0.3  # docs/states.md


def test_a_bypass_from_rest_gives_the_joystick_at_once(drive_with: DriveWith) -> None:
    drive = drive_with(limits=FREE, grid_steps=FINE)
    for command in (0.8, -0.6):
        drive.to_ready().tick(CommandInput(command, bypass=True))
        assert drive.state is State.BYPASS_ON
        assert drive.axis.output.setpoint == pytest.approx(command, abs=2e-6)
        drive.run(CommandInput(bypass=True), 3.0)


@pytest.mark.parametrize("seed", range(5))
def test_no_change_beats_the_rates(drive_with: DriveWith, seed: int) -> None:
    limits = OutputLimits(rise_per_s=2.0, fall_per_s=4.0, tail_s=0.5)
    drive = drive_with(limits=limits).moving()
    rng = random.Random(seed)
    for k in range(60):
        bypass = rng.random() < 0.5
        if k % 7 == 0:
            mode = SwayMode(rng.uniform(1.5, 5.0), rng.uniform(0.0, 0.3))
            pole = -rng.uniform(1.0, 6.0)
            drive.axis.retune(mode, lambda sway, pole=pole: Gff(sway, (pole, pole)))
        drive.run(CommandInput(rng.uniform(-1.0, 1.0), bypass=bypass), 0.1)
    assert largest_step(drive.sent) <= 4.0 * TICK_S + 1.0 / 125 + 1e-12
    growth = [abs(b) - abs(a) for a, b in itertools.pairwise(drive.sent)]
    assert max(growth) <= 2.0 * TICK_S + 1.0 / 125 + 1e-12


def test_a_retune_keeps_the_swing(drive: Drive) -> None:
    drive.moving()
    shown = drive.axis.sway.sway_rad(1.5)
    assert shown != 0.0
    drive.axis.retune(NEW_MODE, new_filter)
    assert drive.axis.sway.mode == NEW_MODE
    assert drive.axis.sway.sway_rad(1.5) == pytest.approx(shown, rel=1e-12)


def test_a_retune_to_the_same_filter_changes_next_to_nothing(drive_with: DriveWith) -> None:
    """Not even in the middle of a press, where a lag in the filter remembers the way there."""
    drive, other = (drive_with(grid_steps=FINE) for _ in range(2))
    for each in (drive, other):
        each.axis.retune(each.axis.sway.mode, lagged)
        each.run(CommandInput(), 0.1)
        each.run(CommandInput(0.8), 0.2)
    drive.axis.retune(drive.axis.sway.mode, lagged)
    for each in (drive, other):
        each.run(CommandInput(0.8), 1.0)
        each.run(CommandInput(), 2.0)
    # The join holds the output for a tick, which fades; nothing is added to that.
    differences = [abs(a - b) for a, b in zip(drive.sent, other.sent, strict=True)]
    held = next(difference for difference in differences if difference)
    assert max(differences) == held < 0.006


def test_an_axis_without_sway_can_be_given_one() -> None:
    axis = ShapedAxis(TICK_S, OutputLimits(), sway=None, shaper=Off())
    axis.tick(CommandInput())
    axis.hold(3)
    axis.retune(NEW_MODE, new_filter)
    axis.tick(CommandInput(0.8))
    assert axis.sway is not None
    assert axis.sway.rate != 0.0


@pytest.mark.parametrize("mode", [NEW_MODE, SwayMode(2.9, 0.1)])
def test_a_retune_that_fails_changes_nothing(drive_with: DriveWith, mode: SwayMode) -> None:
    drive, other = drive_with().moving(), drive_with().moving()
    with pytest.raises(ValueError, match=r"pole: expected .*, got -60 rad/s"):
        drive.axis.retune(mode, lambda sway: Gff(sway, (-60.0, -3.0)))
    for each in (drive, other):
        each.run(CommandInput(0.5), 1.0)
        each.run(CommandInput(), 2.0)
    assert drive.raw == other.raw
    assert drive.axis.sway.angle == other.axis.sway.angle
