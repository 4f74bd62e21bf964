"""The recorded drive gives the golden frames: bytes, order and tick."""

import cmath
import math
from collections.abc import Callable
from typing import Any

import pytest

from canshaper.shaping.states import Reason, State
from tests.golden.replay import DEPLOYMENTS, DRIVE, difference, golden, line, parsed, read, replay

# What the shaping takes from the mathematical library, correctly rounded square roots left out.
FUNCTIONS = [(math, n) for n in ("exp", "expm1", "log1p", "sin", "hypot")] + [(cmath, "exp")]


@pytest.mark.parametrize("name", DEPLOYMENTS)
def test_the_drive_gives_the_golden_frames(name: str) -> None:
    assert difference(read(golden(name)), replay(name, read(DRIVE))) == ""


@pytest.mark.parametrize("error", [1e-9, -1e-9])
@pytest.mark.parametrize("name", DEPLOYMENTS)
def test_the_frames_do_not_hang_on_the_last_bits_of_the_mathematical_library(
    monkeypatch: pytest.MonkeyPatch, name: str, error: float
) -> None:
    def wrong(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *arguments: function(*arguments) * (1.0 + error)

    for module, function in FUNCTIONS:
        monkeypatch.setattr(module, function, wrong(getattr(module, function)))
    assert difference(read(golden(name)), replay(name, read(DRIVE))) == ""


@pytest.mark.parametrize("name", DEPLOYMENTS)
def test_the_drive_goes_through_every_state(name: str) -> None:
    frames = [parsed(row)[1] for row in read(golden(name))]
    statuses = [f.data for f in frames if f.can_id in (0x300, 0x301, 0x302)]
    assert {data[0] & 15 for data in statuses} == {*map(int, State)}
    reasons = {
        Reason.JOYSTICK_TIMEOUT,
        Reason.JOYSTICK_ERROR,
        Reason.ENABLE_LOST,
        Reason.BYPASS_REQUESTED,
    }
    assert {data[1] for data in statuses} >= reasons


def test_a_line_is_read_as_it_was_written() -> None:
    for row in (
        "(0.020000) crane 110#0000000001000001",
        "(12.000000) crane 1ABCDEF0#0102",
        "(3.1) crane 7FF#",
    ):
        now_ns, frame = parsed(row)
        assert line(now_ns, frame) == row.replace("(3.1)", "(3.000001)")


def changed(rows: list[str], at: int, *new: str) -> list[str]:
    return [*rows[:at], *new, *rows[at + 1 :]]


def test_the_first_difference_is_named() -> None:
    rows = ["(0.020000) a 200#00", "(0.020000) a 201#00", "(0.060000) a 200#01"]
    assert difference(rows, rows) == ""
    one = "1 ticks differ, first tick 1 at 0.020 s:\n"
    assert difference(rows, changed(rows, 1, "(0.020000) a 201#02")) == (
        one + "  frame 1: was a 201#00, is a 201#02"
    )
    assert difference(rows, changed(rows, 1)) == one + "  frame 1: was a 201#00, is nothing"
    assert difference(rows, [rows[1], rows[0], rows[2]]).startswith(one + "  frame 0: was a 200#00")
    assert difference(rows, changed(rows, 2, "(0.080000) a 200#01")).startswith(
        "2 ticks differ, first tick 3 at 0.060 s:\n  frame 0: was a 200#01, is nothing"
    )
