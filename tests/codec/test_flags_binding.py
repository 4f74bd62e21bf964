"""Joysticks with direction flags: what a deployment may say of them."""

import pytest

from tests.rigs.files import Machine

JOYSTICK = "signal: Slew, neutral_pct: 2"
FLAGS = "{ neutral: SlewNeutral, negative: SlewNegative, positive: SlewPositive }"
SIGNED = ' SG_ Slew : 0|16@1- (0.1,0) [-100|100] "%" SHAPER\n'
FLAGGED = """ SG_ SlewNeutral : 0|2@1+ (1,0) [0|3] "" SHAPER
 SG_ SlewNegative : 2|2@1+ (1,0) [0|3] "" SHAPER
 SG_ SlewPositive : 4|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Slew : 6|10@1+ (0.1,0) [0|100] "%" SHAPER
"""


def flagged(machine: Machine, flags: str = FLAGS) -> int:
    """Give slew direction flags; return the line of its joystick."""
    machine.in_dbc(SIGNED, FLAGGED)
    return machine.in_yaml(JOYSTICK, f"signal: Slew, flags: {flags}")


def test_flags_bind(machine: Machine) -> None:
    flagged(machine)
    joystick = machine.load().joysticks["left"]
    raw, commands = joystick.decode(bytes.fromhex("c4 3e 00 00 01 00 00 00"))
    assert (raw["SlewNegative"], raw["Slew"]) == (1, 251)
    assert commands == {"Slew": pytest.approx(-0.251), "NearFar": 0.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (
            FLAGS.replace("SlewNegative", "SlewPositive"),
            "flags.positive: expected a free signal, got 'SlewPositive', which is the negative"
            " flag of slew already",
        ),
        (
            FLAGS.replace("SlewNeutral", "Enable"),
            "flags.neutral: expected a free signal, got 'Enable', which is enable already",
        ),
        (
            FLAGS.replace("SlewNeutral", "AliveCounter"),
            "flags.neutral: expected a free signal, got 'AliveCounter', which is alive_counter"
            " already",
        ),
        (
            FLAGS.replace("SlewNegative", "Slew "),
            "flags.negative: expected a free signal, got 'Slew', which is the joystick of slew"
            " already",
        ),
        (
            FLAGS.replace("SlewNegative", "NearFar"),
            "flags.negative: NearFar: expected an unsigned integer signal, got a signed one",
        ),
        (
            "SlewNeutral",
            "flags: expected a section with the keys neutral, negative, positive, got"
            " 'SlewNeutral'",
        ),
    ],
)
def test_flags_that_do_not_fit(machine: Machine, flags: str, says: str) -> None:
    line = flagged(machine, flags)
    problem = machine.problems()[0]
    assert problem.startswith(f"machine.yaml:{line}: axes.slew.command.flags")
    assert says in problem


def test_the_joystick_of_another_axis_is_no_flag(machine: Machine) -> None:
    line = flagged(machine, FLAGS.replace("SlewNeutral", "NearFar"))
    machine.in_dbc("NearFar : 16|16@1-", "NearFar : 16|16@1+")
    assert any(
        p == f"machine.yaml:{line}: axes.slew.command.flags.neutral:"
        " expected a free signal, got 'NearFar', which is the joystick of near_far already"
        for p in machine.problems()
    )


def test_two_axes_do_not_share_a_joystick_with_flags(machine: Machine) -> None:
    """With other flags it would be another joystick, and the one would be lost."""
    flagged(machine)
    machine.in_yaml("    anti_sway_off: AntiSwayOff\n", "")
    line = machine.in_yaml(
        "signal: NearFar, neutral_pct: 2",
        "signal: Slew, flags: { neutral: AntiSwayOff, negative: NearFar, positive: Other }",
    )
    two_bits = '2@1+ (1,0) [0|3] "" SHAPER'
    machine.in_dbc(
        'NearFar : 16|16@1- (0.1,0) [-100|100] "%" SHAPER',
        f"NearFar : 16|{two_bits}\n SG_ Other : 18|{two_bits}",
    )
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.near_far.command.signal:"
        " expected a free signal, got 'Slew', which is the joystick of slew already"
    ]


def test_a_float_is_no_flag(machine: Machine) -> None:
    machine.in_yaml("    alive_counter: AliveCounter\n", "")
    line = flagged(machine, FLAGS.replace("SlewNeutral", "AliveCounter"))
    machine.in_dbc("NearFar : 16|16@1- (0.1,0)", "NearFar : 16|8@1- (1,0)")
    for signal, before, then in (("Enable", 32, 24), ("AntiSwayOff", 34, 26), ("Reset", 36, 28)):
        machine.in_dbc(f"{signal} : {before}|", f"{signal} : {then}|")
    machine.in_dbc("AliveCounter : 56|8@1+", "AliveCounter : 32|32@1+")
    machine.dbc += "SIG_VALTYPE_ 272 AliveCounter : 1;\n"
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.slew.command.flags.neutral: AliveCounter: expected an"
        " unsigned integer signal, got a float"
    ]


@pytest.mark.parametrize(
    ("change", "flags", "says"),
    [
        (
            ("[-100|100]", "[-100|100]"),
            True,
            "expected a range from 0, as it is a magnitude, got [-100|100]",
        ),
        (("[-100|100]", "[0|0]"), True, "Slew has no range in the DBC"),
        (
            ("[-100|100]", "[0|100]"),
            False,
            "expected a symmetrical range, got [0|100]; with direction flags it is right",
        ),
    ],
)
def test_the_range_shows_whether_a_joystick_has_flags(
    machine: Machine, change: tuple[str, str], flags: bool, says: str
) -> None:
    line = machine.in_dbc("BO_ 272 JoystickLeft", "BO_ 272 JoystickLeft")
    machine.in_dbc(*change)
    if flags:
        machine.in_dbc('Reset : 36|2@1+ (1,0) [0|1] "" SHAPER\n', _more_flags())
        machine.in_yaml(JOYSTICK, f"signal: Slew, flags: {FLAGS}")
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.dbc:{line}: JoystickLeft: Slew")
    assert says in problem


def _more_flags() -> str:
    rows = ['Reset : 36|2@1+ (1,0) [0|1] "" SHAPER']
    rows += [
        f' SG_ Slew{name} : {bit}|2@1+ (1,0) [0|3] "" SHAPER'
        for name, bit in (("Neutral", 38), ("Negative", 40), ("Positive", 42))
    ]
    return "\n".join(rows) + "\n"
