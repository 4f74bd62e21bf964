"""Both axes at once, judged by a point mass on springs in a plane that stands still."""

import math
from collections.abc import Callable

import pytest

from canshaper.shaping.motion import TwoAxisMotion
from canshaper.shaping.moving_axis import MOST_STEP, MovingAxis
from canshaper.shaping.shapers.fir import Fir, zv_taps
from canshaper.shaping.sway import SwayMode, SwayModel

SLEW, NEAR_FAR = SwayMode(2.67, 0.04), SwayMode(2.86, 0.06)
TURN_RAD_S, OUT_M_S = 0.5, 1.0
TICK_S = 0.02
INNER = 40
Command = Callable[[float], float]


class Axis:
    """Zero-vibration filter and sway model, driven by a command over time."""

    def __init__(self, mode: SwayMode, full: float, period_s: float) -> None:
        self.sway = SwayModel(mode, period_s)
        self.filter = Fir(zv_taps(mode, period_s))
        self.moving = MovingAxis(full, period_s, self.sway)
        self.sent = 0.0

    def run(self, command: float) -> None:
        self.moving.applied = self.filter.step(command)
        self.sent = self.moving.applied + self.moving.added
        self.sway.step(self.moving.applied)


class Drive:
    """A grapple on two springs with dampers, which turn with the boom; it does not know the map."""

    def __init__(self, *, near_far_ticks: int = 1, start_m: float = 3.0) -> None:
        self.slew = Axis(SLEW, TURN_RAD_S, TICK_S)
        self.near_far = Axis(NEAR_FAR, OUT_M_S, near_far_ticks * TICK_S)
        self.ticks = near_far_ticks
        self.motion = TwoAxisMotion(self.slew.moving, self.near_far.moving, path_m=1.0)
        self.angle, self.radius_m = 0.0, start_m
        self.mass = (start_m, 0.0, 0.0, 0.0)
        self.radius_error_m = 0.0

    def run(self, slew: Command, near_far: Command, *, until_s: float, motion: bool) -> float:
        """Largest distance, m, of grapple and tip in the last 2.4 s."""
        worst = 0.0
        for tick in range(round(until_s / TICK_S)):
            time_s = tick * TICK_S
            due = tick % self.ticks == 0
            for axis in (self.slew, self.near_far):
                axis.moving.commanded = axis.moving.able = motion
            self.near_far.moving.ahead_s = -(tick % self.ticks) % self.ticks * TICK_S
            self.motion.step(TICK_S, self.radius_m + self.radius_error_m)
            self.slew.run(slew(time_s))
            if due:
                self.near_far.run(near_far(time_s))
            for _ in range(INNER):
                off = self._inner(TICK_S / INNER)
                if time_s > until_s - 2.4:
                    worst = max(worst, off)
        return worst

    def _inner(self, h: float) -> float:
        turn = TURN_RAD_S * self.slew.sent
        out = OUT_M_S * self.near_far.sent
        self.angle += h * turn
        self.radius_m += h * out
        x, y, vx, vy = self.mass
        c, s = math.cos(self.angle), math.sin(self.angle)
        along, across = x * c + y * s, y * c - x * s
        along_rate = vx * c + vy * s + turn * across - out
        across_rate = vy * c - vx * s - turn * along
        pull_r = NEAR_FAR.omega_rad_s**2 * (along - self.radius_m)
        pull_r += 2 * NEAR_FAR.damping_ratio * NEAR_FAR.omega_rad_s * along_rate
        pull_t = SLEW.omega_rad_s**2 * across
        pull_t += 2 * SLEW.damping_ratio * SLEW.omega_rad_s * across_rate
        vx -= h * (pull_r * c - pull_t * s)
        vy -= h * (pull_r * s + pull_t * c)
        self.mass = (x + h * vx, y + h * vy, vx, vy)
        return math.hypot(along - self.radius_m, across)


def stroke(begin_s: float, seconds: float, level: float = 1.0) -> Command:
    return lambda time_s: level if begin_s <= time_s < begin_s + seconds else 0.0


BOTH = [
    pytest.param(
        stroke(0.2, 3.0), stroke(0.2 + late, 2.4, level), id=f"{level:+g} {late:g} s later"
    )
    for late in (0.0, 0.7, 1.6)
    for level in (1.0, -0.4)
]
STILL = stroke(0.0, 0.0)
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


def test_what_a_missed_tick_has_added_more_is_taken_back() -> None:
    axis = MovingAxis(OUT_M_S, TICK_S, SwayModel(NEAR_FAR, TICK_S))
    axis.add(0.001, 1.0)
    assert axis.added == pytest.approx(0.05)
    axis.held(2 * TICK_S)
    assert axis.reached == pytest.approx(0.003)
    axis.add(0.001, 1.0)
    assert axis.added == pytest.approx(-0.05)  # no further than a step in a tick
    axis.add(0.001, 1.0)
    assert axis.reached == pytest.approx(0.001)


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


def test_a_lost_radius_is_carried_on_and_a_jump_of_it_moves_nothing_at_once() -> None:
    pair = stroke(0.2, 3.0), stroke(0.2, 2.4)
    carried, jumped = Drive(), Drive()
    for drive in (carried, jumped):
        drive.run(*pair, until_s=2.0, motion=True)
    assert carried.near_far.moving.added == jumped.near_far.moving.added
    carried.motion.step(TICK_S, None)
    jumped.motion.step(TICK_S, jumped.radius_m + 1.0)
    difference = carried.near_far.moving.added - jumped.near_far.moving.added
    assert 0.0 < abs(difference) < 0.5 * MOST_STEP


def test_without_a_radius_or_another_axis_slew_keeps_its_part() -> None:
    drive = Drive()
    drive.run(stroke(0.2, 3.0), STILL, until_s=0.8, motion=True)
    slew = drive.slew.moving
    alone = MovingAxis(TURN_RAD_S, TICK_S, slew.sway, slew.applied, commanded=True, able=True)
    TwoAxisMotion(alone, None, path_m=1.0).step(TICK_S, None)
    nowhere = MovingAxis(TURN_RAD_S, TICK_S, slew.sway, slew.applied, commanded=True, able=True)
    near_far = MovingAxis(OUT_M_S, TICK_S, SwayModel(NEAR_FAR, TICK_S), able=True)
    TwoAxisMotion(nowhere, near_far, path_m=1.0).step(TICK_S, None)
    assert alone.added == nowhere.added != 0.0
    assert near_far.added == 0.0


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


def slewing(path_m: float = 0.3) -> tuple[TwoAxisMotion, MovingAxis, MovingAxis]:
    """Slew commanded, near-far left alone."""
    slew = MovingAxis(TURN_RAD_S, TICK_S, SwayModel(SLEW, TICK_S), commanded=True, able=True)
    near_far = MovingAxis(OUT_M_S, TICK_S, SwayModel(NEAR_FAR, TICK_S), able=True)
    return TwoAxisMotion(slew, near_far, path_m), slew, near_far


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


def test_beyond_the_bound_nothing_is_added_outwards() -> None:
    _, _, axis = slewing()
    axis.farthest, axis.way = 0.2, 0.21
    assert axis.room(1.0) == 0.0
    axis.add(1.0, 1.0)
    assert axis.added == 0.0
    axis.add(-1.0, 1.0)
    assert axis.added < 0.0


def test_the_way_begins_again_with_the_next_motion() -> None:
    motion, slew, near_far = slewing()
    near_far.sent = -0.25
    motion.step(TICK_S, 3.0)
    assert near_far.way == pytest.approx(-0.25 * TICK_S * OUT_M_S)
    slew.able = False
    for _ in range(30):  # what was added has faded; slew is still commanded
        near_far.sent = 0.0
        motion.step(TICK_S, 3.0)
    assert near_far.way < 0.0
    slew.commanded = False
    motion.step(TICK_S, 3.0)
    assert near_far.way == 0.0


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
