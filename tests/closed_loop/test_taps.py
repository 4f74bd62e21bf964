"""Taps through frames and on the crane: one movement, as long as the joystick asked for."""

import math
from itertools import pairwise

import pytest

from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper_sim.recording import Recording
from canshaper_sim.strokes import Script, Stroke
from tests.rigs.files import CONFIG

# From leaving neutral to letting go. The ramp of the shortest one lies within the neutral band for
# long, of the least stroke in this list a twentieth.
DURATIONS = (0.1, 0.15, 0.3, 0.45, 1.0)
TICK_S = 0.02


def tapped(file: str, axis: str, level: float, duration_s: float) -> Recording:
    script = Script("tap", (Stroke(axis, 0.5, duration_s, level, 0.04),), duration_s + 6.0)
    return drive(load_deployment(CONFIG / file), script)


def movements(recording: Recording, axis: str) -> int:
    return sum(a == 0.0 != b for a, b in pairwise(recording.axes[axis].sent))


def travel_s(recording: Recording, axis: str) -> float:
    return sum(recording.axes[axis].sent) * TICK_S


@pytest.mark.parametrize("axis", ["slew", "near_far"])
@pytest.mark.parametrize(
    "level", [0.1, 1.0, *(pytest.param(one, marks=pytest.mark.slow) for one in (-0.13, 0.3))]
)
def test_a_tap_moves_the_crane_once_and_as_far_as_asked(axis: str, level: float) -> None:
    for duration_s in DURATIONS:
        recording = tapped("forwarder-robust.yaml", axis, level, duration_s)
        commanded_s = sum(recording.axes[axis].joystick) * TICK_S
        assert abs(commanded_s) > 0.9 * duration_s * abs(level)
        assert movements(recording, axis) == 1, duration_s
        assert travel_s(recording, axis) == pytest.approx(commanded_s, rel=0.05), duration_s
        slew, near_far = recording.axes["slew"].sway_deg, recording.axes["near_far"].sway_deg
        assert slew is not None
        assert near_far is not None
        swing = max(math.hypot(a, b) for a, b in zip(slew[-150:], near_far[-150:], strict=True))
        assert swing < 0.3, duration_s


def test_what_gff_makes_of_a_tap() -> None:
    """Its first movement is the whole tap; what catches the swing of that is as much again."""
    recording = tapped("forwarder.yaml", "near_far", 1.0, 0.15)
    assert movements(recording, "near_far") == 2
    assert 1.6 < travel_s(recording, "near_far") / 0.15 < 1.9
