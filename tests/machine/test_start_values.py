"""Signals of a valve message that no axis uses: every frame carries their start value."""

import pytest

from tests.rigs.files import Machine

CARRIED = "it and every frame of SlewCommand carries it; got"


def add(machine: Machine, signal: str, start: int | None = None, name: str = "") -> None:
    """Give the message of the slew valve a signal Rotate in a byte of its own."""
    machine.in_dbc("BO_ 512 SlewCommand: 2 SHAPER", "BO_ 512 SlewCommand: 3 SHAPER")
    line = ' SG_ AliveCounter : 8|8@1+ (1,0) [0|255] "" VALVES\n\nBO_ 513'
    machine.in_dbc(line, line.replace("\n\n", f"\n SG_ Rotate : 16|8{signal} VALVES\n\n"))
    if start is not None:
        machine.dbc += f'BA_ "GenSigStartValue" SG_ 512 Rotate {start};\n'
    if name:
        machine.dbc += f'VAL_ 512 Rotate {start or 0} "{name}" ;\n'


@pytest.mark.parametrize(
    ("signal", "start", "rest", "got"),
    [
        ('@1+ (1,-100) [-100|100] "%"', None, "100", "0, -100 %"),
        ('@1+ (1,-100) [-100|100] "%"', 99, "100", "99, -1 %"),
        ('@1- (0.8,0) [-100|100] "%"', 125, "0", "125, 100 %"),
        ('@1+ (1,-100) [0|0] ""', 101, "100", "101, 1"),
    ],
)
def test_a_command_that_does_not_rest_is_refused(
    machine: Machine, signal: str, start: int | None, rest: str, got: str
) -> None:
    add(machine, signal, start)
    (problem,) = machine.problems()
    expected = f"expected {rest}, rest, or a value that VAL_ names: no axis uses {CARRIED} {got}"
    assert problem.endswith(f": SlewCommand: Rotate: GenSigStartValue: {expected}")


@pytest.mark.parametrize(
    ("signal", "start", "name", "value"),
    [
        ('@1+ (1,-100) [-100|100] "%"', 100, "", 0.0),
        ('@1- (1,0) [-128|127] ""', 1, "Set point over CAN", 1.0),  # a mode, and it says so
        ('@1+ (1,0) [0|255] ""', 3, "", 3.0),  # no command: it has one sign
    ],
)
def test_what_rests_or_is_no_command_is_shown(
    machine: Machine, signal: str, start: int, name: str, value: float
) -> None:
    add(machine, signal, start, name)
    (carried,) = machine.load().starts
    assert (carried.message, carried.signal, carried.value) == ("SlewCommand", "Rotate", value)


def test_next_to_another_problem_nothing_is_said_of_it(machine: Machine) -> None:
    """The signal of an axis that could not be bound would look as if no axis used it."""
    add(machine, '@1+ (1,-100) [-100|100] "%"')
    machine.in_yaml("timeout_ms: 100 #", "timeout_ms: 1 #")
    assert not any("Rotate" in problem for problem in machine.problems())
