"""Values that the DBC names are no velocity, whatever their names are, unless the file says so."""

import json

import pytest

from canshaper.shaping.states import Reason, State
from tests.controller.cab import Cab
from tests.rigs.files import Machine

COMMAND = "command: { joystick: left, signal: Slew,"
NAMES = ["Error", "Open circuit", "Fehler", "Short circuit", "Sensor break", "Virhe", "Bad"]


def eight_bits(machine: Machine, *codes: tuple[int, str]) -> None:
    """The joystick of slew has a signed byte, with these named values."""
    machine.in_dbc('Slew : 0|16@1- (0.1,0) [-100|100] "%"', 'Slew : 0|8@1- (1,0) [-128|127] "%"')
    table = " ".join(f'{code} "{name}"' for code, name in codes)
    machine.in_dbc('272 Slew 32766 "Error" 32767 "NotAvailable"', f"272 Slew {table}")


def listed(machine: Machine, **codes: str) -> None:
    """Codes that the deployment file lists."""
    keys = ", ".join(f"{json.dumps(name)}: {meaning}" for name, meaning in codes.items())
    machine.in_yaml(COMMAND, f"{COMMAND} codes: {{ {keys} }},")


def driven(machine: Machine, byte: int) -> Cab:
    """A cab in which the joystick was in neutral, and then sends a byte for a second."""
    cab = Cab(machine)
    cab.drive(400)
    cab.change = lambda f: f._replace(data=bytes((byte, *f.data[1:]))) if f.can_id == 272 else f
    cab.drive(1000)
    return cab


@pytest.mark.parametrize("name", NAMES)
def test_a_broken_wire_moves_nothing(machine: Machine, name: str) -> None:
    eight_bits(machine, (-128, name))
    if name != "Error":
        listed(machine, **{name: "fault"})
    cab = driven(machine, 0x80)
    assert cab.slew == (State.NEUTRAL_WAIT, Reason.JOYSTICK_ERROR)
    assert not cab.moves


@pytest.mark.parametrize("name", NAMES[1:])
def test_a_name_that_may_be_a_fault_has_to_be_listed(machine: Machine, name: str) -> None:
    eight_bits(machine, (-128, name))
    (problem,) = machine.problems()
    assert problem == (
        "machine.dbc:14: JoystickLeft: Slew: expected axes.slew.command.codes to say whether -128"
        f' "{name}" is a value (moves slew at -100 %) or a fault, got neither; write codes:'
        f' {{ "{name}": fault }}'
    )


def test_a_listed_value_moves(machine: Machine) -> None:
    eight_bits(machine, (127, "Full"), (-128, "Open circuit"))
    listed(machine, **{"Full": "value", "Open circuit": "fault"})
    assert driven(machine, 0x7F).slew == (State.ACTIVE, Reason.JOYSTICK_MOVED)


def test_a_value_that_is_no_longer_listed_as_one_is_none(machine: Machine) -> None:
    eight_bits(machine, (127, "Full"))
    listed(machine, Full="fault")
    assert driven(machine, 0x7F).slew == (State.NEUTRAL_WAIT, Reason.JOYSTICK_ERROR)


def test_neutral_needs_no_entry(machine: Machine) -> None:
    eight_bits(machine, (0, "Neutral"))
    cab = driven(machine, 0x40)
    assert cab.slew == (State.ACTIVE, Reason.JOYSTICK_MOVED)


@pytest.mark.parametrize(("code", "name"), [(1, "Neutral"), (0, "Open circuit"), (0, "Neutrally")])
def test_what_is_not_surely_neutral_needs_one(machine: Machine, code: int, name: str) -> None:
    eight_bits(machine, (code, name))
    (problem,) = machine.problems()
    assert f'{code} "{name}" is a value' in problem


def test_a_broken_wire_at_zero_is_not_neutral(machine: Machine) -> None:
    eight_bits(machine, (0, "Open circuit"))
    listed(machine, **{"Open circuit": "fault"})
    cab = driven(machine, 0)
    assert cab.slew == (State.NEUTRAL_WAIT, Reason.JOYSTICK_ERROR)
    cab.change = lambda f: f._replace(data=bytes((64, *f.data[1:]))) if f.can_id == 272 else f
    cab.drive(1000)
    assert not cab.moves
