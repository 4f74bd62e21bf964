"""The tip controller: it follows its commands, keeps off the stops, and crosses no singularity."""

import math
import random
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from canshaper.shaping.limits import with_deadband
from canshaper_sim.axes import JOINT_AXES, TIP_AXES
from canshaper_sim.crane import CraneParameters, CraneState
from canshaper_sim.joints import JointBoom, JointParameters
from canshaper_sim.machines import TipControlledCrane
from canshaper_sim.tip_controller import TipController, TipControllerParameters
from tests.sim.drives import TICK_S

TIP_FULL = (0.5, 1.0, 0.8)
START = (0.0, 1.3, -1.87, 0.1)  # about the start pose


def frames(slew: float, near_far: float, lift: float) -> dict[str, float]:
    """Values of the valve frames for these speeds, the deadband of 5 % jumped over."""
    speeds = (slew, near_far, lift)
    return {axis: with_deadband(v, 0.05) for axis, v in zip(TIP_AXES, speeds, strict=True)}


def run(machine: TipControlledCrane, speeds: Sequence[float], ticks: int) -> list[CraneState]:
    """Hold the speeds; no joint may touch its stop."""
    states = []
    for _ in range(ticks):
        machine.step(TICK_S, frames(*speeds))
        assert machine.crane.axes_at_stop == ()
        states.append(machine.crane.state)
    return states


def joints_of(machine: TipControlledCrane) -> tuple[float, ...]:
    boom = machine.crane.boom
    assert isinstance(boom, JointBoom)
    return boom.joints


def controller(**changes: Any) -> TipController:
    return TipController(TipControllerParameters(**changes), JointParameters(), TIP_FULL)


@pytest.mark.parametrize(
    ("speeds", "ticks"),
    [
        ((0.0, 1.0, 0.0), 150),
        ((0.0, 0.4, 0.0), 300),
        ((0.8, 0.5, -0.6), 130),
        ((-0.5, 0.0, -1.0), 100),
        ((0.3, 0.6, 0.3), 150),
    ],
)
def test_tip_moves_as_commanded_away_from_limits(speeds: tuple[float, ...], ticks: int) -> None:
    expected = [v * full for v, full in zip(speeds, TIP_FULL, strict=True)]
    states = run(TipControlledCrane(), speeds, ticks)
    for state in states[40:]:
        assert state[4:7] == pytest.approx(expected, abs=0.01)  # rad/s, m/s
    # What the start-up of four unequal valves leaves behind.
    if not speeds[2]:
        assert states[-1].height_m == pytest.approx(4.0, abs=0.015)


def test_neutral_leaves_the_valves_closed() -> None:
    closed = dict.fromkeys(JOINT_AXES, 0.0)
    assert controller().tick({}, START) == closed
    # Inside the deadband of its input a tip command is none.
    assert controller().tick({"near_far": 0.05, "slew": -0.04, "lift": 0.0}, START) == closed


def test_deadband_of_the_joint_valves_is_jumped_over() -> None:
    plain = controller(output_deadband=0.0).tick(frames(0.2, 0.3, 0.0), START)
    jumped = controller(output_deadband=0.1).tick(frames(0.2, 0.3, 0.0), START)
    for axis in JOINT_AXES:
        assert 0.004 < abs(plain[axis]) < 1.0
        assert jumped[axis] == pytest.approx(with_deadband(plain[axis], 0.1), abs=1e-12)


def test_without_its_deadband_compensation_the_tip_is_slower() -> None:
    """The valves have the deadband; a controller that does not know loses speed."""
    unaware = CraneParameters(tip_controller=TipControllerParameters(output_deadband=0.0))
    slow = run(TipControlledCrane(unaware), (0.0, 0.4, 0.0), 100)[-1]
    right = run(TipControlledCrane(), (0.0, 0.4, 0.0), 100)[-1]
    assert right.radius_rate_m_s == pytest.approx(0.4, abs=0.01)
    assert slow.radius_rate_m_s < 0.36


def falls_without_rising(speeds: Sequence[float], tolerance: float) -> bool:
    lowest = math.inf
    for speed in speeds[speeds.index(max(speeds)) :]:
        if speed > lowest + tolerance:
            return False
        lowest = min(lowest, speed)
    return True


@pytest.mark.parametrize(
    ("speeds", "index", "ticks"), [((0.0, 1.0, 0.0), 5, 550), ((0.0, -1.0, 0.0), 5, 250)]
)
def test_tip_slows_down_smoothly_at_the_end_of_the_reach(
    speeds: tuple[float, float, float], index: int, ticks: int
) -> None:
    states = run(TipControlledCrane(), speeds, ticks)
    sign = math.copysign(1.0, sum(speeds))
    rates = [sign * s[index] for s in states]
    assert falls_without_rising(rates, 3e-3)
    assert abs(rates[-1]) < 1e-3
    # The way stays straight: nothing moves up or down instead.
    assert all(abs(s.height_m - 4.0) < 0.015 for s in states)
    # Half as hard as a valve of 5 full speeds/s would stop the tip.
    slowing = rates[rates.index(max(rates)) :]
    assert max(abs(b - a) / TICK_S for a, b in pairwise(slowing)) < 2.5


def test_at_the_end_of_the_reach_the_other_coordinate_still_moves() -> None:
    machine = TipControlledCrane()
    run(machine, (0.0, 1.0, 0.0), 450)
    states = run(machine, (0.0, 1.0, -1.0), 100)
    assert states[-1].height_rate_m_s == pytest.approx(-0.8, abs=0.01)
    assert states[-1].radius_rate_m_s > 0.0  # lower down the boom reaches farther


def test_slew_slows_down_before_its_stop() -> None:
    machine = TipControlledCrane()
    states = run(machine, (1.0, 0.0, 0.0), 600)
    assert falls_without_rising([s.theta1_rate_rad_s for s in states], 1e-9)
    assert math.degrees(states[-1].theta1_rad) == pytest.approx(189.5, abs=0.2)
    assert states[-1].theta1_rate_rad_s < 1e-3


@pytest.mark.slow
def test_no_command_ever_drives_a_joint_into_its_stop() -> None:
    """Random commands for 5 min, most of them at the edge of the work space."""
    for seed in range(3):
        source = random.Random(seed)
        machine = TipControlledCrane()
        full = (0.5, 0.4, 0.7, 1.0)
        for _ in range(60):
            speeds = [source.choice((0.0, 1.0, -1.0, source.uniform(-1, 1))) for _ in range(3)]
            run(machine, speeds, source.randrange(20, 130))
            boom = machine.crane.boom
            assert isinstance(boom, JointBoom)
            for rate, largest in zip(boom.joint_rates, full, strict=True):
                assert abs(rate) <= largest + 1e-9


def test_straight_arm_is_reached_and_left_without_a_jump() -> None:
    """With the telescope locked the straight arm is singular: the tip slows down there."""
    locked = JointParameters(extension_max_m=0.0, start_extension_m=0.0)
    machine = TipControlledCrane(CraneParameters(joints=locked))
    out = run(machine, (0.0, 1.0, 0.0), 400)
    assert falls_without_rising([s.radius_rate_m_s for s in out], 5e-3)
    assert math.degrees(joints_of(machine)[2]) == pytest.approx(-0.55, abs=0.1)
    back = run(machine, (0.0, -1.0, 0.0), 110)
    speeds = [s.radius_rate_m_s for s in back]
    assert all(b < a + 0.01 for a, b in pairwise(speeds))
    assert speeds[-1] == pytest.approx(-1.0, abs=0.01)
    accelerations = [abs(b - a) / TICK_S for a, b in pairwise(speeds)]
    assert max(accelerations) < 1.5
    assert all(abs(s.height_m - out[-1].height_m) < 0.08 for s in back)


def test_redundancy_keeps_joints_in_the_middle_of_their_ranges() -> None:
    """A telescope that starts out runs in while the tip moves up and down."""

    def extension_after(posture: float) -> float:
        p = CraneParameters(
            joints=JointParameters(start_extension_m=2.9),
            tip_controller=TipControllerParameters(posture=posture),
            start_radius_m=6.5,
            start_height_m=2.5,
        )
        machine = TipControlledCrane(p)
        for k in range(8):
            run(machine, (0.0, 0.0, 0.4 if k % 2 else -0.4), 50)
        return joints_of(machine)[3]

    assert extension_after(0.3) < extension_after(0.0) - 0.3


def test_ticks_do_not_depend_on_the_step_of_the_plant() -> None:
    coarse, fine = TipControlledCrane(), TipControlledCrane()
    source = random.Random(5)
    for _ in range(60):
        commands = frames(*(source.uniform(-1.0, 1.0) for _ in range(3)))
        coarse.step(0.06, commands)
        for _ in range(12):
            fine.step(0.005, commands)
    assert coarse.crane.state == pytest.approx(tuple(fine.crane.state), abs=1e-5)


@pytest.mark.parametrize(
    ("dt_s", "commands", "message"),
    [
        (0.0, {}, "dt_s: expected a positive value, got 0.0"),
        (0.02, {"knuckle": 0.1}, "axis: expected one of slew, near_far, lift, got 'knuckle'"),
        (0.02, {"lift": math.nan}, "command: expected a finite value, got nan"),
    ],
)
def test_impossible_steps_are_refused(
    dt_s: float, commands: dict[str, float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        TipControlledCrane().step(dt_s, commands)


def test_impossible_settings_are_refused() -> None:
    with pytest.raises(
        ValueError, match=r"tip controller: period_s: expected 0.001 .. 0.1, got 0.0"
    ):
        replace(TipControllerParameters(), period_s=0.0)
