"""Messages of DBC files that cannot do what a deployment asks of them."""

import pytest

from canshaper.codec.frame import FrameFault
from tests.rigs.files import Machine

SLEW_JOYSTICK = "Slew : 0|16@1- (0.1,0) [-100|100]"
SLEW_VALVE = "Velocity : 0|8@1- (0.8,0) [-100|100]"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            [("JoystickLeft: 8", "JoystickLeft: 9")],
            "joysticks.left.message: JoystickLeft: expected a message of classical CAN, 8 bytes at"
            " most, got 9 bytes: bus crane has no fd: true",
        ),
        (
            [("SlewCommand: 2", "SlewCommand: 12")],
            "axes.slew.valve.message: SlewCommand: expected a message of classical CAN, 8 bytes at"
            " most, got 12 bytes: bus crane has no fd: true",
        ),
        (
            [("Slew : 0|16", "Slew m0 : 0|16"), ("Enable : 32", "Enable M : 32")],
            "joysticks.left.message: JoystickLeft is multiplexed; without multiplexor"
            " nothing can be taken from it",
        ),
        (
            [("Velocity : 0|8", "Velocity m0 : 0|8"), ("Counter : 8|8", "Counter M : 8|8")],
            "axes.slew.valve.message: SlewCommand is multiplexed; without multiplexor"
            " nothing can be sent in it",
        ),
    ],
)
def test_messages_of_another_kind(
    machine: Machine, changes: list[tuple[str, str]], says: str
) -> None:
    for old, new in changes:
        machine.in_dbc(old, new)
    (problem,) = machine.problems()
    assert problem.startswith("machine.yaml:")
    assert problem.endswith(says)


@pytest.mark.parametrize(
    ("old", "new", "of", "says"),
    [
        (
            "Slew : 0|16",
            "Slew : -1|16",
            "JoystickLeft",
            "Slew: expected a start bit of 0 or more, got -1",
        ),
        # full scale
        (
            SLEW_JOYSTICK,
            "Slew : 0|16@1+ (0.1,0) [-100|100]",
            "JoystickLeft",
            "Slew cannot reach its",
        ),
        (
            SLEW_JOYSTICK,
            "Slew : 0|16@1- (0,0) [-100|100]",
            "JoystickLeft",
            "Slew: expected a scale other than 0, got 0",
        ),
        (
            SLEW_VALVE,
            "Velocity : 0|8@1- (0.4,0) [-100|100]",
            "SlewCommand",
            "Velocity cannot reach its range [-100|100] with 8 bits at 0.4 per bit",
        ),
        (SLEW_VALVE, "Velocity : 0|8@1- (11,0) [-100|100]", "SlewCommand", "fewer than 10 steps"),
        # cycle times
        ("BO_ 272 20;", "BO_ 272 0;", "JoystickLeft", "has no GenMsgCycleTime"),
        (
            "BO_ 512 20;",
            "BO_ 512 0;",
            "SlewCommand",
            "GenMsgCycleTime: expected a multiple of tick_ms, 20 ms, got none",
        ),
        (
            "BO_ 512 20;",
            "BO_ 512 50;",
            "SlewCommand",
            "GenMsgCycleTime: expected a multiple of tick_ms, 20 ms, got 50 ms",
        ),
        (
            "BO_ 512 20;",
            "BO_ 512 220;",
            "SlewCommand",
            "GenMsgCycleTime: expected up to 200 ms for a valve, got 220 ms",
        ),
        ("BO_ 784 500;", "BO_ 784 0;", "ShaperStatus", "a multiple of tick_ms, 20 ms, got none"),
        ("BO_ 768 100;", "BO_ 768 110;", "SlewStatus", "a multiple of tick_ms, 20 ms, got 110 ms"),
        # status
        ("State : 0|4@1+", "State : 0|2@1+", "SlewStatus", "State cannot carry 5 with 2 bits"),
        (
            "LastFault : 0|8",
            "LastFault : 0|2",
            "ShaperStatus",
            f"cannot carry {max(FrameFault)}",
        ),
    ],
)
def test_what_a_message_of_the_dbc_cannot_do(
    machine: Machine, old: str, new: str, of: str, says: str
) -> None:
    machine.in_dbc(old, new)
    start = next(
        i for i, row in enumerate(machine.dbc.splitlines(), 1) if row[:3] == "BO_" and of in row
    )
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.dbc:{start}: {of}: ")
    assert says in problem


def test_a_valve_may_have_the_slowest_cycle(machine: Machine) -> None:
    machine.in_dbc("BO_ 512 20;", "BO_ 512 200;")
    machine.in_yaml("signal: Velocity, timeout_ms: 200", "signal: Velocity, timeout_ms: 600")
    assert machine.load().axes["slew"].period_ticks == 10


@pytest.mark.parametrize("numbers", ["(1e-300,0)", "(1e-300,1e300)"])
def test_a_float_without_bounds_is_no_command(machine: Machine, numbers: str) -> None:
    """Neither its number of steps nor its zero is one."""
    machine.in_dbc(SLEW_VALVE, f"Velocity : 0|32@1- {numbers} [-1e300|1e300]")
    machine.in_dbc("BO_ 512 SlewCommand: 2", "BO_ 512 SlewCommand: 5")
    machine.in_dbc("AliveCounter : 8|8@1+", "AliveCounter : 32|8@1+")
    machine.dbc += "\nSIG_VALTYPE_ 512 Velocity : 1;\n"
    (problem,) = machine.problems()
    assert problem.endswith("Velocity: expected an integer signal, got a float")


def test_a_range_that_fits_no_direction_either_is_reported_alone(machine: Machine) -> None:
    machine.in_dbc(SLEW_VALVE, "Velocity : 0|8@1- (0.8,0) [-100|98]")
    (problem,) = machine.problems()
    assert problem.endswith("Velocity: expected a symmetrical range, got [-100|98]")


def test_a_range_at_the_last_bit_is_reached_in_spite_of_rounding(machine: Machine) -> None:
    # 88.9 / 0.7 is a little more than 127 in floating point
    machine.in_dbc(SLEW_VALVE, "Velocity : 0|8@1- (0.7,0) [-88.9|88.9]")
    assert machine.load().axes["slew"].valve.steps == 127


@pytest.mark.parametrize(
    ("changes", "type_of", "says"),
    [
        (
            [("SlewCommand: 2", "SlewCommand: 8"), ("0|8@1- (0.8", "32|32@1- (0.8")],
            "512 Velocity",
            "axes.slew.valve.signal: Velocity: expected an integer signal, got a float",
        ),
    ],
)
def test_floats_where_whole_numbers_are_needed(
    machine: Machine, changes: list[tuple[str, str]], type_of: str, says: str
) -> None:
    for old, new in changes:
        at = machine.dbc.index(f"BO_ {type_of.split(maxsplit=1)[0]} ")
        machine.dbc = machine.dbc[:at] + machine.dbc[at:].replace(old, new, 1)
    machine.dbc += f"SIG_VALTYPE_ {type_of} : 1;\n"
    assert any(says in p for p in machine.problems())
