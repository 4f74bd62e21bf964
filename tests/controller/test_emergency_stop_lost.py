"""The emergency stop on the bus: lost, never received, and frames that are none."""

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.shaping.states import State
from tests.rigs.emergency import DBC, FRESH_TICKS, READY, STOP, Machine, Make, still


@pytest.fixture
def machine(changed_rig: Make) -> Machine:
    return Machine(changed_rig)


def test_without_a_word_of_it_nothing_begins(machine: Machine) -> None:
    for _ in range(20):
        assert still(machine.rig.run(1))
    assert machine.states() == [(State.NEUTRAL_WAIT, "EMERGENCY_STOP_LOST")] * 3
    for _ in range(20):
        assert still(machine.rig.run(1, Slew=1000))
    machine.run(1, Slew=1000)
    assert machine.rig.reason() == "JOYSTICK_NOT_NEUTRAL"
    machine.run(1)
    assert machine.states() == READY


def test_a_second_sender_is_reported_without_a_word_of_it(machine: Machine) -> None:
    machine.rig.receive(Frame("crane", 0x200, False, bytes(2)))
    machine.rig.run(1)
    assert machine.states()[0] == (State.TRIPPED, "SECOND_SENDER")


def test_lost_in_motion_is_neutral_at_once_after_its_timeout(machine: Machine) -> None:
    machine.moving()
    for _ in range(FRESH_TICKS):
        sent = machine.rig.run(1, Slew=1000, Lift=1000)
        assert sent["SlewCommand"]["Velocity"] > 50
        assert machine.rig.state() is State.ACTIVE
    assert still(machine.rig.run(1, Slew=1000, Lift=1000))
    assert machine.states() == [
        (State.TRIPPED, "EMERGENCY_STOP_LOST"),
        (State.NEUTRAL_WAIT, "EMERGENCY_STOP_LOST"),  # there was nothing to trip
        (State.TRIPPED, "EMERGENCY_STOP_LOST"),
    ]


def test_lost_and_found_is_latched_for_what_moved_only(machine: Machine) -> None:
    machine.moving()
    machine.rig.run(10, Slew=1000, Lift=1000)
    machine.run(20)
    states = [state for state, _ in machine.states()]
    assert states == [State.TRIPPED, State.READY, State.TRIPPED]
    assert still(machine.run(20, Slew=1000, Lift=1000))
    machine.run(2, Enable=0)
    machine.run(2)
    assert machine.states() == READY


def test_a_reset_that_is_held_meanwhile_is_no_press(machine: Machine) -> None:
    """A switch that is stuck must not set anything going by itself."""
    machine.moving()
    machine.run(2, Reset=1, Slew=1000, Lift=1000)
    machine.rig.run(10, Reset=1)
    machine.run(20, Reset=1)
    assert machine.rig.state() is State.TRIPPED
    machine.run(2)
    machine.run(2, Reset=1)
    assert machine.states() == READY


@pytest.mark.parametrize("wrong", ["frozen", "jumps", "length", "checksum", "bus", "extended"])
def test_frames_that_are_wrong_are_none(changed_rig: Make, wrong: str) -> None:
    check = STOP.replace(" }", ", checksum: { signal: Check, kind: sum } }")
    machine = Machine(changed_rig, check).moving()
    rig = machine.rig
    for tick in range(FRESH_TICKS + 1):
        assert rig.state() is State.ACTIVE, tick
        step = {"frozen": 0, "jumps": 50}.get(wrong, 1)
        frame = machine.stop(0, step=step, error=int(wrong == "checksum"))
        if wrong == "length":
            frame = frame._replace(data=frame.data[:2])
        elif wrong == "bus":
            frame = frame._replace(bus="boom")
        elif wrong == "extended":
            frame = frame._replace(extended=True)
        rig.receive(frame)
        rig.run(1, Slew=1000, Lift=1000)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "EMERGENCY_STOP_LOST")
    assert rig.controller.counters.last_fault is {
        "frozen": FrameFault.COUNTER_REPEATED,
        "jumps": FrameFault.COUNTER_JUMP,
        "length": FrameFault.WRONG_LENGTH,
        "checksum": FrameFault.CHECKSUM,
    }.get(wrong, FrameFault.UNKNOWN_ID)


def test_a_stall_invalidates_it(machine: Machine) -> None:
    machine.moving()
    machine.rig.controller.stalled()
    assert still(machine.rig.tick())
    assert machine.rig.reason("slew") == "LOOP_STALLED"
    machine.rig.run(1)
    assert machine.rig.reason("near_far") == "EMERGENCY_STOP_LOST"


def test_a_machine_without_one_does_not_wait_for_it(changed_rig: Make) -> None:
    rig = changed_rig(dbc=DBC)
    rig.run(2)
    assert rig.state() is State.READY
