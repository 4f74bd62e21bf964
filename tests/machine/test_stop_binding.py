"""The emergency stop of a deployment: each problem with file and line."""

import pytest

from canshaper.checksums.kinds import Checksum
from canshaper.codec.message import Protection
from canshaper.controller.controller import Controller
from tests.rigs.files import Machine

STOP_DBC = """BO_ 64 Stop: 8 JOYSTICKS
 SG_ Pressed : 0|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Count : 8|4@1+ (1,0) [0|15] "" SHAPER
 SG_ Check : 16|8@1+ (1,0) [0|255] "" SHAPER
 SG_ Force : 32|32@1- (1,0) [0|1] "" SHAPER

"""
STOP = "emergency_stop: { bus: crane, message: Stop, signal: Pressed, timeout_ms: 100"


@pytest.fixture
def stoppable(machine: Machine) -> Machine:
    """The shipped machine with the message of an emergency stop, not yet named."""
    machine.in_dbc("BO_ 512 SlewCommand", STOP_DBC + "BO_ 512 SlewCommand")
    cycle = 'BA_ "GenMsgCycleTime" BO_ 272 20;\n'
    machine.in_dbc(cycle, cycle + cycle.replace("272", "64"))
    machine.in_dbc("VAL_ 272 Slew 32766", "SIG_VALTYPE_ 64 Force : 1;\nVAL_ 272 Slew 32766")
    return machine


def stop(machine: Machine, text: str) -> int:
    """Name the emergency stop; its line."""
    last = "status: { bus: crane, message: ShaperStatus }"
    return machine.in_yaml(last, f"{text}\n{last}")


def test_a_machine_without_emergency_stop(machine: Machine) -> None:
    assert machine.load().emergency_stop is None


def test_an_emergency_stop(stoppable: Machine) -> None:
    stop(
        stoppable,
        f"{STOP}, alive_counter: Count, alive_max_step: 8, qualify: 3,"
        " checksum: { signal: Check, kind: crc8_autosar } }",
    )
    deployment = stoppable.load()
    bound = deployment.emergency_stop
    assert bound is not None
    assert bound.key == ("crane", 0x40, False)
    assert bound.protection == Protection("Count", 16, Checksum("crc8_autosar", 2))
    assert (0x40, False) in deployment.routing.buses["crane"].received
    Controller(deployment)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            STOP.replace("Stop", "Halt"),
            "emergency_stop.message: expected a message of the DBC files, got 'Halt'",
        ),
        (
            STOP.replace("Pressed", "Force"),
            "emergency_stop.signal: Force: expected an integer signal, got a float",
        ),
        (
            STOP.replace("100", "39"),
            "emergency_stop.timeout_ms: expected 40 ms or more, twice the cycle of Stop, got 39",
        ),
        (
            f"{STOP}, alive_counter: Pressed, alive_max_step: 2",
            "emergency_stop.alive_counter: expected a free signal, got 'Pressed', which is signal"
            " already",
        ),
        (
            f"{STOP}, alive_counter: Force",
            "emergency_stop.alive_counter: Force: expected an unsigned integer signal, got a float",
        ),
        (
            STOP.replace("Stop", "JoystickLeft").replace("Pressed", "Reset"),
            "emergency_stop.message: JoystickLeft has the id 0x110 on bus crane, which is used"
            " already by joysticks.left",
        ),
    ],
)
def test_what_an_emergency_stop_may_not_say(stoppable: Machine, text: str, says: str) -> None:
    line = stop(stoppable, text + " }")
    stoppable.in_dbc("(0.8,0)", "(1,0)")
    (problem,) = stoppable.problems()
    assert problem.startswith(f"machine.yaml:{line}: {says}")


def test_an_emergency_stop_without_a_cycle_is_a_problem_of_the_dbc(stoppable: Machine) -> None:
    stoppable.in_dbc('BA_ "GenMsgCycleTime" BO_ 64 20;\n', "")
    line = stoppable.in_dbc("BO_ 64 Stop", "BO_ 64 Stop")
    stop(stoppable, STOP + " }")
    assert stoppable.problems() == [
        f"machine.dbc:{line}: Stop: has no GenMsgCycleTime; cycle_ms may say it"
    ]


def test_problems_of_joysticks_and_stop_are_reported_together(stoppable: Machine) -> None:
    stoppable.in_yaml("enable: Enable", "enable: On")
    stop(stoppable, STOP.replace("Pressed", "Button").replace("100", "20") + " }")
    places = [p.split(": ")[1] for p in stoppable.problems()]
    assert places == ["joysticks.left.enable", "emergency_stop.timeout_ms", "emergency_stop.signal"]
