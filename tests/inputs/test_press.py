"""Frames that are no press of reset or enable: no one touched a switch, and a trip must stay."""

import pytest

from canshaper.codec.frame import Frame
from canshaper.shaping.states import State
from tests.rigs.emergency import Machine
from tests.rigs.forwarder import Make, Rig
from tests.rigs.tripped import tripped


def test_a_reset_that_was_pressed_while_another_switch_is_broken(rig: Rig) -> None:
    tripped(rig).run(10, Enable=2, Reset=1)
    rig.run(5, Reset=1)
    assert rig.state() is State.TRIPPED
    rig.run(1)
    rig.run(1, Reset=1)
    assert rig.state() is State.NEUTRAL_WAIT


def test_a_reset_that_was_pressed_in_silence(rig: Rig) -> None:
    tripped(rig)
    for _ in range(20):
        rig.tick()
    rig.run(5, Reset=1)
    assert rig.state() is State.TRIPPED


@pytest.mark.parametrize("then", ["no frame", "its next frame", "frames that go on from it"])
def test_an_enable_that_was_off_in_one_frame_out_of_sequence(rig: Rig, then: str) -> None:
    """A glitch, another sender with the joystick's id, or a sender that starts again."""
    tripped(rig)
    count = rig.counts["JoystickLeft"]
    rig.counts["JoystickLeft"] = (count + 100) % 256
    rig.receive(rig.joystick("JoystickLeft", Enable=0))
    if then == "frames that go on from it":
        rig.receive(*(rig.joystick("JoystickLeft") for _ in range(5)))
    else:
        rig.counts["JoystickLeft"] = count
    if then == "no frame":
        rig.tick()
    rig.run(6)
    assert rig.state() is State.TRIPPED


def test_a_reset_that_is_stuck_and_an_enable_off_next_to_a_broken_joystick(rig: Rig) -> None:
    tripped(rig, Reset=1).run(1, Slew=32766, Enable=0, Reset=1)
    rig.run(2, Enable=0, Reset=1)
    assert rig.state() is State.TRIPPED


def test_an_enable_that_comes_back_with_the_measurement_of_its_joystick_is_one(rig: Rig) -> None:
    """A joystick that has no measurement while it is not enabled."""
    tripped(rig).run(5, Slew=32767, Enable=0)
    assert rig.state() is State.TRIPPED
    rig.run(1)
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "RESET")


def test_a_reset_that_is_held_while_the_loop_is_late(rig: Rig) -> None:
    tripped(rig)
    for _ in range(12):
        rig.receive(rig.joystick("JoystickLeft"), rig.joystick("JoystickRight"))
        rig.tick(1)
    rig.run(80, Reset=1)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SEND_FAILED")
    rig.run(1)
    rig.run(1, Reset=1)
    assert rig.state() is State.NEUTRAL_WAIT


def test_a_reset_that_is_held_while_the_emergency_stop_is_not_received(
    changed_rig: Make,
) -> None:
    machine = Machine(changed_rig)
    rig = tripped(machine)
    for _ in range(10):
        rig.run(1)  # without the emergency stop
    rig.run(5, Reset=1)
    for _ in range(5):
        machine.run(1, Reset=1)
    assert rig.state() is State.TRIPPED
    machine.run(1)
    machine.run(1, Reset=1)
    assert rig.state() is State.NEUTRAL_WAIT


@pytest.mark.parametrize("raw", [{}, {"Slew": 32766}])
def test_what_trips_is_reported_before_a_released_enable(rig: Rig, raw: dict[str, int]) -> None:
    """With a joystick that is broken too."""
    rig.run(3)
    rig.receive(Frame("crane", 0x200, False, bytes(2)))
    rig.run(1, Enable=0, **raw)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SECOND_SENDER")
