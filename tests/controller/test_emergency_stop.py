"""The emergency stop on the bus: pressed, in whatever frame, and the way back."""

import pytest

from canshaper.controller.controller import Controller
from canshaper.shaping.states import State
from tests.rigs.emergency import (
    CYCLE,
    DBC,
    FRESH_TICKS,
    PRESSED,
    READY,
    STOP,
    Machine,
    Make,
    still,
)
from tests.rigs.forwarder import SLOW_VALVE


@pytest.fixture
def machine(changed_rig: Make) -> Machine:
    return Machine(changed_rig)


# -- pressed ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("code", [1, 2, 3])
def test_anything_but_free_is_neutral_in_the_same_tick(machine: Machine, code: int) -> None:
    machine.moving()
    sent = machine.run(1, code, Slew=1000, Lift=1000)
    assert still(sent)
    assert machine.states() == PRESSED  # also the axis that stood still
    assert sent["SlewStatus"]["Reason"] == 68


@pytest.mark.parametrize("way", ["reset", "enable"])
def test_the_way_back_is_free_neutral_and_then_a_reset(machine: Machine, way: str) -> None:
    machine.moving()
    machine.run(5, 1)
    off, on = ({}, {"Reset": 1}) if way == "reset" else ({"Enable": 0}, {"Enable": 1})
    # not while it is pressed, and nothing of that is kept for later
    machine.run(2, 1, **off)
    machine.run(2, 1, **on)
    machine.run(2, 0, **on)
    assert machine.states() == PRESSED
    # nor with a joystick that is out
    machine.run(2, **off, Slew=500, Lift=500, NearFar=500)
    machine.run(2, **on, Slew=500, Lift=500, NearFar=500)
    assert machine.states() == PRESSED
    machine.run(2, **off)
    machine.run(2, **on)
    assert machine.states() == READY


def test_a_machine_that_starts_with_it_pressed_is_tripped(machine: Machine) -> None:
    assert still(machine.run(1, 1))
    assert machine.states() == PRESSED
    assert still(machine.run(20))
    assert machine.states() == PRESSED
    machine.run(1, Reset=1)
    machine.run(1)
    assert machine.states() == READY


@pytest.mark.parametrize("raw", [{"Slew": 32766, "Lift": 32766}, {"Enable": 3}, {}])
def test_a_shaped_stop_becomes_neutral_at_once(machine: Machine, raw: dict[str, int]) -> None:
    """Whatever else is wrong: no joystick at all, an error code, an invalid switch."""
    machine.moving()
    for _ in range(2 if raw else 7):
        machine.rig.receive(machine.stop(0))
        if raw:
            machine.rig.receive(machine.rig.joystick("JoystickLeft", **{"Slew": 1000, **raw}))
        sent = machine.rig.tick()
    assert machine.rig.state() is State.STOPPING
    assert sent["SlewCommand"]["Velocity"] > 0
    machine.rig.receive(machine.stop(1))
    assert still(machine.rig.tick())
    assert machine.states() == PRESSED


# -- a stop needs no trust -------------------------------------------------------------------------


@pytest.mark.parametrize("code", [1, 2, 3])
@pytest.mark.parametrize("wrong", ["repeated", "jump", "not qualified"])
def test_a_pressed_stop_counts_in_any_frame_with_a_right_checksum(
    changed_rig: Make, wrong: str, code: int
) -> None:
    more = ", qualify: 5, checksum: { signal: Check, kind: sum } }"
    machine = Machine(changed_rig, STOP.replace(" }", more))
    machine.run(4)
    machine.moving()
    if wrong == "not qualified":
        machine.rig.receive(machine.stop(0, step=50))
    step = {"repeated": 0, "jump": 50}.get(wrong, 1)
    machine.rig.receive(machine.stop(code, step=step))
    assert still(machine.rig.run(1, Slew=1000, Lift=1000))
    assert machine.states() == PRESSED


def test_a_wrong_checksum_presses_nothing(changed_rig: Make) -> None:
    """It is lost soon enough."""
    machine = Machine(changed_rig, STOP.replace(" }", ", checksum: { signal: Check, kind: sum } }"))
    machine.moving()
    machine.rig.receive(machine.stop(1, error=1), machine.stop(0))
    machine.rig.run(1, Slew=1000, Lift=1000)
    assert machine.rig.state() is State.ACTIVE


def test_a_free_stop_out_of_sequence_frees_nothing(machine: Machine) -> None:
    machine.moving()
    machine.run(5, 1)
    for _ in range(FRESH_TICKS):
        machine.rig.receive(machine.stop(0, step=50))
        machine.rig.run(1, Reset=1)
        machine.rig.receive(machine.stop(0, step=0))
        machine.rig.run(1)
        assert machine.states() == PRESSED


@pytest.mark.parametrize("slow", [{}, SLOW_VALVE])
def test_a_short_press_is_one_for_every_axis(changed_rig: Make, slow: dict[str, str]) -> None:
    """Pressed and free again before the next tick, or before the next frame of a slow valve."""
    machine = Machine(changed_rig, dbc=slow)
    machine.run(30)
    machine.run(61, Slew=1000, Lift=1000)
    assert machine.rig.state() is State.ACTIVE
    machine.rig.receive(machine.stop(1))
    machine.run(10, Slew=1000, Lift=1000)
    assert machine.states() == PRESSED


@pytest.mark.parametrize("code", [1, 2, 3])
@pytest.mark.parametrize("step", [1, 0])
def test_it_is_pressed_between_its_frames_too(changed_rig: Make, code: int, step: int) -> None:
    """A stop that sends every 200 ms, with a running counter or a frozen one.

    There is no reset in one of the ticks without a frame.
    """
    slow = STOP.replace("timeout_ms: 60", "timeout_ms: 400")
    machine = Machine(changed_rig, slow, dbc={CYCLE: DBC[CYCLE].replace("64 20", "64 200")})
    machine.moving()
    for tick in range(100):
        if tick % 10 == 0:
            machine.rig.receive(machine.stop(code, step=step))
        machine.rig.run(1, Reset=tick // 2 % 2)
        assert machine.states() == PRESSED
    machine.rig.receive(machine.stop(0))
    machine.rig.run(2)
    machine.rig.run(2, Reset=1)
    assert machine.states() == READY


def test_a_short_press_just_before_a_reload_is_one_behind_it(machine: Machine) -> None:
    """Pressed and free again, and no tick of the controller before has seen it."""
    rig = machine.rig
    machine.run(3)
    rig.receive(machine.stop(1))
    rig.receive(machine.stop(0))
    before, rig.controller = rig.controller, Controller(rig.deployment)
    rig.controller.carry_over(before)
    machine.run(3)
    assert machine.states() == PRESSED
