"""The gate's own decoder: the same as cantools, and as the codecs, from another place."""

import random
import struct
from pathlib import Path
from typing import Any

import cantools
import pytest

from canshaper.config.limits import Limits
from canshaper.config.schema import Command as Stick
from canshaper.config.schema import Valve
from canshaper.gate.fields import openings_of, word_of
from canshaper.gate.signals import Scale, command_of, field_of, part_of, stick_of
from canshaper.shaping.limits import without_deadband

HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: JOYSTICK SHAPER\nBO_ 2 Message: 8 JOYSTICK\n'
DBC = Path(__file__).parents[2] / "dbc"


def message(*signals: str, floats: str = "", tables: str = "") -> Any:
    """A message of 8 bytes with these signals; ``floats`` names the one that is a float."""
    lines = "".join(f' SG_ {signal} "" SHAPER\n' for signal in signals)
    kind = f"SIG_VALTYPE_ 2 {floats} : 1;\n" if floats else ""
    loaded: Any = cantools.database.load_string(HEAD + lines + kind + tables, "dbc")
    return loaded.get_message_by_name("Message")


def network(name: str) -> Any:
    return cantools.database.load_file(DBC / name)


def value(one: Any, raw: bytes, **keys: Any) -> float | None:
    """Read the first signal of a frame, as a part of full deflection."""
    signal = one.signals[0]
    section = Stick(joystick="left", signal=signal.name, **keys)
    return part_of(field_of(one, signal.name), signal, section).value(word_of(raw))


@pytest.mark.parametrize("sign", ["+", "-"])
@pytest.mark.parametrize(
    "place",
    # Intel from its lowest bit, Motorola from its highest.
    ["0|8@1", "5|12@1", "40|16@1", "63|1@1", "7|8@0", "3|12@0", "20|9@0", "34|3@0", "55|16@0"],
)
def test_a_field_is_read_as_cantools_reads_it(place: str, sign: str) -> None:
    one = message(f"Signal : {place}{sign} (1,0) [0|0]")
    field, rng = field_of(one, "Signal"), random.Random(place)
    for _ in range(50):
        data = rng.randbytes(8)
        assert field.raw(word_of(data)) == one.decode(data, decode_choices=False)["Signal"]


@pytest.mark.parametrize("order", ["0|32@1-", "7|32@0-"])
def test_a_float_is_read_in_both_byte_orders(order: str) -> None:
    one = message(f"Signal : {order} (1,0) [-1|1]", floats="Signal")
    for number in (-0.375, 0.5, 1e-3):
        assert field_of(one, "Signal").raw(word_of(one.encode({"Signal": number}))) == (
            pytest.approx(number)
        )


@pytest.mark.parametrize(
    ("number", "is_read"),
    [(0.5, 0.5), (-1.0, -1.0), (0.0, 0.0), (1.5, None), (float("nan"), None), (1e39, None)],
)
def test_a_float_joystick(number: float, is_read: float | None) -> None:
    one = message("Signal : 0|32@1- (1,0) [-1|1]", floats="Signal")
    raw = struct.pack("<f", number) if number < 1e38 or number != number else b"\0\0\x80\x7f"  # noqa: PLR0124
    assert value(one, raw + bytes(4)) == is_read


@pytest.mark.parametrize(
    ("ends", "raw", "is_read"),
    [
        # Two's complement has one step more on one side: full as well, and the last that is read.
        ("-101|100", 50, 0.5),
        ("-101|100", -101, -1.0),
        ("-101|100", -102, None),
        ("-101|100", 101, None),
        ("-100|101", 101, 1.0),
        ("-100|101", -101, None),
        ("-100|100", -100, -1.0),
        ("-100|100", -101, None),
        # Of a range from 0 what is below it keeps its sign, up to full scale.
        ("0|100", 50, 0.5),
        ("0|100", 101, None),
        ("0|100", -50, -0.5),
    ],
)
def test_a_value_is_a_part_of_full_scale(ends: str, raw: int, is_read: float | None) -> None:
    one = message(f"Signal : 0|16@1- (1,0) [{ends}]")
    assert value(one, struct.pack("<hHI", raw, 0, 0)) == is_read


@pytest.mark.parametrize(
    ("keys", "raw", "is_read"),
    [({"full": 50}, 25, 0.5), ({"full": 100, "zero": 100}, 150, 0.5), ({"zero": 10}, 10, 0.0),
     ({"invert": True}, 50, -0.5), ({"full": 127}, -128, -1.0), ({"full": 127}, 127, 1.0)],
)  # fmt: skip
def test_the_file_corrects_what_the_dbc_says(
    keys: dict[str, Any], raw: int, is_read: float
) -> None:
    signed = raw < 0 or keys.get("full") == 127
    one = message(f"Signal : 0|8@1{'-' if signed else '+'} (1,0) [{'-100' if signed else '0'}|100]")
    one = (
        one
        if signed or "full" in keys or keys.get("zero")
        else message("Signal : 0|8@1- (1,0) [-100|100]")
    )
    if keys == {"zero": 10}:
        one = message("Signal : 0|8@1+ (1,0) [0|20]")
    assert value(one, bytes([raw & 0xFF, *bytes(7)]), **keys) == pytest.approx(is_read)


@pytest.mark.parametrize(
    ("signal", "keys", "low", "high"),
    [
        ("8@1- (1,0) [-100|100]", {"zero": 10}, -110, 90),
        ("8@1- (1,0) [-100|90]", {"invert": True}, -90, 100),
        # Two's complement reaches a step farther on one side, and not two.
        ("8@1- (1,0) [-100|100]", {"full": 127}, -128, 127),
        ("8@1- (1,0) [-100|100]", {"full": 126}, -126, 127),
        ("8@1- (0.5,0) [-60|60]", {"full": 63.5}, -64, 63.5),
        ("8@1- (-1,0) [-100|100]", {"full": 127}, -127, 128),
        ("8@1+ (1,-128) [-100|100]", {"full": 127}, -128, 127),
        ("8@1+ (1,0) [0|255]", {"full": 127, "zero": 128}, -128, 127),
        ("8@1+ (1,0) [0|255]", {"full": 254, "negative": "Back"}, -254, 254),
    ],
)
def test_ends_of_a_velocity(signal: str, keys: dict[str, Any], low: float, high: float) -> None:
    one = message(f"Signal : 0|{signal}")
    magnitude = "negative" in keys
    scale = Scale(one.signals[0], Stick(joystick="a", signal="b", **keys), magnitude=magnitude)
    assert (scale.low, scale.high) == (low, high)
    assert scale.full == min(-low, high)


@pytest.mark.parametrize(
    "name", ["Open circuit", "Fehler", "Short circuit", "Sensor break", "Bad", "Virhe", "Error"]
)
def test_a_code_with_a_name_is_no_measurement_whatever_the_name(name: str) -> None:
    one = message("Signal : 0|8@1- (1,0) [-128|127]", tables=f'VAL_ 2 Signal -128 "{name}" ;\n')
    assert value(one, b"\x80" + bytes(7)) is None
    assert value(one, b"\x81" + bytes(7)) == -1.0


def test_neutral_may_have_its_name() -> None:
    one = message("Signal : 0|8@1- (1,0) [-100|100]", tables='VAL_ 2 Signal 0 "Neutral" ;\n')
    assert value(one, bytes(8)) == 0.0
    one = message("Signal : 0|8@1- (1,0) [-100|100]", tables='VAL_ 2 Signal 0 "Broken" ;\n')
    assert value(one, bytes(8)) is None
    one = message("Signal : 0|8@1- (1,0) [-100|100]", tables='VAL_ 2 Signal 1 "Neutral" ;\n')
    assert value(one, b"\1" + bytes(7)) is None
    table = 'VAL_ 2 Signal 100 "Neutral position" ;\n'
    one = message("Signal : 0|8@1+ (0.5,-50) [-50|50]", tables=table)
    assert value(one, b"\x64" + bytes(7)) == 0.0


def test_what_the_file_lists_as_a_value_is_one() -> None:
    one = message("Signal : 0|8@1- (1,0) [-128|127]", tables='VAL_ 2 Signal -128 "Full" ;\n')
    assert value(one, b"\x80" + bytes(7), codes={"Full": "value"}) == -1.0
    assert value(one, b"\x80" + bytes(7), codes={"Full": "fault"}) is None


SIDES = ("neutral", "negative", "positive")
FLAGS = ("Neutral", "Negative", "Positive")


@pytest.mark.parametrize(
    ("flags", "position", "demand"),
    [((1, 0, 0), 0, 0.0), ((1, 0, 0), 5, 0.0), ((1, 0, 0), 6, None), ((0, 0, 1), 50, 0.5), ((0, 1,
     0), 50, -0.5), ((0, 1, 0), 0, 0.0), ((0, 0, 0), 0, 0.0), ((0, 0, 0), 1, None), ((0, 1, 1), 50,
     None), ((0, 0, 2), 50, None), ((0, 0, 3), 0, None), ((0, 0, 1), 200, None)],
)  # fmt: skip
@pytest.mark.parametrize("full", [None, 100.0])
def test_a_joystick_of_flags(
    full: float | None, flags: tuple[int, ...], position: int, demand: float | None
) -> None:
    places = [f"{name} : {8 + 2 * i}|2@1+ (1,0) [0|1]" for i, name in enumerate(FLAGS)]
    one = message("Signal : 0|8@1+ (1,0) [0|100]", *places)
    names = {"neutral": "Neutral", "positive": "Positive", "negative": "Negative"}
    section = Stick(joystick="left", signal="Signal", flags=names, full=full)  # type: ignore[arg-type]
    switched = sum(flag << 2 * i for i, flag in enumerate(flags))
    data = bytes([position, switched, *bytes(6)])
    assert stick_of(one, section, one).demand(word_of(data)) == demand


@pytest.mark.parametrize(
    ("forth", "back", "demand"),
    [(0, 0, 0.0), (50, 0, 0.5), (0, 50, -0.5), (5, 5, 0.0), (6, 6, None), (50, 101, None),
     (101, 0, None)],
)  # fmt: skip
def test_a_rocker(forth: int, back: int, demand: float | None) -> None:
    one = message("Forth : 8|8@1+ (1,0) [0|100]", "Back : 24|8@1+ (1,0) [0|100]")
    section = Stick(joystick="left", signal="Forth", negative="Back")
    data = bytes([0, forth, 0, back, *bytes(4)])
    assert stick_of(one, section, one).demand(word_of(data)) == pytest.approx(demand)


@pytest.mark.parametrize("keys", [{"negative": "Back"}, {"flags": dict.fromkeys(SIDES, "Back")}])
def test_a_magnitude_is_not_beyond_full(keys: dict[str, Any]) -> None:
    one = message("Forth : 8|8@1+ (1,0) [0|255]", "Back : 24|8@1+ (1,0) [0|255]")
    section = Stick(joystick="left", signal="Forth", full=254, neutral_pct=5, **keys)
    stick = stick_of(one, section, one)
    assert stick.band == 0.05
    assert [stick.part.value(word_of(bytes([0, raw, *bytes(6)]))) for raw in (254, 255)] == [
        1.0,
        None,
    ]


@pytest.mark.parametrize(("forth", "back"), [(50, -20), (-20, 50)])
def test_a_side_of_a_rocker_is_not_below_zero(forth: int, back: int) -> None:
    one = message("Forth : 8|8@1- (1,0) [-100|100]", "Back : 24|8@1- (1,0) [-100|100]")
    section = Stick(joystick="left", signal="Forth", negative="Back")
    data = bytes([0, forth & 0xFF, 0, back & 0xFF, *bytes(4)])
    assert stick_of(one, section, one).demand(word_of(data)) is None


def command_steps(one: Any, data: bytes, joystick: Stick | None = None, **valve: Any) -> int | None:
    keys = {"bus": "crane", "message": "Message", "signal": "Speed", "timeout_ms": 100} | valve
    return command_of(one, Valve(**keys), joystick, one).steps(word_of(data))


@pytest.mark.parametrize(
    ("scale", "offset", "raw", "steps"),
    [("0.8", "-100", 125, 0), ("0.8", "-100", 250, 125), ("0.8", "-100", 0, -125),
     ("0.8", "-100", 251, None), ("-0.8", "100", 125, 0), ("-0.8", "100", 250, -125),
     ("-0.8", "100", 0, 125)],
)  # fmt: skip
def test_a_command_with_an_offset(scale: str, offset: str, raw: int, steps: int | None) -> None:
    one = message(f"Speed : 0|8@1+ ({scale},{offset}) [-100|100]")
    assert command_steps(one, bytes([raw, *bytes(7)])) == steps


@pytest.mark.parametrize(
    ("forth", "back", "steps"),
    [(5, 5, 0), (105, 5, 100), (5, 105, -100), (6, 6, None), (4, 5, None), (5, 4, None)],
)
def test_a_command_of_a_rocker(forth: int, back: int, steps: int | None) -> None:
    one = message("Speed : 0|8@1+ (1,-5) [0|100]", "Back : 24|8@1+ (1,-5) [0|100]")
    joystick = Stick(joystick="left", signal="Speed", negative="Back")
    assert command_steps(one, bytes([forth, 0, 0, back, *bytes(4)]), joystick) == steps


@pytest.mark.parametrize(
    ("speed", "also", "good"),
    [(50, 75, True), (50, 74, False), (50, 76, False), (50, 25, False), (51, 74, False),
     (51, 75, True), (51, 76, True), (51, 77, False)],
)  # fmt: skip
def test_the_same_in_another_resolution(speed: int, also: int, good: bool) -> None:
    one = message("Speed : 0|8@1+ (1,0) [0|100]", "Also : 8|8@1+ (2,-100) [-100|100]")
    steps = command_steps(one, bytes([speed, also, *bytes(6)]), also=["Also"])
    assert steps == (speed if good else None)


@pytest.mark.parametrize(
    ("raw", "steps"),
    [
        ({"XNeutral": 1}, 0),
        ({"XPositive": 1, "XPosition": 500}, 500),
        ({"XNegative": 1, "XPosition": 1}, -1),
        ({"XNeutral": 1, "XPosition": 1}, None),  # neutral that moves
        ({"XPositive": 1}, None),  # a direction of nothing
        ({"XPositive": 1, "XNegative": 1, "XPosition": 500}, None),
        ({}, None),
    ],
)
def test_a_command_by_flags_of_the_joystick(raw: dict[str, int], steps: int | None) -> None:
    one = network("j1939-bjm-avc.dbc").get_message_by_name("BJM1")
    flags = {"neutral": "XNeutral", "positive": "XPositive", "negative": "XNegative"}
    joystick = Stick(joystick="left", signal="XPosition", flags=flags)  # type: ignore[arg-type]
    values = dict.fromkeys((s.name for s in one.signals), 0) | raw
    data = one.encode(values, scaling=False, strict=False, padding=True)
    assert command_steps(one, data, joystick, signal="XPosition") == steps


@pytest.mark.parametrize("sign", [1, -1])
def test_a_velocity_is_that_behind_dead_band_or_curve(sign: int) -> None:
    points = {"curve_command_pct": [-100, -50, -6, 4, 60, 100]}
    curved = Limits(**points, curve_speed_pct=[-90, -40, 0, 0, 50, 100])  # type: ignore[arg-type]
    curve = curved.curve()
    assert curve is not None
    points_of = curved.curve_command_pct, curved.curve_speed_pct
    forth, back = openings_of(0, points_of, 100)
    assert (forth.steps, back.steps) == ((4.0, 60.0, 100.0), (6.0, 50.0, 100.0))
    for steps in range(1, 126):
        # A command is one, however small.
        by_band = openings_of(5, (None, None), 125)[sign < 0].velocity(steps)
        expected = max(without_deadband(steps / 125, 0.05), 2e-6)
        assert by_band == pytest.approx(expected, abs=1e-12)
        by_curve = openings_of(0, points_of, 125)[sign < 0].velocity(steps)
        expected = max(abs(curve.velocity(sign * steps / 125)), 2e-6)
        assert by_curve == pytest.approx(expected, abs=1e-12)
