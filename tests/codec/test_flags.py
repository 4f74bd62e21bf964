"""Joysticks with direction flags: every combination, and what a deployment may say of them."""

import itertools
import math
from typing import Any

import cantools
import pytest

from canshaper.codec.codecs import JoystickCodec
from canshaper.codec.flags import FlaggedVelocity
from canshaper.codec.signals import VelocitySignal
from canshaper.shaping.states import Reason
from tests.rigs.files import Machine

# X axis of a basic joystick message of J1939-71, a wide and a float one.
DBC = """VERSION ""

BU_: A

BO_ 2365445886 BJM1: 8 A
 SG_ XNeutral : 0|2@1+ (1,0) [0|3] "" A
 SG_ XNeg : 2|2@1+ (1,0) [0|3] "" A
 SG_ XPos : 4|2@1+ (1,0) [0|3] "" A
 SG_ XPosition : 6|10@1+ (0.1,0) [0|100] "%" A

BO_ 2 Wide: 8 A
 SG_ XNeutral : 0|8@1+ (1,0) [0|1] "" A
 SG_ XNeg : 8|8@1+ (1,0) [0|1] "" A
 SG_ XPos : 16|8@1+ (1,0) [0|1] "" A
 SG_ XPosition : 32|32@1- (1,0) [0|100] "%" A

BO_ 3 Offset: 3 A
 SG_ XNeutral : 0|1@1+ (1,0) [0|1] "" A
 SG_ XNeg : 1|1@1+ (1,0) [0|1] "" A
 SG_ XPos : 2|1@1+ (1,0) [0|1] "" A
 SG_ XPosition : 8|16@1- (0.1,-30) [0|100] "%" A

VAL_ 2365445886 XPosition 1022 "Error" 1023 "NotAvailable" ;
SIG_VALTYPE_ 2 XPosition : 1;
"""
custom: Any = cantools.database.load_string(DBC, "dbc")

NEUTRAL, NEGATIVE, POSITIVE, NONE = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)


def read(flags: tuple[int, int, int], position: float, message: str = "BJM1") -> float | Reason:
    """Command of a frame that cantools has made."""
    definition = custom.get_message_by_name(message)
    joystick = VelocitySignal.of(definition.get_signal_by_name("XPosition"))
    codec = JoystickCodec(definition, [FlaggedVelocity(joystick, "XNeutral", "XNeg", "XPos")])
    raw = dict(zip(("XNeutral", "XNeg", "XPos"), flags, strict=True))
    data = definition.encode({**raw, "XPosition": position}, scaling=False, strict=False)
    _, commands = codec.decode(data)
    assert commands.keys() == {"XPosition"}
    return commands["XPosition"]


@pytest.mark.parametrize(
    ("flags", "raw", "command"),
    [
        (POSITIVE, 1000, 1.0),
        (NEGATIVE, 1000, -1.0),
        (POSITIVE, 1, 0.001),
        (NEGATIVE, 250, -0.25),
        (POSITIVE, 0, 0.0),
        (NEGATIVE, 0, 0.0),
        # in neutral nothing moves, whatever little the position shows
        (NEUTRAL, 0, 0.0),
        (NEUTRAL, 50, 0.0),
        (NEUTRAL, 51, Reason.JOYSTICK_CONTRADICTORY),
        (NEUTRAL, 1000, Reason.JOYSTICK_CONTRADICTORY),
        # on the way from the neutral switch to the switch of a direction
        (NONE, 0, 0.0),
        (NONE, 1, Reason.JOYSTICK_CONTRADICTORY),
        (NONE, 1000, Reason.JOYSTICK_CONTRADICTORY),
        # more than one
        ((0, 1, 1), 0, Reason.JOYSTICK_CONTRADICTORY),
        ((0, 1, 1), 500, Reason.JOYSTICK_CONTRADICTORY),
        ((1, 1, 0), 0, Reason.JOYSTICK_CONTRADICTORY),
        ((1, 0, 1), 0, Reason.JOYSTICK_CONTRADICTORY),
        ((1, 1, 1), 0, Reason.JOYSTICK_CONTRADICTORY),
        # codes of the flags
        ((2, 0, 1), 500, Reason.JOYSTICK_ERROR),
        ((0, 2, 1), 500, Reason.JOYSTICK_ERROR),
        ((0, 0, 2), 500, Reason.JOYSTICK_ERROR),
        ((3, 0, 1), 500, Reason.JOYSTICK_NOT_AVAILABLE),
        ((0, 3, 1), 500, Reason.JOYSTICK_NOT_AVAILABLE),
        ((1, 0, 3), 0, Reason.JOYSTICK_NOT_AVAILABLE),
        ((3, 2, 3), 0, Reason.JOYSTICK_ERROR),
        # codes of the position come first: it is what the joystick says of itself
        (POSITIVE, 1001, Reason.JOYSTICK_OUT_OF_RANGE),
        (NEUTRAL, 1021, Reason.JOYSTICK_OUT_OF_RANGE),
        (NEUTRAL, 1022, Reason.JOYSTICK_ERROR),
        (POSITIVE, 1023, Reason.JOYSTICK_NOT_AVAILABLE),
        ((3, 3, 3), 1023, Reason.JOYSTICK_NOT_AVAILABLE),
        ((3, 3, 3), 1022, Reason.JOYSTICK_ERROR),
    ],
)
def test_position_and_flags(flags: tuple[int, int, int], raw: int, command: float | Reason) -> None:
    result = read(flags, raw)
    assert type(result) is type(command)
    assert result == pytest.approx(command)


def test_only_one_direction_alone_moves_and_only_its_way() -> None:
    for *flags, raw in itertools.product(range(4), range(4), range(4), range(0, 1024, 31)):
        command = read((flags[0], flags[1], flags[2]), raw)
        if max(flags) > 1 or raw > 1000:
            assert isinstance(command, Reason)
        elif not isinstance(command, Reason) and command != 0.0:
            assert flags == [0, int(command < 0), int(command > 0)]
            assert abs(command) == pytest.approx(raw / 1000)


@pytest.mark.parametrize("flags", [NEUTRAL, NEGATIVE, POSITIVE, NONE])
def test_zero_has_no_sign(flags: tuple[int, int, int]) -> None:
    command = read(flags, 0)
    assert isinstance(command, float)
    assert math.copysign(1.0, command) == 1.0


@pytest.mark.parametrize(
    ("flags", "position", "command"),
    [
        (NEGATIVE, 50.0, -0.5),
        ((0, 254, 0), 50.0, Reason.JOYSTICK_ERROR),
        ((0, 0, 255), 50.0, Reason.JOYSTICK_ERROR),
        ((4, 0, 1), 50.0, Reason.JOYSTICK_ERROR),
        (NEGATIVE, -50.0, Reason.JOYSTICK_OUT_OF_RANGE),  # would be positive
        (NEUTRAL, -1.0, Reason.JOYSTICK_OUT_OF_RANGE),
        (POSITIVE, 100.1, Reason.JOYSTICK_OUT_OF_RANGE),
        (NEUTRAL, math.nan, Reason.JOYSTICK_NOT_A_NUMBER),
        (POSITIVE, math.inf, Reason.JOYSTICK_NOT_A_NUMBER),
        (NEGATIVE, -math.inf, Reason.JOYSTICK_NOT_A_NUMBER),
    ],
)
def test_wide_flags_and_a_float_position(
    flags: tuple[int, int, int], position: float, command: float | Reason
) -> None:
    assert read(flags, position, "Wide") == command


def test_a_zero_that_is_rounded_is_zero() -> None:
    """300 steps of 0.1 less 30 are 4e-15."""
    for flags in (NEUTRAL, NEGATIVE, POSITIVE, NONE):
        assert read(flags, 300, "Offset") == 0.0
    assert read(NEGATIVE, 1300, "Offset") == -1.0
    assert read(POSITIVE, 299, "Offset") == Reason.JOYSTICK_OUT_OF_RANGE


# -- deployment ------------------------------------------------------------------------------------


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
    codec = machine.load().joysticks["left"].codec
    raw, commands = codec.decode(bytes.fromhex("c4 3e 00 00 01 00 00 00"))
    assert (raw["SlewNegative"], raw["Slew"]) == (1, 251)
    assert commands == {"Slew": pytest.approx(-0.251), "NearFar": 0.0}


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (
            FLAGS.replace("SlewNeutral", "N"),
            "flags.neutral: expected a signal of JoystickLeft, got 'N'; there are",
        ),
        (
            FLAGS.replace(", positive: SlewPositive", ""),
            "flags.positive: missing: signal that the velocity is positive",
        ),
        (
            FLAGS.replace(" }", ", invert: true }"),
            "flags.invert: expected one of the keys neutral, negative, positive",
        ),
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
    machine.in_dbc("AliveCounter : 56|8@1+", "AliveCounter : 38|16@1+")
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
            "with direction flags expected a range from 0, got [-100|100]",
        ),
        (
            ("[-100|100]", "[10|100]"),
            True,
            "with direction flags expected a range from 0, got [10|100]",
        ),
        (("[-100|100]", "[0|0]"), True, "Slew has no range in the DBC"),
        (
            ("16@1- (0.1,0) [-100|100]", "16@1+ (0,0) [0|100]"),
            True,
            "Slew: expected a scale other than 0, got 0",
        ),
        (("16@1- (0.1,0) [-100|100]", "9@1+ (0.1,0) [0|100]"), True, "Slew cannot reach its range"),
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
