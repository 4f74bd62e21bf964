"""Ends of a two-axis motion: anti-sway off, a released enable, a lost joystick, a stall."""

import itertools
import math

import pytest

from canshaper.shaping.states import State
from tests.controller.motion_rig import (
    LIFT_OF_RIGHT,
    Make,
    by_two_joysticks,
    moving_as_one,
    near_far,
)


def test_a_slew_whose_anti_sway_is_off_asks_nothing_of_another_joystick(changed_rig: Make) -> None:
    rig = by_two_joysticks(changed_rig)
    for i in range(200):
        left = rig.joystick("JoystickLeft", AntiSwayOff=1, Slew=1000 if i > 2 else 0)
        rig.receive(left, rig.joystick("JoystickRight"))
        assert rig.tick()["NearFarCommand"]["Velocity"] == 0
    assert (rig.state(), rig.state("near_far")) == (State.BYPASS_ON, State.READY)


def test_a_swing_left_by_the_bypass_moves_nothing_for_longer_than_the_tail(
    changed_rig: Make,
) -> None:
    """Anti-sway comes back while the crane runs out: the grapple swings on, the tip may not."""
    rig = moving_as_one(changed_rig)
    rig.run(3, AntiSwayOff=1)
    rig.run(100, Slew=1000, AntiSwayOff=1)
    rig.run(3, AntiSwayOff=1)
    rig.run(1)
    assert rig.state() is State.ACTIVE
    near_far(rig, 115)  # tail_s and the fall from full speed
    assert set(near_far(rig, 200)) == {0.0}
    assert (rig.state(), rig.state("near_far")) == (State.READY, State.READY)


def test_anti_sway_on_in_full_slew_does_not_twitch(changed_rig: Make) -> None:
    """What the tip would have done under compensation is not made up for at a stroke."""
    rig = moving_as_one(changed_rig)
    rig.run(3, AntiSwayOff=1)
    rig.run(2000, Slew=1000, AntiSwayOff=1)  # until the swing of the start has died away
    assert max(map(abs, near_far(rig, 5, Slew=1000))) <= 0.02


def test_a_joystick_that_is_not_enabled_is_not_moved_for_slew(changed_rig: Make) -> None:
    rig = by_two_joysticks(changed_rig)
    for enable, state in ((0, State.NEUTRAL_WAIT), (1, State.NEUTRAL_WAIT), (1, State.ACTIVE)):
        lift = 500 if (enable, state) == (1, State.NEUTRAL_WAIT) else 0  # enabled, but held out
        for i in range(120):
            left = rig.joystick("JoystickLeft", Slew=1000 if i > 2 else 0)
            rig.receive(left, rig.joystick("JoystickRight", Enable=enable, Lift=lift))
            sent = rig.tick()
            if state is State.NEUTRAL_WAIT:
                assert sent["NearFarCommand"]["Velocity"] == 0
        assert rig.state() is State.ACTIVE
        assert rig.state("near_far") is state


def test_a_lost_joystick_of_near_far_stops_the_compensation(changed_rig: Make) -> None:
    rig = by_two_joysticks(changed_rig)
    rig.run(3)
    sent = near_far(rig, 40, Slew=1000)
    assert sent[-1] < -0.05
    after = []
    for _ in range(120):
        rig.receive(rig.joystick("JoystickLeft", Slew=1000))
        rig.tick()
        after.append(rig.controller.axes["near_far"].axis.output.setpoint)
    assert rig.state() is State.ACTIVE
    # five ticks of timeout, then at the fall rate to neutral
    assert not any(after[5 + math.ceil(0.25 / 0.1) :])
    assert rig.state("near_far") is State.NEUTRAL_WAIT


def test_a_released_enable_of_slew_alone_ends_it_in_the_same_tick(changed_rig: Make) -> None:
    slow = LIFT_OF_RIGHT | {"fall_per_s: 5": "fall_per_s: 1"}  # by the rate it would take longer
    rig = moving_as_one(changed_rig, yaml=slow)
    rig.run(3)
    assert near_far(rig, 40, Slew=1000)[-1] < -0.05
    for _ in range(20):
        rig.receive(
            rig.joystick("JoystickLeft", Slew=1000, Enable=0), rig.joystick("JoystickRight")
        )
        assert rig.tick()["NearFarCommand"]["Velocity"] == 0
        assert rig.state() is State.TRIPPED
    assert rig.state("near_far") is State.READY


def test_a_released_enable_of_slew_leaves_the_operators_own_part(changed_rig: Make) -> None:
    rig, plain = by_two_joysticks(changed_rig), changed_rig(LIFT_OF_RIGHT)
    for one in (rig, plain):
        for tick in range(60):
            slew = 1000 if tick > 2 and one is rig else 0
            one.receive(one.joystick("JoystickLeft", Slew=slew))
            one.receive(one.joystick("JoystickRight", Lift=400 if tick > 2 else 0))
            one.tick()
    for one in (rig, plain):
        one.receive(one.joystick("JoystickLeft", Enable=0), one.joystick("JoystickRight", Lift=400))
        one.tick()
    sent = [one.controller.axes["near_far"].axis.output.setpoint for one in (rig, plain)]
    assert sent[0] == pytest.approx(sent[1], abs=0.02)
    assert sent[1] > 0.2


def test_a_lost_joystick_of_slew_ends_it_in_the_fade(changed_rig: Make) -> None:
    """The shaped stop of slew goes on; near-far has an operator who did not ask for it."""
    rig = by_two_joysticks(changed_rig)
    rig.run(3)
    assert near_far(rig, 40, Slew=1000)[-1] < -0.05
    after = []
    for _ in range(30):
        rig.receive(rig.joystick("JoystickRight"))
        rig.tick()
        after.append(rig.controller.axes["near_far"].axis.output.setpoint)
    assert rig.state() is State.STOPPING
    assert not any(after[5 + 15 :])
    assert rig.state("near_far") is State.READY


@pytest.mark.parametrize("slew_ticks", [20, 30, 60, 100])
def test_near_far_that_becomes_ready_while_slew_moves_does_not_twitch(
    changed_rig: Make, slew_ticks: int
) -> None:
    """What it has missed of the path is not made up for: it begins with what is still to come."""
    rig, sent = by_two_joysticks(changed_rig), []
    for tick in range(slew_ticks + 150):
        moves = 1000 if 3 <= tick < slew_ticks + 40 else 0
        rig.receive(rig.joystick(Slew=moves))
        if tick >= slew_ticks:
            rig.receive(rig.joystick("JoystickRight"))
        rig.tick()
        sent.append(rig.controller.axes["near_far"].axis.output.setpoint)
    assert not any(sent[: slew_ticks + 1])
    assert max(map(abs, sent)) > 0.03  # it does take part
    begin = sent[slew_ticks : slew_ticks + 12]
    assert max(abs(b - a) for a, b in itertools.pairwise(begin)) < 0.05
    signs = [s > 0 for s in begin if s]
    assert sum(a != b for a, b in itertools.pairwise(signs)) <= 1
