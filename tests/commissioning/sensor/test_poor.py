"""Data that is not enough is refused, with what is missing and what to do."""

import functools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from canshaper.commissioning.identification.series import Array, Series
from canshaper.commissioning.sensor.fit import FIRST_S, hand_driven
from canshaper.commissioning.sensor.verdict import DRIVE_IT, examine
from canshaper_sim.operator import random_script
from canshaper_sim.strokes import Script, Stroke
from tests.commissioning.sensor.drives import Drive, machine

AXIS = machine().axes["near_far"]
RESTING = Script("rest", (), 30.0)
AWAY = "no stretch of driving with measurements all the time"
Change = Callable[[Series], Series]


@functools.cache
def good() -> Series:
    """The good drive with which the refusals below are compared."""
    return Drive(machine()).series(delay_s=0.05)


@functools.cache
def at_rest() -> Series:
    return Drive(machine(), script=RESTING).series()


def refused(series: Series, *texts: str) -> None:
    finding = examine(AXIS, series)
    print(finding.problems)
    (fault,) = finding.problems
    for text in texts:
        assert text in fault


def pushed(time: Array, at_s: float, degrees: float = 6.0) -> Array:
    """A swing that begins with a push."""
    after = np.maximum(time - at_s, 0.0)
    return math.radians(degrees) * np.exp(-0.14 * after) * np.sin(2.85 * after)


@pytest.mark.slow
def test_the_same_data_is_good_enough() -> None:
    assert not examine(AXIS, good()).problems


@pytest.mark.slow
def test_nothing_moved() -> None:
    refused(at_rest(), "expected near_far driven alone for 2 s or more, got 0.0 s", DRIVE_IT)


def test_only_pushes_by_hand() -> None:
    one = at_rest()
    swing = sum((pushed(one.time_s, at) for at in (3.0, 9.0, 17.0)), start=one.value)
    refused(replace(one, value=swing), "got 0.0 s; what moves the tool without a command", DRIVE_IT)


@pytest.mark.parametrize("degrees", [3.0, 6.0, 12.0])
def test_pushes_by_hand_while_it_is_driven(degrees: float) -> None:
    one = good()
    swing = one.value + sum(pushed(one.time_s, at, degrees) for at in (3.3, 8.1, 13.6, 18.2))
    refused(replace(one, value=swing), "commands of near_far to explain 80 %", DRIVE_IT)


@pytest.mark.parametrize(
    "at_s",
    [
        pytest.param(at_s, marks=[pytest.mark.slow] if number % 4 else [])
        for number, at_s in enumerate(np.arange(FIRST_S, 20.0, 0.7))
    ],
)
def test_one_push_is_seen_or_does_no_harm(at_s: float) -> None:
    one = good()
    finding = examine(AXIS, replace(one, value=one.value + pushed(one.time_s, at_s, 2.0)))
    assert finding.problems or abs(finding.delay_s.value - 0.05) < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("other", ["slew", "lift"])
def test_another_axis_moves_all_the_time(other: str) -> None:
    both = tuple(replace(s, axis=other, level=0.3) for s in hand_driven(["near_far"]).strokes)
    script = Script("both", (*hand_driven(["near_far"]).strokes, *both), 30.0)
    refused(Drive(machine(), script=script).series(), "expected near_far driven alone")


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "axis"), [(0, "near_far"), (10, "near_far")])
def test_a_drive_of_all_axes_is_refused_or_shows_the_truth(seed: int, axis: str) -> None:
    """Those that showed a delay 20 ms too large while a lift next to it counted as none."""
    drive = Drive(machine(), axis, 10.0, random_script(seed, 60.0))
    finding = drive.finding(delay_s=0.1, offset_deg=2.0, gain=-1.0)
    assert finding.problems or abs(finding.delay_s.value - 0.1) < 0.015


def test_a_swing_that_no_command_explains() -> None:
    """That of the other plane, of another tool, or noise alone."""
    one, time = good(), good().time_s
    other = math.radians(3.0) * np.sin(2.2 * time + 0.4 * np.sin(0.9 * time))
    refused(replace(one, value=other), "does it measure the plane of this axis?")
    noise = np.random.default_rng(1).normal(0.0, math.radians(0.5), len(time))
    refused(replace(one, value=noise), "does it measure the plane of this axis?")


def test_a_noise_that_hides_the_delay() -> None:
    one = good()
    noise = np.random.default_rng(1).normal(0.0, math.radians(3.0), len(one.time_s))
    refused(replace(one, value=one.value + noise), "of swing in a noise of 3", "drive it more")


def cut(keep: Callable[[Array], Array | slice]) -> Change:
    """Of the good drive the measurements at times that are kept."""

    def change(one: Series) -> Series:
        kept = keep(one.time_s)
        return replace(one, time_s=one.time_s[kept], value=one.value[kept])

    return change


def value(change: Callable[[Array], Array]) -> Change:
    return lambda one: replace(one, value=change(one.value))


@pytest.mark.parametrize(
    ("change", "texts"),
    [
        (value(lambda swing: np.full_like(swing, 0.1)), ["it stands at 0.1"]),
        (
            value(lambda swing: np.clip(swing, -0.02, 0.02)),
            ["the sensor is at the end of its range"],
        ),
        (value(lambda swing: 57.3 * swing), ["the file has 1: is the unit in the DBC right?"]),
        (value(lambda swing: 0.0175 * swing), ["the file has 1: is the unit in the DBC right?"]),
        (cut(lambda _time: slice(None, None, 50)), ["6 measure", "got"]),
        (cut(lambda _time: slice(None, None, 2000)), ["6 measure", "got 1 in all"]),
        (cut(lambda time: (time < FIRST_S) | (time > 22.0)), [DRIVE_IT]),
        (cut(lambda time: (time - FIRST_S) % 5.0 > 0.8), [AWAY, DRIVE_IT]),
        (lambda one: replace(one, command=None), ["expected commands of near_far in the log, got"]),
    ],
)
def test_measurements_that_cannot_be_used(change: Change, texts: list[str]) -> None:
    """They stand, are cut off at the sensor's end, in another unit, too few, or away."""
    refused(change(good()), *texts)


@pytest.mark.slow
def test_a_delay_of_more_than_a_quarter_of_a_swing() -> None:
    refused(Drive(machine()).series(delay_s=0.6), "expected a delay up to 550 ms, a quarter")


def test_one_stroke_is_too_little() -> None:
    once = Script("once", (Stroke("near_far", 2.0, 0.2, 0.3),), 12.0)
    refused(Drive(machine(), script=once).series(), "expected near_far driven alone for 2 s")
