"""Machines made wrong as a stranger would: each is refused, or warned of, in one line."""

import pytest

from tests.machine import traps_of_machines, traps_of_signals
from tests.machine.trap import Trap, made, said
from tests.rigs.files import Machine

TRAPS = [*traps_of_signals.TRAPS, *traps_of_machines.TRAPS]
MEANT = [trap for trap in TRAPS if trap.warns]


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
