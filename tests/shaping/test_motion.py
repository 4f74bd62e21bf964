"""Both axes at once, judged by a point mass on springs in a plane that stands still."""

import pytest

from canshaper.shaping.moving_axis import MOST_STEP
from tests.shaping.two_axes import (
    NEAR_FAR,
    STILL,
    TICK_S,
    TURN_RAD_S,
    Command,
    Drive,
    slewing,
    stroke,
)

BOTH = [
    pytest.param(
        stroke(0.2, 3.0), stroke(0.2 + late, 2.4, level), id=f"{level:+g} {late:g} s later"
    )
    for late in (0.0, 0.7, 1.6)
    for level in (1.0, -0.4)
]
END_S = 9.0


@pytest.mark.parametrize("ticks", [1, 3])
@pytest.mark.parametrize(("slew", "near_far"), BOTH)
def test_both_axes_at_once_leave_the_grapple_at_rest(
    slew: Command, near_far: Command, ticks: int
) -> None:
    apart = Drive(near_far_ticks=ticks).run(slew, near_far, until_s=END_S, motion=False)
    together = Drive(near_far_ticks=ticks).run(slew, near_far, until_s=END_S, motion=True)
    print(f"{1000 * apart:.1f} mm by themselves, {1000 * together:.2f} mm as one motion")
    assert apart > 0.02
    assert together < 0.06 * apart


def test_slew_alone_takes_the_tip_in_and_back() -> None:
    drive = Drive()
    least_m = drive.radius_m

    def watch(time_s: float) -> float:
        nonlocal least_m
        least_m = min(least_m, drive.radius_m)
        return 0.0

    assert drive.run(stroke(0.2, 3.0), watch, until_s=END_S, motion=True) < 0.002
    # The centripetal acceleration at full speed, in the share of gravity that it takes.
    assert least_m == pytest.approx(
        3.0 * (1.0 - (TURN_RAD_S / NEAR_FAR.omega_rad_s) ** 2), rel=2e-3
    )
    assert drive.radius_m == pytest.approx(3.0, abs=1e-4)


def test_near_far_alone_gets_nothing_added() -> None:
    drive = Drive()
    added = []

    def command(time_s: float) -> float:
        added.append((drive.slew.moving.added, drive.near_far.moving.added))
        return stroke(0.2, 2.0)(time_s)

    drive.run(STILL, command, until_s=5.0, motion=True)
    assert set(added) == {(0.0, 0.0)}


@pytest.mark.parametrize("radius_m", [2.0, 9.0])
def test_no_step_of_the_added_part_is_large(radius_m: float) -> None:
    drive = Drive(start_m=radius_m)
    last, steps = (0.0, 0.0), []

    def command(time_s: float) -> float:
        nonlocal last
        now = drive.slew.moving.added, drive.near_far.moving.added
        steps.append(max(abs(a - b) for a, b in zip(now, last, strict=True)))
        last = now
        return stroke(0.2, 1.0)(time_s) - stroke(1.2, 1.0)(time_s)

    slew = stroke(0.3, 1.0), stroke(1.3, 2.0, -1.0)
    drive.run(lambda t: slew[0](t) + slew[1](t), command, until_s=6.0, motion=True)
    assert 0.02 < max(steps) <= MOST_STEP + 1e-12


def test_it_ends_in_a_fifth_of_a_second_where_an_axis_can_no_more_and_begins_from_nothing() -> None:
    drive = Drive()
    drive.run(stroke(0.2, 3.0), stroke(0.2, 3.0), until_s=1.0, motion=True)
    slew, near_far = drive.slew.moving, drive.near_far.moving
    assert near_far.added != 0.0
    slew.able = False
    added = []
    for _ in range(11):
        drive.motion.step(TICK_S, 3.0)
        added.append(near_far.added)
    assert abs(added[4]) > 0.0
    assert added[-1] == 0.0 == near_far.reached
    slew.able = True
    drive.motion.step(TICK_S, 3.0)
    assert abs(near_far.added) <= MOST_STEP


def test_near_far_may_damp_what_slewing_makes_it_swing() -> None:
    motion, slew, near_far = slewing()
    motion.step(TICK_S, 3.0)
    assert near_far.damps
    assert not slew.damps
    near_far.commanded = True
    motion.step(TICK_S, 3.0)
    assert not near_far.damps
    near_far.commanded, near_far.able = False, False
    motion.step(TICK_S, 3.0)
    assert not near_far.damps
    near_far.able = True
    for _ in range(20):
        motion.step(TICK_S, 3.0)
    assert near_far.damps
    slew.commanded = False
    motion.step(TICK_S, 3.0)
    assert not near_far.damps
