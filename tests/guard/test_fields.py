"""Where a signal lies, and what it says: both byte orders, signs, floats, offsets."""

import random
import struct
from typing import Any

import cantools
import pytest

from canshaper.codec.signals import VelocitySignal
from canshaper.config.schema import Command, Valve
from canshaper.guard.bits import CommandBits, Field, JoystickBits, Part, span_of

HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: JOYSTICK SHAPER\nBO_ 2 Message: 8 JOYSTICK\n'


def message(*signals: str, floats: str = "", tables: str = "") -> Any:
    """A message of 8 bytes with these signals; ``floats`` names the one that is a float."""
    lines = "".join(f' SG_ {signal} "" SHAPER\n' for signal in signals)
    kind = f"SIG_VALTYPE_ 2 {floats} : 1;\n" if floats else ""
    loaded: Any = cantools.database.load_string(HEAD + lines + kind + tables, "dbc")
    return loaded.get_message_by_name("Message")


@pytest.mark.parametrize(
    ("bits", "span"),
    [(0x01, (0, 1)), (0x80, (0, 1)), (0x100, (1, 2)), (0xC0_00, (1, 2)), (0x01_80_00, (1, 3))],
)
def test_the_bytes_of_some_bits(bits: int, span: tuple[int, int]) -> None:
    assert span_of(bits) == slice(*span)


@pytest.mark.parametrize("sign", ["+", "-"])
@pytest.mark.parametrize(
    "place",
    # Intel from its lowest bit, Motorola from its highest.
    ["0|8@1", "5|12@1", "40|16@1", "63|1@1", "7|8@0", "3|12@0", "20|9@0", "34|3@0", "55|16@0"],
)
def test_a_field_is_read_as_cantools_reads_it(place: str, sign: str) -> None:
    one = message(f"Signal : {place}{sign} (1,0) [0|0]")
    field, rng = Field(one.signals[0], 8), random.Random(place)
    for _ in range(50):
        data = rng.randbytes(8)
        assert field.raw(data) == one.decode(data, decode_choices=False)["Signal"]
    full = -1 if sign == "-" else (1 << one.signals[0].length) - 1
    assert field.bits == int.from_bytes(one.encode({"Signal": full}), "little")


@pytest.mark.parametrize("order", ["0|32@1-", "7|32@0-"])
def test_a_float_is_read_in_both_byte_orders(order: str) -> None:
    one = message(f"Signal : {order} (1,0) [0|0]", floats="Signal")
    assert Field(one.signals[0], 8).raw(one.encode({"Signal": -0.375})) == -0.375


def bits_of(signals: list[str], joystick: Command | None = None, **valve: Any) -> CommandBits:
    config = Valve(bus="crane", message="Message", signal="Speed", timeout_ms=100, **valve)
    return CommandBits(message(*signals), config, joystick)


@pytest.mark.parametrize(
    ("scale", "offset", "raw", "steps"),
    [
        ("0.8", "-100", 125, 0),
        ("0.8", "-100", 250, 125),
        ("0.8", "-100", 0, -125),
        ("-0.8", "100", 125, 0),  # the larger the raw value, the faster backwards
        ("-0.8", "100", 250, -125),
        ("-0.8", "100", 0, 125),
    ],
)
def test_a_command_with_an_offset(scale: str, offset: str, raw: int, steps: int) -> None:
    bits = bits_of([f"Speed : 0|8@1+ ({scale},{offset}) [-100|100]"])
    assert bits.full == 125
    assert bits.steps(bytes([raw, *bytes(7)])) == steps


@pytest.mark.parametrize(
    ("forth", "back", "steps"),
    [(5, 5, 0), (105, 5, 100), (5, 105, -100), (6, 6, None), (4, 5, None), (5, 4, None)],
)
def test_a_rocker_with_an_offset(forth: int, back: int, steps: int | None) -> None:
    signals = ["Speed : 0|8@1+ (1,-5) [0|100]", "Back : 24|8@1+ (1,-5) [0|100]"]
    bits = bits_of(signals, Command(joystick="left", signal="Speed", negative="Back"))
    assert bits.span == slice(0, 4)
    assert bits.steps(bytes([forth, 0, 0, back, *bytes(4)])) == steps


@pytest.mark.parametrize(("also", "good"), [(75, True), (74, False), (76, False), (25, False)])
def test_the_same_in_another_resolution_with_an_offset(also: int, good: bool) -> None:
    signals = ["Speed : 0|8@1+ (1,0) [0|100]", "Also : 8|8@1+ (2,-100) [-100|100]"]
    bits = bits_of(signals, also=["Also"])
    assert bits.steps(bytes([50, also, *bytes(6)])) == (50 if good else None)


@pytest.mark.parametrize(
    ("ends", "raw", "value"),
    [
        # Two's complement has one step more on one side: full as well, and the last that is read.
        ("-101|100", 50, 0.5),
        ("-101|100", -50, -0.5),
        ("-101|100", 100, 1.0),
        ("-101|100", 101, 0.0),
        ("-101|100", -101, -1.0),
        ("-101|100", -102, 0.0),
        ("-100|101", 50, 0.5),
        ("-100|101", -100, -1.0),
        ("-100|101", -101, 0.0),
        ("-100|101", 101, 1.0),
        ("-100|101", 102, 0.0),
        ("-100|100", -101, 0.0),
        ("-100|100", -150, 0.0),
        # Of a range from 0 what is below it keeps its sign, up to full scale.
        ("0|100", 50, 0.5),
        ("0|100", 101, 0.0),
        ("0|100", -50, -0.5),
        ("0|100", -101, 0.0),
        ("-100|100", 90, 0.0),  # what has a name of an error is no value
    ],
)
def test_a_value_is_a_part_of_full_scale_as_the_codec_has_it(
    ends: str, raw: int, value: float
) -> None:
    one = message(f"Signal : 0|16@1- (1,0) [{ends}]", tables='VAL_ 2 Signal 90 "Error" ;\n')
    assert Part(one.signals[0], 8).value(struct.pack("<hHI", raw, 0, 0)) == value
    read = VelocitySignal.of(one.signals[0]).read({"Signal": raw})
    assert value == (read if isinstance(read, float) else 0.0)


@pytest.mark.parametrize("scale", [0.001, 0.01, 1.0])
@pytest.mark.parametrize(
    ("ends", "full"), [((-50, 51), 50), ((-51, 50), 50), ((-50, 50), 50), ((0, 50), 50)]
)
def test_full_command_is_the_nearer_end_of_a_range(
    scale: float, ends: tuple[int, int], full: int
) -> None:
    low, high = (end * scale for end in ends)
    bits = bits_of([f"Speed : 0|8@1- ({scale},0) [{low:g}|{high:g}]"])
    assert bits.full == full


@pytest.mark.parametrize(("raw", "command"), [(199, 0.0), (200, 0.2), (-199, 0.0), (-200, -0.2)])
def test_within_its_neutral_band_a_joystick_commands_nothing(raw: int, command: float) -> None:
    one = message("Joystick : 0|16@1- (0.1,0) [-100|100]")
    bits = JoystickBits(one, Command(joystick="left", signal="Joystick", neutral_pct=20))
    assert bits.command(struct.pack("<hHI", raw, 0, 0)) == pytest.approx(command)


def test_a_rocker_commands_by_both_its_signals() -> None:
    one = message("Forth : 8|8@1+ (1,0) [0|100]", "Back : 24|8@1+ (1,0) [0|100]")
    bits = JoystickBits(one, Command(joystick="left", signal="Forth", negative="Back"))
    assert bits.span == slice(1, 4)
    assert len(bits.fields) == 2
    assert bits.command(bytes([0, 0, 0, 50, *bytes(4)])) == pytest.approx(-0.5)


@pytest.mark.parametrize(
    ("flags", "command"), [((1, 0, 0), 0.0), ((0, 1, 0), 0.5), ((0, 0, 1), -0.5), ((0, 1, 1), 0.0)]
)
def test_a_joystick_of_flags_commands_where_one_is_set(
    flags: tuple[int, ...], command: float
) -> None:
    names = ("Neutral", "Positive", "Negative")
    places = [f"{name} : {8 + 2 * i}|2@1+ (1,0) [0|1]" for i, name in enumerate(names)]
    one = message("Joystick : 0|8@1+ (1,0) [0|100]", *places)
    flag_names = {"neutral": "Neutral", "positive": "Positive", "negative": "Negative"}
    bits = JoystickBits(one, Command(joystick="left", signal="Joystick", flags=flag_names))  # type: ignore[arg-type]
    switched = sum(flag << 2 * i for i, flag in enumerate(flags))
    assert bits.command(bytes([50, switched, *bytes(6)])) == pytest.approx(command)
