"""A reload carries over states of joysticks, switches and missed deadlines."""

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.shaping.states import State
from tests.controller.reloaded import reload
from tests.rigs.emergency import PRESSED, Machine
from tests.rigs.forwarder import Make, Rig


@pytest.mark.parametrize("pressed", [1, 0])
def test_a_stop_that_is_pressed_is_so_for_a_new_axis_too(changed_rig: Make, pressed: int) -> None:
    """And one that is over is not, though it was pressed in the last tick before."""
    machine = Machine(changed_rig)
    machine.run(3)
    machine.rig.receive(machine.stop(1))
    machine.run(1, pressed)
    del machine.rig.controller.axes["lift"]
    reload(machine.rig)
    if pressed:
        machine.rig.run(1)
        assert machine.states() == PRESSED
    else:
        machine.run(2)
        assert machine.states() == [*PRESSED[:2], (State.READY, "JOYSTICK_NEUTRAL")]


def test_a_joysticks_sequence_goes_on(rig: Rig) -> None:
    """A repetition is no news, and a jump is one."""
    rig.run(3)
    last = rig.joystick()
    rig.receive(last)
    reload(rig)
    rig.receive(last)
    assert rig.controller.counters.last_fault is FrameFault.COUNTER_REPEATED
    rig.counts["JoystickLeft"] += 4
    rig.receive(rig.joystick())
    assert rig.controller.counters.last_fault is FrameFault.COUNTER_JUMP


def test_of_a_bus_that_was_opened_again_any_counter_but_the_last_is_the_next(
    changed_rig: Make,
) -> None:
    rig = changed_rig()
    rig.run(3)
    last = rig.joystick()
    rig.receive(last)
    reload(rig, ("bitrate: 250000", "bitrate: 500000"))
    rig.receive(last)
    assert rig.controller.counters.last_fault is FrameFault.COUNTER_REPEATED
    rig.counts["JoystickLeft"] += 4
    rig.run(1)
    assert rig.state() is State.READY


def test_an_enable_that_is_released_stays_so_until_a_frame_counts(rig: Rig) -> None:
    rig.run(3)
    rig.receive(rig.joystick(Enable=0))
    rig.tick()
    rig.counts["JoystickLeft"] += 9
    doubtful = rig.joystick(Enable=1)
    rig.receive(doubtful)
    reload(rig)
    rig.tick()
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "ENABLE_OFF")
    rig.run(1)
    assert rig.state() is State.READY


def test_late_ticks_before_it_count(rig: Rig) -> None:
    rig.run(3)
    for _ in range(10):
        rig.tick(missed=1)
    reload(rig)
    rig.run(3)
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "LOOP_OVERRUN")
    rig.run(50)
    assert rig.state() is State.READY
