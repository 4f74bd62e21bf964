"""Joysticks with direction flags: every combination of position and flags."""

import itertools
import math
from typing import Any

import cantools
import pytest

from canshaper.codec.layout import Layout
from canshaper.codec.velocity import FlaggedVelocity, VelocitySignal
from canshaper.shaping.states import Reason

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
    velocity = FlaggedVelocity(joystick, "XNeutral", "XNeg", "XPos")
    raw = dict(zip(("XNeutral", "XNeg", "XPos"), flags, strict=True))
    data = definition.encode({**raw, "XPosition": position}, scaling=False, strict=False)
    assert velocity.name == "XPosition"
    return velocity.read(Layout(definition).decode(data))


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


def test_a_rounding_is_zero() -> None:
    codec = FlaggedVelocity(VelocitySignal("X", 1.0, 0.0, 1e6, {}), "0", "-", "+")
    positive = {"0": 0, "-": 0, "+": 1}
    assert codec.read({"X": 1, **positive}) == codec.read({"X": -1, **positive}) == 0.0
    assert codec.read({"X": 2, **positive}) == pytest.approx(2e-6)
    assert codec.read({"X": -2, **positive}) is Reason.JOYSTICK_OUT_OF_RANGE
