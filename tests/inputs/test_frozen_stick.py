"""A joystick that stands still: in neutral for ever, deflected for ``stuck_s`` at most."""

import pytest

from canshaper.inputs.joystick import JoystickInput
from canshaper.shaping.states import Reason, State
from tests.rigs.forwarder import Make, Rig, velocity

LEFT = "    alive_counter: AliveCounter\n  right:"


def test_the_time_is_that_of_the_deployment_to_the_nanosecond(changed_rig: Make) -> None:
    deployment = changed_rig(ONE_SECOND).deployment
    joystick = JoystickInput(deployment.joysticks["left"])
    rig = changed_rig(ONE_SECOND)
    for now_ns, fault in ((0, None), (10**9, None), (10**9 + 1, Reason.JOYSTICK_FROZEN)):
        joystick.receive(rig.joystick(Slew=500).data, now_ns)
        assert joystick.command("Slew", now_ns, 0, None, 0.02)[0].fault is fault


ONE_SECOND = {LEFT: LEFT.replace("\n  right", "\n    stuck_s: 1\n  right")}
SECOND_TICKS = 50


@pytest.mark.parametrize("raw", [1000, -1000, 500, 21])
def test_a_joystick_deflected_without_change_for_longer_than_frozen_s_is_broken(
    changed_rig: Make, raw: int
) -> None:
    rig = changed_rig(ONE_SECOND)
    rig.run(3)
    rig.run(1, Slew=raw)  # here it gets there
    for _ in range(SECOND_TICKS):
        rig.run(1, Slew=raw)
        assert rig.state() is State.ACTIVE
    rig.run(1, Slew=raw)
    assert (rig.state(), rig.reason()) == (State.STOPPING, "JOYSTICK_FROZEN")
    assert rig.count("InvalidSignals") == 0  # every frame of it is a good one


def test_a_frozen_joystick_works_again_once_it_moves_and_was_in_neutral(changed_rig: Make) -> None:
    rig = changed_rig(ONE_SECOND).moving()
    rig.run(200, Slew=1000)
    assert rig.reason() == "JOYSTICK_FROZEN"
    assert velocity(rig.run(20, Slew=900)) == 0
    assert rig.reason() == "JOYSTICK_NOT_NEUTRAL"
    rig.run(1)
    assert rig.state() is State.READY
    assert velocity(rig.run(40, Slew=1000)) > 30


@pytest.mark.parametrize("raw", [0, 20, -20])
def test_a_joystick_in_neutral_may_stand_still_for_ever(changed_rig: Make, raw: int) -> None:
    """neutral_pct is 2 %, 20 raw."""
    rig = changed_rig(ONE_SECOND)
    rig.run(5 * SECOND_TICKS, Slew=raw)
    assert rig.state() is State.READY
    assert velocity(rig.run(40, Slew=1000)) > 30
    rig.run(5 * SECOND_TICKS, Slew=raw)
    assert rig.state() is State.READY


def test_the_least_change_is_a_change(changed_rig: Make) -> None:
    rig = changed_rig(ONE_SECOND)
    rig.run(3)
    for n in range(10):
        rig.run(SECOND_TICKS, Slew=500 + n % 2)
        assert rig.state() is State.ACTIVE


def test_another_joystick_of_the_joystick_is_no_sign_of_life(changed_rig: Make) -> None:
    rig = changed_rig(ONE_SECOND)
    rig.run(3)
    for n in range(2 * SECOND_TICKS):
        rig.run(1, Slew=500, NearFar=300 + n)
    assert (rig.state("slew"), rig.reason("slew")) == (State.STOPPING, "JOYSTICK_FROZEN")
    assert rig.state("near_far") is State.ACTIVE


def test_frames_that_do_not_count_are_no_change(changed_rig: Make) -> None:
    rig = changed_rig(ONE_SECOND)
    rig.run(3)
    rig.run(1, Slew=500)
    for n in range(SECOND_TICKS + 1):
        rig.receive(rig.joystick(Slew=500), rig.joystick("JoystickRight"))
        rig.receive(rig.joystick(Slew=400 + n, AliveCounter=rig.counts["JoystickLeft"]))  # repeated
        rig.counts["JoystickLeft"] -= 1
        rig.tick()
    assert (rig.state(), rig.reason()) == (State.STOPPING, "JOYSTICK_FROZEN")


def test_without_a_word_it_is_twenty_seconds(rig: Rig) -> None:
    rig.run(3)
    rig.run(1 + 20 * SECOND_TICKS, Slew=1000)
    assert rig.state() is State.ACTIVE
    rig.run(1, Slew=1000)
    assert (rig.state(), rig.reason()) == (State.STOPPING, "JOYSTICK_FROZEN")
