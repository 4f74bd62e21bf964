"""Velocity that a two-axis motion adds: bounded in its way, none by a senseless model."""

import math

import pytest

from canshaper.shaping.moving_axis import MOST_STEP
from canshaper.shaping.two_axis_motion import TwoAxisMotion
from tests.shaping.two_axes import OUT_M_S, STILL, TICK_S, Drive, slewing, stroke


@pytest.mark.parametrize("value", [math.nan, math.inf, -1e300])
def test_a_senseless_model_adds_nothing_or_no_more_than_a_step(value: float) -> None:
    for name in ("angle", "rate"):
        drive = Drive()
        drive.run(stroke(0.2, 3.0), stroke(0.2, 3.0), until_s=0.5, motion=True)
        before = drive.slew.moving.added, drive.near_far.moving.added
        setattr(drive.slew.sway, name, value)
        drive.motion.step(TICK_S, 3.0)
        after = drive.slew.moving.added, drive.near_far.moving.added
        for was, now in zip(before, after, strict=True):
            assert now == 0.0 or abs(now - was) <= MOST_STEP


@pytest.mark.parametrize("tip_m", [3.0, None])
def test_an_axis_in_the_middle_of_its_period_keeps_what_it_adds(tip_m: float | None) -> None:
    drive = Drive()
    drive.run(stroke(0.2, 3.0), stroke(0.2, 3.0), until_s=1.0, motion=True)
    slew = drive.slew.moving
    before = slew.added
    assert before != 0.0
    slew.ahead_s = TICK_S
    drive.motion.step(TICK_S, tip_m)
    assert slew.added == before
    slew.ahead_s = 0.0
    drive.motion.step(TICK_S, tip_m)
    assert slew.added != before


def test_slew_alone_has_nothing_added_at_rest() -> None:
    drive = Drive()
    drive.run(stroke(0.2, 3.0), STILL, until_s=0.8, motion=True)
    slew = drive.slew.moving
    motion = TwoAxisMotion(slew, None, path_m=1.0)
    motion.step(TICK_S, None)
    added = slew.added
    assert added != 0.0
    slew.ahead_s = TICK_S
    motion.step(TICK_S, None)
    assert slew.added == added
    slew.commanded = False
    motion.step(TICK_S, None)
    assert slew.added == 0.0 == slew.reached


@pytest.mark.parametrize("tip_m", [0.0, 1e-9, -5.0])
def test_a_radius_of_nothing_is_no_reason_to_stop(tip_m: float) -> None:
    """A sensor says what it says; the map takes no less than half a metre."""
    drive = Drive()
    last = 0.0
    for _ in range(100):
        for axis in (drive.slew, drive.near_far):
            axis.moving.commanded = axis.moving.able = True
        drive.motion.step(TICK_S, tip_m)
        drive.slew.run(1.0)
        drive.near_far.run(-1.0)
        now = drive.near_far.moving.added
        assert abs(now - last) <= MOST_STEP + 1e-12
        last = now


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("fall_per_s", [1.0, 5.0])
def test_what_is_added_stops_before_the_bound_of_the_way(sign: float, fall_per_s: float) -> None:
    """However far the path leads, and though the axis is slower than what was added."""
    motion, _, axis = slewing()
    axis.farthest, axis.fall_per_s, axis.largest = 0.2, fall_per_s, 0.25
    ways = []
    for _ in range(200):
        motion.step(TICK_S, 3.0)
        axis.add(sign, 1.0)
        fall = axis.sent - sign * fall_per_s * TICK_S
        axis.sent = sign * max(sign * fall, min(sign * axis.added, 0.25))
        ways.append(sign * axis.way)
    assert max(ways) == pytest.approx(0.2, abs=1e-3)
    assert max(ways) <= 0.2 + 1e-9
    assert not axis.damps  # it could only go farther
    axis.add(-sign, 1.0)
    assert sign * axis.added < 0.0
    # Where the operator moves it himself, the way begins again.
    axis.commanded = True
    motion.step(TICK_S, 3.0)
    assert axis.way == 0.0
    axis.add(5.0 * sign, 1.0)
    assert sign * axis.added > 0.0


def test_the_way_begins_again_with_the_next_motion() -> None:
    motion, slew, near_far = slewing()
    near_far.sent = -0.25
    motion.step(TICK_S, 3.0)
    assert near_far.way == pytest.approx(-0.25 * TICK_S * OUT_M_S)
    slew.able = False
    for _ in range(30):  # what was added has faded; slew is still commanded
        near_far.sent = 0.0
        motion.step(TICK_S, 3.0)
    slew.commanded = False
    for one, other in ((False, False), (True, False), (False, True)):
        slew.unattended, near_far.unattended = one, other
        motion.step(TICK_S, 3.0)
        assert near_far.way < 0.0
        assert not motion.unattended
    slew.unattended = near_far.unattended = True
    motion.step(TICK_S, 3.0)
    assert near_far.way == 0.0
    assert motion.unattended


def test_what_was_not_added_while_an_axis_could_not_is_not_made_up_for() -> None:
    drive = Drive()
    drive.slew.moving.able = drive.near_far.moving.able = True
    drive.run(stroke(0.2, 3.0), stroke(0.2, 3.0), until_s=1.0, motion=True)
    slew, near_far = drive.slew.moving, drive.near_far.moving
    near_far.able = False
    for _ in range(11):
        drive.motion.step(TICK_S, 3.0)
    assert near_far.joins
    near_far.able = True
    drive.motion.step(TICK_S, 3.0)
    assert (slew.added, near_far.added, near_far.joins) == (0.0, 0.0, False)
    assert near_far.reached != 0.0
    for axis in (slew, near_far):
        axis.commanded = False
    drive.motion.step(TICK_S, 3.0)
    assert (near_far.reached, near_far.joins) == (0.0, False)


def test_no_farther_than_it_may_be_moved() -> None:
    motion, _, near_far = slewing(path_m=0.1)
    near_far.applied = -0.25
    for _ in range(19):
        motion.step(TICK_S, 3.0)
        assert near_far.damps
    motion.step(2 * TICK_S, 3.0)
    assert near_far.damped == pytest.approx(-0.105)
    assert not near_far.damps
    near_far.commanded = True
    motion.step(TICK_S, 3.0)
    assert near_far.damped == 0.0
    near_far.commanded = False
    motion.step(TICK_S, 3.0)
    assert near_far.damps
    motion.stop()
    assert (near_far.damps, near_far.damped) == (False, 0.0)
