"""Range, names of values and start value that a DBC gives a signal."""

from typing import Any

import cantools
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion

from canshaper.codec.message import FieldSet
from canshaper.codec.signals import (
    LEAST_STEPS,
    command_fault,
    full_scale,
    j1939_code,
    j1939_fault,
    magnitude_range,
    radius_range,
    set_point_fault,
    special_name,
    symmetrical_range,
)
from canshaper.codec.velocity import VelocitySignal
from canshaper.shaping.states import Reason

Number = float | None


def signal(
    low: Number,
    high: Number,
    scale: float = 1.0,
    offset: float = 0.0,
    *,
    is_float: bool = False,
    choices: dict[int, str] | None = None,
    bits: int = 32,
) -> Signal:
    """A signal, with a sign where it has 32 bits."""
    return Signal(
        "S",
        0,
        bits,
        is_signed=bits == 32,
        conversion=BaseConversion.factory(scale, offset, choices, is_float),
        minimum=low,
        maximum=high,
    )


@pytest.mark.parametrize(
    ("low", "high", "scale", "is_float"),
    [
        (-100.0, 100.0, 1.0, False),
        (-128.0, 127.0, 1.0, False),  # two's complement
        (-0.4, 0.5, 0.1, False),  # a step about a zero that is nearer than 1
        (-(0.1 + 0.2), 0.3, 1.0, True),  # decimals
    ],
)
def test_a_range_to_both_sides(low: float, high: float, scale: float, is_float: bool) -> None:
    assert symmetrical_range(signal(low, high, scale, is_float=is_float)) is None


@pytest.mark.parametrize(
    ("low", "high", "scale", "is_float"),
    [
        (-100.0, 102.0, 1.0, False),
        (-100.0, 100.5, 1.0, True),  # a float has no steps
        (0.0, 5.0, 10.0, False),  # less than a step, but of one side
        (1.0, 5.0, 10.0, False),
        (-5.0, 0.0, 10.0, False),
    ],
)
def test_no_range_to_both_sides(low: float, high: float, scale: float, is_float: bool) -> None:
    assert symmetrical_range(signal(low, high, scale, is_float=is_float)) == (
        f"S: expected a symmetrical range, got [{low:g}|{high:g}]"
    )


@pytest.mark.parametrize(("low", "high"), [(None, 5.0), (-5.0, None), (5.0, 5.0)])
def test_no_range_at_all(low: Number, high: Number) -> None:
    one = signal(low, high)
    assert str(symmetrical_range(one)).startswith("S has no range in the DBC; full speed is taken")
    assert radius_range(one) == "S has no range in the DBC; what lies outside is no radius"


def test_a_range_the_wrong_way_round() -> None:
    one = signal(5.0, -5.0)
    text = "S: expected the range [-5|5], got [5|-5]"
    assert symmetrical_range(one) == radius_range(one) == magnitude_range(one) == text


@pytest.mark.parametrize(
    ("high", "offset", "scale", "good"),
    [
        (127.0, 0.0, 1.0, True),
        (128.0, 0.0, 1.0, False),
        (100.0, -10.0, 1.0, True),  # 10 to 110
        (100.0, -30.0, 1.0, False),  # 30 to 130
        (100.0, 10.0, 1.0, False),  # -10 to 90
        (100.0, 0.0, 0.5, False),  # 200 steps
    ],
)
def test_a_range_that_seven_bits_reach(
    high: float, offset: float, scale: float, good: bool
) -> None:
    text = f"S cannot reach its range [0|{high:g}] with 7 bits at {scale:g} per bit"
    one = signal(0.0, high, scale, offset, bits=7)
    assert magnitude_range(one) == (None if good else text)


@pytest.mark.parametrize(("low", "good"), [(0.0, True), (0.5, True), (-0.5, False)])
def test_the_range_of_a_radius(low: float, good: bool) -> None:
    text = f"S: expected a range from 0 m or more, got [{low:g}|20]"
    assert radius_range(signal(low, 20.0)) == (None if good else text)


@pytest.mark.parametrize(
    ("low", "high", "raw", "command"),
    [
        # two's complement has one step more on one side, which is full too
        (-128.0, 127.0, -128, -1.0),
        (-128.0, 127.0, -129, Reason.JOYSTICK_OUT_OF_RANGE),
        (-127.0, 128.0, 128, 1.0),
        (-127.0, 128.0, 129, Reason.JOYSTICK_OUT_OF_RANGE),
        (-127.0, 128.0, -128, Reason.JOYSTICK_OUT_OF_RANGE),
    ],
)
def test_the_ends_of_a_velocity(low: float, high: float, raw: int, command: float | Reason) -> None:
    assert VelocitySignal.of(signal(low, high)).read({"S": raw}) == command


def test_the_nearer_end_is_full() -> None:
    assert full_scale(signal(-128.0, 127.0)) == 127.0
    assert full_scale(signal(-127.0, 128.0)) == 127.0
    assert full_scale(signal(0.0, 100.0)) == 100.0


def test_steps_of_a_command() -> None:
    few = f"S has fewer than {LEAST_STEPS} steps to full command"
    assert command_fault(signal(-9.0, 9.0)) == few
    assert command_fault(signal(-10.0, 10.0)) is None


@pytest.mark.parametrize(("offset", "good"), [(0.5, True), (-3.0, True), (0.05, False)])
def test_neutral_needs_a_raw_value(offset: float, good: bool) -> None:
    fault = command_fault(signal(-100.0, 100.0, 0.1, offset))
    assert fault == (None if good else "S has no raw value for zero, which neutral needs")


def test_a_set_point_of_cia_408() -> None:
    assert set_point_fault(signal(-0x4000, 0x4000)) is None
    assert set_point_fault(signal(-100.0, 100.0, 1.0, 5.0)) == (
        "S has the offset 5; a set point of CiA 408 has none"
    )
    assert set_point_fault(signal(0.0, 0x4001, bits=15)) == (
        "S has 16385 steps to full command; a set point of CiA 408 has 16384, and float at 32767"
    )


def test_the_name_of_a_value() -> None:
    one = signal(
        0.0,
        100.0,
        0.5,
        -10.0,
        choices={254: "Error", 255: "NotAvailable", 3: "Fast", 20: "Neutral"},
    )
    assert special_name(one, 254 * 0.5 - 10.0) == "Error"
    assert special_name(one, 255 * 0.5 - 10.0) == "NotAvailable"
    assert special_name(one, 3 * 0.5 - 10.0) == "Fast"
    assert special_name(one, 0.0) is None  # neutral
    assert special_name(one, 254.0) is None
    assert special_name(signal(0.0, 100.0), 50.0) is None


STARTS = """VERSION ""

BU_: A

BO_ 2365445886 M: 8 A
 SG_ Unsigned : 0|4@1+ (1,0) [0|0] "" A
 SG_ Signed : 4|4@1- (0.5,-10) [0|0] "" A
 SG_ Ratio : 32|32@1- (1,0) [0|0] "" A

BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
SIG_VALTYPE_ 2365445886 Ratio : 1;
"""
J1939 = 'BA_ "VFrameFormat" BO_ 2365445886 3;\n'


def message(text: str) -> Message:
    (one,) = cantools.database.load_string(text, "dbc").messages
    assert isinstance(one, Message)
    return one


def test_start_values() -> None:
    assert FieldSet(message(STARTS)).start == {"Unsigned": 0, "Signed": 0, "Ratio": 0.0}
    # all bits 1: not available
    assert FieldSet(message(STARTS + J1939)).start == {"Unsigned": 15, "Signed": -1, "Ratio": 0.0}


def test_physical_and_raw_values() -> None:
    fields = FieldSet(message(STARTS))
    assert [fields.raw("Signed", v) for v in (-10.0, -8.0, -99.0, 99.0)] == [0, 4, -8, 7]
    assert [fields.value("Signed", raw) for raw in (0, 4, -8)] == [-10.0, -8.0, -14.0]


@pytest.mark.parametrize(
    ("bits", "first"),
    [(1, None), (2, 2), (3, 6), (8, 254), (10, 1022), (12, 4094), (16, 0xFE00), (24, 0xFE0000)],
)
def test_error_codes_of_j1939(bits: int, first: int | None) -> None:
    assert j1939_code(signal(0.0, 1.0, bits=bits)) == first
    end = float((1 << bits) - 1)
    assert (j1939_fault(signal(0.0, end, bits=bits)) is None) == (first is None)
    assert j1939_fault(signal(0.0, int(0.99 * (first or 2)), bits=bits)) is None


def test_signed_signals_and_floats_have_no_error_codes_of_j1939() -> None:
    assert j1939_fault(signal(None, None)) is None
    assert j1939_fault(signal(None, None, bits=16, is_float=True)) is None


@pytest.mark.parametrize(
    ("conversion", "names", "first"),
    [
        ((None, None), (), 254),
        ((0.0, 255.0), (254,), 255),
        ((0.0, 255.0), (255,), 254),
        ((0.0, 255.0), (254, 255), None),
        ((0.0, 254.0), (254,), None),
        ((-255.0, 0.0, -1.0), (), 254),
        ((-100.0, 100.0, 1.0, -155.0), (), 254),
        ((-100.0, -99.5, 0.5, -227.25), (), 255),  # only the last one is in the range
    ],
)
def test_a_code_of_j1939_in_the_range_needs_a_name(
    conversion: tuple[Any, ...], names: tuple[int, ...], first: int | None
) -> None:
    fault = j1939_fault(signal(*conversion, choices=dict.fromkeys(names, "Error"), bits=8))
    assert fault is None if first is None else f": {first} would be " in str(fault)
