"""Signals of valves, and bits that no one sets: what is read of the DBC, once."""

from typing import Any

import pytest

from canshaper.config.schema import Command, Valve
from canshaper.gate.signals import Scale, bits_of, command_of, field_of, rest_of
from tests.gate.test_decoder import message


@pytest.mark.parametrize(
    ("signal", "rest"),
    [
        ("8@1- (1,0) [-100|100]", {0}),
        ("8@1+ (0.3,-1) [-1|10]", {3}),
        ("8@1+ (1,0) [0|100]", set()),
        ("8@1- (1,0) [-100|0]", set()),
        ("32@1- (0.5,0.25) [-1|1]", {-0.5}),
    ],
)
def test_where_a_velocity_rests(signal: str, rest: set[float]) -> None:
    one = message(f"Signal : 0|{signal}", floats="Signal" if signal.startswith("32") else "")
    assert rest_of(one.signals[0]) == rest


def test_bits_of_both_byte_orders() -> None:
    one = message("Intel : 4|12@1+ (1,0) [0|0]", "Motorola : 39|16@0+ (1,0) [0|0]")
    intel, motorola = (field_of(one, name) for name in ("Intel", "Motorola"))
    assert [bits_of(intel, 8), bits_of(intel, 8, 1)] == [0xFFF0, 0x10]
    assert [bits_of(motorola, 8), bits_of(motorola, 8, 1)] == [0xFFFF << 32, 1 << 40]


def test_a_command_that_the_file_corrects() -> None:
    one = message("Speed : 0|8@1+ (1,-100) [-100|100]", "Side : 8|8@1+ (1,0) [0|255]")
    of = Scale(one.signals[0], Command(joystick="a", signal="Speed", invert=True), magnitude=False)
    assert (of.scale, of.offset) == (-1, 100)
    keys: dict[str, Any] = {"bus": "crane", "message": "Message", "timeout_ms": 100}
    sides = {"signal": "Side", "neutral": 3, "positive": 5, "negative": 7}
    command = command_of(one, Valve(**keys, signal="Speed", direction=sides), None, one)
    assert command.signs == {(3,): 0, (5,): 1, (7,): -1}
    rocker = Command(joystick="a", signal="Speed", negative="Side", full=50)
    back = command_of(one, Valve(**keys, signal="Speed"), rocker, one).back
    assert back is not None
    assert back.full == 50
