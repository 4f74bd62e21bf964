"""Machines made wrong as a stranger would: each is refused, or warned of, in one line."""

from typing import Any

import pytest

from tests.machine import traps_of_machines, traps_of_signals
from tests.machine.trap import Trap, made, said
from tests.rigs.files import Machine

TRAPS = [*traps_of_signals.TRAPS, *traps_of_machines.TRAPS]


def test_there_are_many_and_each_is_another() -> None:
    assert len({trap.name for trap in TRAPS}) == len(TRAPS) >= 120


@pytest.mark.parametrize("trap", TRAPS, ids=[trap.name for trap in TRAPS])
def test_a_trap_is_named_in_one_line(machine: Machine, trap: Trap) -> None:
    problems, warnings = said(made(trap, machine))
    lines = [one for one in (warnings if trap.warns else problems) if trap.words in one]
    assert len(lines) == 1, problems + warnings
    place = lines[0].removeprefix(f"{machine.directory}/").split(":")
    assert place[0] in ("machine.yaml", "machine.dbc")
    assert place[1].isdigit(), "it has a line"
    assert not (trap.warns and problems)


@pytest.mark.parametrize(
    ("make", "zero", "one"),
    [
        *(
            (traps_of_signals.table, zero, one)
            for zero, one in (
                ("Released", "Pressed"),
                ("Inactive", "Active"),
                ("Not pressed", "Pressed"),
                ("Disabled", "Enabled"),
                ("Open", "Closed"),
                ("losgelassen", "gedrückt"),
            )
        ),
        *(
            (traps_of_signals.stop, zero, one)
            for zero, one in (
                ("Released", "Pressed"),
                ("No stop", "Stop"),
                ("Emergency stop not active", "Emergency stop active"),
                ("OK", "Not OK"),
                ("Closed", "Open"),
            )
        ),
    ],
)
def test_a_table_that_agrees_passes(machine: Machine, make: Any, zero: str, one: str) -> None:
    trap = make(f"{zero}/{one}", "") if make is traps_of_signals.table else make(zero, one)
    assert said(made(trap, machine)) == ([], [])


@pytest.mark.parametrize(
    ("signal", "zero", "one"), [("Reset", "Idle", "Reset"), ("AntiSwayOff", "Normal", "Bypass")]
)
def test_a_button_that_moves_nothing_may_have_any_name(
    machine: Machine, signal: str, zero: str, one: str
) -> None:
    trap = traps_of_signals.table(f"{zero}/{one}", "", signal=signal)
    assert said(made(trap, machine)) == ([], [])


def test_a_switch_whose_code_is_written_may_have_any_names(machine: Machine) -> None:
    made(traps_of_signals.seat("Occupied", "Empty"), machine)
    machine.in_yaml("signal: Stop, ", "signal: Stop, code: 0, ")
    assert said(machine) == ([], [])


def test_a_number_in_a_name_is_no_sense(machine: Machine) -> None:
    machine.in_yaml("enable: Enable", "enable: SwitchNo1")
    machine.in_dbc("SG_ Enable", "SG_ SwitchNo1")
    machine.in_dbc(traps_of_signals.ENABLE, "")
    assert said(machine) == ([], [])
