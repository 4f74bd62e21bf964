"""Joysticks of a deployment: what is bound, and each problem with its whole place."""

import pytest

from canshaper.codec.layout import Chosen
from tests.rigs.files import Machine

SIGNED = 'Slew : 0|16@1- (0.1,0) [-100|100] "%" SHAPER'
ROCKER = """Slew : 0|8@1+ (0.5,0) [0|100] "%" SHAPER
 SG_ Back : 8|8@1+ (0.5,0) [0|100] "%" SHAPER"""
SLEW = "joystick: left, signal: Slew,"


def rocker(machine: Machine, *, signal: str = "Slew", negative: str = "Back") -> int:
    """Give slew a rocker with a signal for each direction; the line of its command."""
    machine.in_dbc(SIGNED, ROCKER)
    return machine.in_yaml(SLEW, f"joystick: left, signal: {signal}, negative: {negative},")


def test_the_node_of_a_joystick_is_one_of_its_bus(machine: Machine) -> None:
    line = machine.in_yaml("enable: Enable", "node: tool\n    enable: Enable")
    assert machine.problems() == [
        f"machine.yaml:{line}: joysticks.left.node: expected a node of bus crane, got 'tool';"
        " there are none"
    ]


def test_a_multiplexed_joystick_is_read_from_the_chosen_frames(machine: Machine) -> None:
    machine.in_dbc(
        " SG_ Slew : 0|16", ' SG_ Page M : 40|4@1+ (1,0) [0|15] "" SHAPER\n SG_ Slew m3 : 0|16'
    )
    machine.in_yaml("message: JoystickLeft", "message: JoystickLeft\n    multiplexor: 3")
    joystick = machine.load().joysticks["left"]
    assert joystick.chosen == Chosen("Page", 3, False)
    meant, other = (joystick.decode(bytes([*bytes(5), page, 0, 0]))[1] for page in (3, 2))
    assert (meant, other) == ({"Slew": 0.0, "NearFar": 0.0}, {})


def test_a_range_that_fits_no_flags_either_is_reported_alone(machine: Machine) -> None:
    line = machine.in_dbc("BO_ 272 JoystickLeft", "BO_ 272 JoystickLeft")
    machine.in_dbc("Slew : 0|16@1- (0.1,0) [-100|100]", "Slew : 0|16@1- (0.1,0) [-100|102]")
    assert machine.problems() == [
        f"machine.dbc:{line}: JoystickLeft: Slew: expected a symmetrical range, got [-100|102]"
    ]


def test_each_direction_flag_is_looked_up(machine: Machine) -> None:
    flags = "flags: { neutral: Mid, positive: Right, negative: Left }"
    line = machine.in_yaml("signal: Slew", f"signal: Slew, {flags}")
    begin = f"machine.yaml:{line}: axes.slew.command.flags"
    wanted = "expected a signal of JoystickLeft, got"
    problems = machine.problems()
    for key, name in (("neutral", "Mid"), ("positive", "Right"), ("negative", "Left")):
        assert any(problem.startswith(f"{begin}.{key}: {wanted} '{name}'") for problem in problems)


def test_a_rocker_is_bound(machine: Machine) -> None:
    rocker(machine)
    joystick = machine.load().joysticks["left"]
    assert joystick.decode(bytes([100, 0, *bytes(6)]))[1] == {"Slew": 0.5, "NearFar": 0.0}
    assert joystick.decode(bytes([0, 200, *bytes(6)]))[1] == {"Slew": -1.0, "NearFar": 0.0}
    with pytest.raises(ValueError, match="expected 8 bytes, got 9"):
        joystick.decode(bytes(9))


def test_both_signals_of_a_rocker_are_looked_up(machine: Machine) -> None:
    line = rocker(machine, signal="Sleew", negative="Bcak")
    there = "there are Slew, Back, NearFar, Enable, AntiSwayOff, Reset, AliveCounter"
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.slew.command.signal: expected a signal of JoystickLeft, got"
        f" 'Sleew'; {there}; did you mean Slew?",
        f"machine.yaml:{line}: axes.slew.command.negative: expected a signal of JoystickLeft, got"
        f" 'Bcak'; {there}; did you mean Back?",
    ]


def test_both_ranges_of_a_rocker_are_checked(machine: Machine) -> None:
    rocker(machine)
    machine.in_dbc("Slew : 0|8@1+ (0.5,0) [0|100]", "Slew : 0|8@1+ (0.5,0) [5|100]")
    machine.in_dbc("Back : 8|8@1+ (0.5,0) [0|100]", "Back : 8|8@1+ (0.5,0) [0|200]")
    line = machine.in_dbc("BO_ 272 JoystickLeft", "BO_ 272 JoystickLeft")
    assert machine.problems() == [
        f"machine.dbc:{line}: JoystickLeft: Slew: expected a range from 0, as it is a"
        " magnitude, got [5|100]",
        f"machine.dbc:{line}: JoystickLeft: Back cannot reach its range [0|200] with 8 bits at 0.5"
        " per bit",
    ]


@pytest.mark.parametrize(
    ("signal", "negative", "key", "says"),
    [
        ("Reset", "Back", "signal", "'Reset', which is reset already"),
        ("Slew", "Reset", "negative", "'Reset', which is reset already"),
        ("Slew", "Slew", "negative", "'Slew', which is the joystick of slew already"),
    ],
)
def test_each_signal_of_a_rocker_has_one_use(
    machine: Machine, signal: str, negative: str, key: str, says: str
) -> None:
    line = rocker(machine, signal=signal, negative=negative)
    machine.in_dbc('VAL_ 272 Reset 0 "Off" 1 "On" 2 "Error" 3 "NotAvailable" ;', "")
    expected = f"axes.slew.command.{key}: expected a free signal, got {says}"
    assert machine.problems() == [f"machine.yaml:{line}: {expected}"]
