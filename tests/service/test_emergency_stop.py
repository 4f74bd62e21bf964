"""The emergency stop on the bus: pressed, lost, never heard of, and the way back."""

from collections.abc import Callable
from typing import Any, Protocol

import pytest

from canshaper.can.frame import Frame, FrameFault
from canshaper.service.controller import Controller
from canshaper.shaping.states import State

VALVES = ("SlewCommand", "NearFarCommand", "LiftCommand")
AXES = ("slew", "near_far", "lift")
STOP_ID = 0x40
# timeout_ms, 60 ms: the last frame counts in so many ticks after its own.
FRESH_TICKS = 3
LAST = "status: { bus: crane, message: ShaperStatus }"
STOP = (
    "emergency_stop: { bus: crane, message: Stop, signal: Pressed, timeout_ms: 60,"
    " alive_counter: Count }\n"
)
CYCLE = 'BA_ "GenMsgCycleTime" BO_ 272 20;\n'
DBC = {
    "BO_ 512 SlewCommand": (
        "BO_ 64 Stop: 3 LEVERS\n"
        ' SG_ Pressed : 0|2@1+ (1,0) [0|3] "" SHAPER\n'
        ' SG_ Count : 8|8@1+ (1,0) [0|255] "" SHAPER\n'
        ' SG_ Check : 16|8@1+ (1,0) [0|255] "" SHAPER\n'
        "\nBO_ 512 SlewCommand"
    ),
    CYCLE: CYCLE + CYCLE.replace("272", "64"),
}


class Rig(Protocol):
    controller: Controller
    now_ns: int

    def lever(self, name: str = ..., **raw: int) -> Frame: ...
    def receive(self, *frames: Frame) -> None: ...
    def tick(self, missed: int = ...) -> dict[str, dict[str, Any]]: ...
    def run(self, ticks: int = ..., **raw: int) -> dict[str, dict[str, Any]]: ...
    def state(self, axis: str = ...) -> State: ...
    def reason(self, axis: str = ...) -> str: ...
    def count(self, name: str) -> int: ...


Make = Callable[..., Rig]


class Machine:
    """A rig with an emergency stop that sends every tick."""

    def __init__(self, make: Make, stop: str = STOP, **more: dict[str, str]) -> None:
        yaml = {LAST: stop + LAST, **more.get("yaml", {})}
        self.rig = make(yaml, {**DBC, **more.get("dbc", {})})
        self._count = 0

    def stop(self, pressed: int, *, step: int = 1, error: int = 0) -> Frame:
        """The next frame of the stop, with the sum of its bytes."""
        self._count = (self._count + step) % 256
        check = (pressed + self._count + error) % 256
        return Frame("crane", STOP_ID, False, bytes([pressed, self._count, check]))

    def run(self, ticks: int = 1, pressed: int = 0, **raw: int) -> dict[str, dict[str, Any]]:
        sent: dict[str, dict[str, Any]] = {}
        for _ in range(ticks):
            self.rig.receive(self.stop(pressed))
            sent = self.rig.run(1, **raw)
        return sent

    def moving(self, **raw: int) -> "Machine":
        """Slew in full motion, lift too; the near-far axis is ready."""
        self.run(3, **raw)
        sent = self.run(50, Slew=1000, Lift=1000, **raw)
        assert sent["SlewCommand"]["Velocity"] > 50
        assert sent["LiftCommand"]["Velocity"] > 50
        return self

    def states(self) -> list[tuple[State, str]]:
        return [(self.rig.state(axis), self.rig.reason(axis)) for axis in AXES]


def still(sent: dict[str, dict[str, Any]]) -> bool:
    return all(sent[v]["Velocity"] == 0 for v in VALVES)


@pytest.fixture
def machine(changed_rig: Make) -> Machine:
    return Machine(changed_rig)


PRESSED = [(State.TRIPPED, "EMERGENCY_STOP")] * 3
READY = [(State.READY, "STICK_NEUTRAL")] * 3


# -- pressed ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("code", [1, 2, 3])
def test_anything_but_free_is_neutral_in_the_same_tick(machine: Machine, code: int) -> None:
    machine.moving()
    sent = machine.run(1, code, Slew=1000, Lift=1000)
    assert still(sent)
    assert machine.states() == PRESSED  # also the axis that stood still
    assert sent["SlewStatus"]["Reason"] == 68


def test_it_is_latched(machine: Machine) -> None:
    machine.moving()
    machine.run(1, 1, Slew=1000, Lift=1000)
    for _ in range(100):
        assert still(machine.run(1, Slew=1000, Lift=1000))
    for _ in range(100):
        assert still(machine.run(1))
    assert machine.states() == PRESSED


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
    # nor with a stick that is out
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
    """Whatever else is wrong: no lever at all, an error code, an invalid switch."""
    machine.moving()
    for _ in range(2 if raw else 7):
        machine.rig.receive(machine.stop(0))
        if raw:
            machine.rig.receive(machine.rig.lever("LeverLeft", **{"Slew": 1000, **raw}))
        sent = machine.rig.tick()
    assert machine.rig.state() is State.STOPPING
    assert sent["SlewCommand"]["Velocity"] > 0
    machine.rig.receive(machine.stop(1))
    assert still(machine.rig.tick())
    assert machine.states() == PRESSED


def test_bypass_does_not_pass_it_by(machine: Machine) -> None:
    machine.moving(AntiSwayOff=1)
    assert machine.rig.state() is State.BYPASS_ON
    assert still(machine.run(1, 1, Slew=1000, Lift=1000, AntiSwayOff=1))
    assert machine.states() == PRESSED


def test_an_axis_that_compensates_for_another_stops_too(changed_rig: Make) -> None:
    radial = "radial_compensation: { axis: near_far, full_speed_rad_s: 0.5, radius_m: 3.0 }"
    slew = "    valve: { bus: crane, message: SlewCommand"
    machine = Machine(changed_rig, yaml={slew: f"    {radial}\n{slew}"})
    machine.moving()
    moved = False
    for _ in range(100):
        moved |= machine.run(1, Slew=1000)["NearFarCommand"]["Velocity"] != 0
    assert moved
    assert machine.rig.reason("near_far") == "COMPENSATING"
    for _ in range(20):
        assert still(machine.run(1, 1, Slew=1000))
    assert machine.states() == PRESSED


# -- lost ------------------------------------------------------------------------------------------


def test_without_a_word_of_it_nothing_begins(machine: Machine) -> None:
    for _ in range(20):
        assert still(machine.rig.run(1))
    assert machine.states() == [(State.NEUTRAL_WAIT, "EMERGENCY_STOP_LOST")] * 3
    for _ in range(20):
        assert still(machine.rig.run(1, Slew=1000))
    machine.run(1, Slew=1000)
    assert machine.rig.reason() == "STICK_NOT_NEUTRAL"
    machine.run(1)
    assert machine.states() == READY


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


def test_a_reset_counts_only_once_it_is_back(machine: Machine) -> None:
    machine.moving()
    machine.rig.run(10)
    machine.rig.run(2, Reset=1)
    machine.rig.run(2)
    machine.run(2)
    assert machine.rig.state() is State.TRIPPED
    machine.run(1, Reset=1)
    machine.run(1)
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


def test_a_stall_forgets_it(machine: Machine) -> None:
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
