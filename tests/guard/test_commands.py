"""Signals that no shipped machine has: a float joystick, commands in a joystick's own message."""

import struct
from pathlib import Path
from typing import Any

import cantools
import pytest

from canshaper.config.schema import Command, Valve
from canshaper.guard.bits import MOST_KNOWN, CommandBits, JoystickBits
from canshaper.guard.inputs import CommandedAxis

DBC = Path(__file__).parents[2] / "dbc"
FLOAT = """VERSION ""
NS_ :
BS_:
BU_: JOYSTICK SHAPER
BO_ 2 Joystick: 8 JOYSTICK
 SG_ Joystick : 0|32@1- (1,0) [-1|1] "" SHAPER
SIG_VALTYPE_ 2 Joystick : 1;
"""
OFFSET = """VERSION ""
NS_ :
BS_:
BU_: JOYSTICK SHAPER
BO_ 2 Joystick: 2 JOYSTICK
 SG_ Joystick : 0|16@1+ (0.1,-100) [-100|100] "%" SHAPER
"""


def network(name: str) -> Any:
    return cantools.database.load_file(DBC / name)


def valve(message: str, signal: str) -> Valve:
    return Valve(bus="crane", message=message, signal=signal, timeout_ms=100)


@pytest.mark.parametrize(
    ("value", "command"),
    [(0.5, 0.5), (-1.0, -1.0), (0.0, 0.0), (1.5, 0.0), (float("nan"), 0.0), (float("inf"), 0.0)],
)
def test_a_float_joystick(value: float, command: float) -> None:
    message = cantools.database.load_string(FLOAT, "dbc").get_message_by_name("Joystick")  # type: ignore[union-attr]
    bits = JoystickBits(message, Command(joystick="left", signal="Joystick"))
    assert bits.command(struct.pack("<fI", value, 0)) == command


@pytest.mark.parametrize(
    ("raw", "command"),
    [(0, -1.0), (500, -0.5), (1000, 0.0), (1250, 0.25), (2000, 1.0), (2001, 0.0)],
)
def test_a_joystick_whose_zero_is_in_the_middle(raw: int, command: float) -> None:
    message = cantools.database.load_string(OFFSET, "dbc").get_message_by_name("Joystick")  # type: ignore[union-attr]
    bits = JoystickBits(message, Command(joystick="left", signal="Joystick"))
    assert bits.command(struct.pack("<H", raw)) == pytest.approx(command)


@pytest.mark.slow
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
    message = network("j1939-bjm-avc.dbc").get_message_by_name("BJM1")
    flags = {"neutral": "XNeutral", "positive": "XPositive", "negative": "XNegative"}
    joystick = Command(joystick="left", signal="XPosition", flags=flags)  # type: ignore[arg-type]
    bits = CommandBits(message, valve("BJM1", "XPosition"), joystick)
    values = dict.fromkeys((s.name for s in message.signals), 0) | raw
    assert bits.steps(message.encode(values, scaling=False, strict=False, padding=True)) == steps


@pytest.mark.parametrize(
    ("left", "right", "steps"), [(0, 0, 0), (125, 0, 125), (0, 250, -250), (1, 1, None)]
)
def test_a_command_by_a_rocker_of_the_joystick(left: int, right: int, steps: int | None) -> None:
    message = network("rotator.dbc").get_message_by_name("RotatorRocker")
    joystick = Command(joystick="left", signal="RotateLeft", negative="RotateRight")
    bits = CommandBits(message, valve("RotatorRocker", "RotateLeft"), joystick)
    values = dict.fromkeys((s.name for s in message.signals), 0)
    values |= {"RotateLeft": left, "RotateRight": right}
    assert bits.steps(message.encode(values, scaling=False, strict=False)) == steps


def test_what_is_kept_of_a_joystick_is_bounded() -> None:
    message = network("forwarder.dbc").get_message_by_name("JoystickLeft")
    axis = CommandedAxis(JoystickBits(message, Command(joystick="left", signal="Slew")))
    for raw in range(MOST_KNOWN + 10):
        command = axis.learn(struct.pack("<hHI", raw - 1000, 0, 0))
        assert command == pytest.approx(
            (raw - 1000) / 1000 if 20 <= abs(raw - 1000) <= 1000 else 0.0
        )
    assert len(axis.joystick_commands) == 10
