"""A message as the deployment file corrects it: every part of it, and each signal exactly."""

from pathlib import Path

import pytest
from cantools.database.can import Message, Signal
from cantools.database.can.formats.dbc import DbcSpecifics
from cantools.database.conversion import LinearConversion

from canshaper.codec.layout import Chosen
from canshaper.config.inputs import Checksum, Protected
from canshaper.config.schema import DeploymentConfig, DirectionFlags, Scaling
from canshaper.machine.corrections import Correction, chosen, corrected, scalings
from tests.machine.gateway_files import load
from tests.rigs.files import Machine


def velocity(*, signed: bool = True) -> Signal:
    """Eight bits with steps of 1."""
    return Signal("Velocity", 0, 8, is_signed=signed, conversion=LinearConversion(1, 0, False))


def multiplexed() -> Message:
    """A counter in every frame, and two kinds of frames, which two bits distinguish."""
    counter = Signal("Counter", 8, 8)
    kind = Signal("Kind", 16, 2, is_multiplexer=True)
    first = Signal("First", 0, 8, multiplexer_ids=[0], multiplexer_signal="Kind")
    last = Signal("Last", 0, 8, multiplexer_ids=[3], multiplexer_signal="Kind")
    return Message(0x100, "Kinds", 3, [first, last, counter, kind])


def section(**keys: object) -> Protected:
    """The section of a file that names a message."""
    return Protected.model_validate({"bus": "crane", "message": "Kinds", **keys})


def of(config: DeploymentConfig, **keys: object) -> DeploymentConfig:
    """The configuration with other keys in the command of slew, as they are."""
    slew = config.axes["slew"]
    command = slew.command.model_copy(update=keys)
    axes = {"slew": slew.model_copy(update={"command": command})}
    return config.model_copy(update={"axes": axes})


def test_every_other_part_of_the_message_stays() -> None:
    specifics = DbcSpecifics()
    message = Message(
        0x18FEF133,
        "Kinds",
        12,
        [velocity()],
        cycle_time=20,
        comment="of the crane",
        senders=["Joysticks"],
        dbc_specifics=specifics,
        is_extended_frame=True,
        is_fd=True,
        protocol="j1939",
    )
    result = corrected(message, section(cycle_ms=30), {})
    assert isinstance(result, Message)
    assert (result.frame_id, result.name, result.length) == (0x18FEF133, "Kinds", 12)
    assert (result.cycle_time, result.comment) == (30, "of the crane")
    assert (result.senders, result.dbc) == (["Joysticks"], specifics)
    assert (result.is_extended_frame, result.is_fd) == (True, True)
    assert result.protocol == "j1939"


def test_a_message_that_is_right_is_the_one_of_the_dbc() -> None:
    message = multiplexed()
    assert corrected(message, section(), {}) is message


@pytest.mark.parametrize(("value", "there"), [(0, "First"), (3, "Last")])
def test_frames_of_one_kind_are_a_plain_message(value: int, there: str) -> None:
    result = corrected(multiplexed(), section(multiplexor=value), {})
    assert isinstance(result, Message)
    assert {signal.name for signal in result.signals} == {there, "Counter", "Kind"}
    for signal in result.signals:
        assert signal.is_multiplexer is False
        assert signal.multiplexer_ids is None
        assert signal.multiplexer_signal is None


def test_a_kind_that_is_not_there_is_reported_with_those_that_are() -> None:
    says = "expected a value of Kind, got 2; there are 0, 3"
    assert corrected(multiplexed(), section(multiplexor=2), {}) == says


@pytest.mark.parametrize(
    ("keys", "alone"),
    [
        ({}, False),
        ({"alive_counter": "Counter"}, False),
        ({"alive_counter": "First"}, True),
        ({"checksum": Checksum(signal="First", kind="xor")}, True),
        ({"checksum": Checksum(signal="Counter", kind="xor")}, False),
    ],
)
def test_protection_is_of_the_frames_that_are_meant_or_of_all(
    keys: dict[str, object], *, alone: bool
) -> None:
    expected = Chosen("Kind", 0, alone)
    assert chosen(multiplexed(), section(multiplexor=0, **keys)) == expected


@pytest.mark.parametrize(
    ("full", "magnitude", "signed", "expected"),
    [
        (127.0, False, True, (-128.0, 127.0)),
        (126.0, False, True, (-126.0, 127.0)),
        (100.0, False, True, (-100.0, 100.0)),
        (254.0, True, False, (0.0, 254.0)),
    ],
)
def test_the_range_is_that_of_the_full_scale_and_one_step_of_twos_complement(
    full: float, expected: tuple[float, float], *, magnitude: bool, signed: bool
) -> None:
    correction = Correction(Scaling(full=full), magnitude)
    message = Message(0x100, "Kinds", 1, [velocity(signed=signed)])
    result = corrected(message, section(), {"Velocity": correction})
    assert isinstance(result, Message)
    (signal,) = result.signals
    assert (signal.minimum, signal.maximum) == expected


@pytest.mark.parametrize(("full", "expected"), [(127.0, (-128.0, 127.0)), (126.0, (-126.0, 127.0))])
def test_a_whole_step_needs_no_rounding(
    monkeypatch: pytest.MonkeyPatch, full: float, expected: tuple[float, float]
) -> None:
    monkeypatch.setattr("canshaper.machine.corrections.STEP_ROUNDING", 0.0)
    correction = Correction(Scaling(full=full), magnitude=False)
    message = Message(0x100, "Kinds", 1, [velocity()])
    result = corrected(message, section(), {"Velocity": correction})
    assert isinstance(result, Message)
    assert (result.signals[0].minimum, result.signals[0].maximum) == expected


def test_both_signals_of_a_rocker_have_no_negative_values(machine: Machine) -> None:
    config = of(machine.load().config, full=80.0, negative="Back")
    correction = Correction(config.axes["slew"].command, magnitude=True)
    assert scalings(config, "crane", "JoystickLeft") == {"Slew": correction, "Back": correction}


def test_a_velocity_with_direction_flags_has_no_negative_values(machine: Machine) -> None:
    flags = DirectionFlags(neutral="Mid", positive="Right", negative="Left")
    config = of(machine.load().config, full=80.0, flags=flags)
    correction = Correction(config.axes["slew"].command, magnitude=True)
    assert scalings(config, "crane", "JoystickLeft") == {"Slew": correction}


@pytest.mark.parametrize("bus", ["joysticks", "machine"])
def test_a_joystick_that_is_passed_on_has_its_scaling_on_both_buses(
    tmp_path: Path, bus: str
) -> None:
    config = of(load(tmp_path).config, full=80.0)
    correction = Correction(config.axes["slew"].command, magnitude=False)
    assert scalings(config, bus, "JoystickLeft") == {"Slew": correction}
