"""A rocker with a signal for each direction: one command, or none; and back into both signals."""

from typing import Any

import cantools
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.message import SentMessage
from canshaper.codec.velocity import FlagsCodec, RockerVelocity, ValveCodec, VelocitySignal
from canshaper.shaping.states import Reason
from tests.rigs.files import ROOT, Machine
from tests.rigs.sent import command_raw

network: Any = cantools.database.load_file(ROOT / "dbc" / "rotator.dbc")
ROCKER = network.get_message_by_name("RotatorRocker")
LEFT, RIGHT = (
    next(s for s in ROCKER.signals if s.name == n) for n in ("RotateLeft", "RotateRight")
)
rocker = RockerVelocity(VelocitySignal.of(LEFT), VelocitySignal.of(RIGHT))


def read(left: int, right: int) -> float | Reason:
    return rocker.read({"RotateLeft": left, "RotateRight": right})


@pytest.mark.parametrize(
    ("left", "right", "command"),
    [
        (0, 0, 0.0),
        (250, 0, 1.0),
        (0, 250, -1.0),
        (0, 125, -0.5),
        (12, 12, 0.0),  # noise in neutral
        (13, 13, Reason.JOYSTICK_CONTRADICTORY),
        (250, 250, Reason.JOYSTICK_CONTRADICTORY),
        (251, 0, Reason.JOYSTICK_OUT_OF_RANGE),
        (0, 251, Reason.JOYSTICK_OUT_OF_RANGE),
        (254, 0, Reason.JOYSTICK_ERROR),
        (0, 255, Reason.JOYSTICK_NOT_AVAILABLE),
    ],
)
def test_it_is_one_command(left: int, right: int, command: float | Reason) -> None:
    assert read(left, right) == command


def test_a_signal_below_its_range_is_no_command() -> None:
    """An offset may reach below 0."""
    low = VelocitySignal("Low", 0.4, -10.0, 100.0, {})
    assert (
        RockerVelocity(low, VelocitySignal.of(RIGHT)).read({"Low": 0, "RotateRight": 0})
        is Reason.JOYSTICK_OUT_OF_RANGE
    )


def test_up_to_a_twentieth_of_both_is_noise_and_a_rounding_is_none() -> None:
    both = RockerVelocity(*(VelocitySignal(n, 1.0, 0.0, 100.0, {}) for n in ("P", "M")))
    assert both.read({"P": 5, "M": 5}) == 0.0
    assert both.read({"P": 6, "M": 6}) is Reason.JOYSTICK_CONTRADICTORY
    fine = RockerVelocity(*(VelocitySignal(n, 1.0, 0.0, 1e6, {}) for n in ("P", "M")))
    assert fine.read({"P": -1, "M": 0}) == pytest.approx(-1e-6)
    assert fine.read({"P": -2, "M": 0}) is Reason.JOYSTICK_OUT_OF_RANGE


@given(st.integers(-250, 250))
def test_what_is_put_is_read(steps: int) -> None:
    """As a valve, in a gateway: both signals hold what one command says."""
    codec = ValveCodec(SentMessage("b", ROCKER), LEFT, negative=RIGHT)
    raw = command_raw(codec, steps)
    assert (raw["RotateLeft"], raw["RotateRight"]) == (max(steps, 0), max(-steps, 0))
    assert codec.read(raw) == steps
    assert read(raw["RotateLeft"], raw["RotateRight"]) == pytest.approx(steps / 250)


@given(st.integers(-100, 100))
def test_the_same_with_an_offset(steps: int) -> None:
    """Raw 25 is 0 in both signals, and a falling one counts down from there."""
    for scale, offset in ((1.0, -25.0), (-1.0, 150.0)):
        conversion = BaseConversion.factory(scale, offset)
        positive, negative = (
            Signal(name, 8 * at, 8, conversion=conversion, minimum=0.0, maximum=100.0)
            for at, name in enumerate(("RotateLeft", "RotateRight"))
        )
        message = SentMessage("b", Message(1, "M", 2, [positive, negative]))
        codec = ValveCodec(message, positive, negative=negative)
        raw = command_raw(codec, steps)
        expected = {"RotateLeft": max(steps, 0), "RotateRight": max(-steps, 0)}
        assert message.fields.message.decode(message.sender().frame(raw).data) == expected
        assert codec.read(raw) == steps


def test_both_directions_at_once_are_no_command() -> None:
    codec = ValveCodec(SentMessage("b", ROCKER), LEFT, negative=RIGHT)
    assert codec.read({"RotateLeft": 5, "RotateRight": 5}) is None


@pytest.mark.parametrize(
    ("flags", "steps"),
    [((1, 0, 0), 0), ((0, 1, 0), 40), ((0, 0, 1), -40), ((0, 0, 0), None), ((0, 1, 1), None)],
)
def test_flags_of_a_direction(flags: tuple[int, int, int], steps: int | None) -> None:
    """Neutral, positive, negative, as a joystick of J1939 has them."""
    names = ("N", "P", "M")
    codec = ValveCodec(SentMessage("b", ROCKER), LEFT, FlagsCodec(names))
    raw = {"RotateLeft": 0 if flags[0] else 40, **dict(zip(names, flags, strict=True))}
    assert codec.read(raw) == steps
    if steps is not None:
        raw = command_raw(codec, steps)
        assert tuple(raw[n] for n in names) == flags
        assert raw["RotateLeft"] == abs(steps)
    assert codec.read({**raw, "RotateLeft": 40, "N": 1, "P": 0, "M": 0}) == 0


def test_it_has_flags_or_another_signal(machine: Machine) -> None:
    flags = "flags: { neutral: A, negative: B, positive: C }"
    machine.in_yaml("signal: Slew,", f"signal: Slew, negative: Reset, {flags},")
    assert any("expected one of flags and negative, got both" in p for p in machine.problems())
