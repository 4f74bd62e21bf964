"""Codecs of joysticks and valves, judged by plain cantools."""

import struct
from typing import Any

import cantools
import pytest
from cantools.database.can import Message
from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.frame import Frame
from canshaper.codec.layout import Layout
from canshaper.codec.message import UNPROTECTED, Protection, SentMessage
from canshaper.codec.signals import named_fault
from canshaper.codec.velocity import ValveCodec, VelocitySignal
from canshaper.shaping.states import Reason
from tests.rigs.sent import command_frame

# One message of every kind of signal: J1939's 10 bits with an offset, big-endian, float, falling.
DBC = """VERSION ""

BU_: A

BO_ 1 Joystick: 8 A
 SG_ Joystick : 0|10@1+ (0.2,-100) [-100|100] "%" A
 SG_ Enable : 10|2@1+ (1,0) [0|3] "" A
 SG_ Motorola : 23|12@0- (0.1,0) [-100|100] "%" A
 SG_ Plain : 32|8@1- (1,0) [-100|100] "%" A

BO_ 2 FloatJoystick: 5 A
 SG_ Joystick : 0|32@1- (50,0) [-100|100] "%" A
 SG_ Enable : 32|2@1+ (1,0) [0|3] "" A

BO_ 3 Offset: 8 A
 SG_ Velocity : 8|8@1+ (0.8,-100) [-100|100] "%" A
 SG_ Counter : 0|4@1+ (1,0) [0|15] "" A
 SG_ Unused : 16|8@1+ (1,0) [0|255] "" A
 SG_ Ratio : 32|32@1- (1,0) [0|0] "" A

BO_ 4 Motorola: 4 A
 SG_ Velocity : 7|16@0- (0.01,0) [-100|100] "%" A

BO_ 5 Falling: 2 A
 SG_ Velocity : 0|8@1- (-0.8,0) [-100|100] "%" A

BA_DEF_ SG_ "GenSigStartValue" FLOAT -100000 100000;
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_ "GenSigStartValue" SG_ 3 Unused 255;
BA_ "GenSigStartValue" SG_ 3 Ratio 1.5;
VAL_ 1 Joystick 1021 "Parameter error" 1022 "Error indicator" 1023 "Not available" ;
VAL_ 1 Plain 0 "Centre" 50 "SNA" 51 "Defective" ;
SIG_VALTYPE_ 2 Joystick : 1;
SIG_VALTYPE_ 3 Ratio : 1;
"""
custom: Any = cantools.database.load_string(DBC, "dbc")


def signal(message: Message, name: str) -> Any:
    return message.get_signal_by_name(name)


def velocity(message: str, name: str = "Joystick") -> VelocitySignal:
    return VelocitySignal.of(signal(custom.get_message_by_name(message), name))


def read(message: str, data: bytes) -> tuple[dict[str, Any], float | Reason]:
    raw = Layout(custom.get_message_by_name(message)).decode(data)
    return raw, velocity(message).read(raw)


def valve(message: str, counter: str | None = None) -> ValveCodec:
    definition = custom.get_message_by_name(message)
    count = signal(definition, counter) if counter else None
    protection = Protection(count.name, 1 << count.length) if count else UNPROTECTED
    shared = SentMessage("b", definition, protection=protection)
    return ValveCodec(shared, signal(definition, "Velocity"))


def sent(codec: ValveCodec, steps: int) -> Frame:
    return command_frame(codec, steps)


def raw_joystick(joystick: int) -> bytes:
    data = custom.get_message_by_name("Joystick").encode(
        {"Joystick": joystick, "Enable": 1, "Motorola": 0, "Plain": 0}, scaling=False, strict=False
    )
    assert isinstance(data, bytes)
    return data


# -- joysticks ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("raw", "command"),
    [
        (500, 0.0),
        (0, -1.0),
        (1000, 1.0),
        (501, 0.002),
        (1001, Reason.JOYSTICK_OUT_OF_RANGE),
        (1020, Reason.JOYSTICK_OUT_OF_RANGE),
        (1021, Reason.JOYSTICK_ERROR),
        (1022, Reason.JOYSTICK_ERROR),  # would be 104.4 % when scaled
        (1023, Reason.JOYSTICK_NOT_AVAILABLE),
    ],
)
def test_codes_are_distinguished_from_commands(raw: int, command: float | Reason) -> None:
    values, got = read("Joystick", raw_joystick(raw))
    assert values["Joystick"] == raw
    assert got == pytest.approx(command)


@pytest.mark.parametrize(
    ("raw", "command"),
    [
        (50, Reason.JOYSTICK_NOT_AVAILABLE),
        (51, Reason.JOYSTICK_ERROR),
        (0, 0.0),
        (49, 0.49),
        (52, 0.52),
    ],
)
def test_codes_within_the_range_are_no_commands(raw: int, command: float | Reason) -> None:
    assert velocity("Joystick", "Plain").read({"Plain": raw}) == command


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Not Available", Reason.JOYSTICK_NOT_AVAILABLE),
        ("NotAvailable", Reason.JOYSTICK_NOT_AVAILABLE),
        ("not_available", Reason.JOYSTICK_NOT_AVAILABLE),
        ("Unavailable", Reason.JOYSTICK_NOT_AVAILABLE),
        ("SNA", Reason.JOYSTICK_NOT_AVAILABLE),
        ("N/A", Reason.JOYSTICK_NOT_AVAILABLE),
        ("Slew_SNA", Reason.JOYSTICK_NOT_AVAILABLE),
        ("Error", Reason.JOYSTICK_ERROR),
        ("Err", Reason.JOYSTICK_ERROR),
        ("ERROR_2", Reason.JOYSTICK_ERROR),
        ("ErrorCode", Reason.JOYSTICK_ERROR),
        ("sensor_error", Reason.JOYSTICK_ERROR),
        ("sensorerr", Reason.JOYSTICK_ERROR),
        ("SensorFault", Reason.JOYSTICK_ERROR),
        ("modefault", Reason.JOYSTICK_ERROR),
        ("Faulty", Reason.JOYSTICK_ERROR),
        ("invalid", Reason.JOYSTICK_ERROR),
        ("Not valid", Reason.JOYSTICK_ERROR),
        ("Reserved", Reason.JOYSTICK_ERROR),
    ],
)
def test_names_that_dbc_files_give_to_codes(name: str, reason: Reason) -> None:
    text = DBC.replace('50 "SNA"', f'50 "{name}"')
    message = cantools.database.load_string(text, "dbc").get_message_by_name("Joystick")
    assert VelocitySignal.of(signal(message, "Plain")).read({"Plain": 50}) == reason


@pytest.mark.parametrize(
    "name",
    [
        "Default",
        "DEFAULT",
        "Factory default",
        "Interrupted",
        "Terrain",
        "Preserved",
        "Snap",
        "Fast",
    ],
)
def test_ordinary_words_say_no_error_but_their_values_are_no_velocities(name: str) -> None:
    text = DBC.replace('50 "SNA"', f'50 "{name}"')
    message = cantools.database.load_string(text, "dbc").get_message_by_name("Joystick")
    assert named_fault(name) is None
    velocity = VelocitySignal.of(signal(message, "Plain"))
    assert velocity.read({"Plain": 50}) == Reason.JOYSTICK_ERROR


@pytest.mark.parametrize(
    ("value", "command"),
    [
        (0.0, 0.0),
        (2.0, 1.0),
        (-1.0, -0.5),
        (2.1, Reason.JOYSTICK_OUT_OF_RANGE),
        (float("nan"), Reason.JOYSTICK_NOT_A_NUMBER),
        (float("inf"), Reason.JOYSTICK_NOT_A_NUMBER),
        (float("-inf"), Reason.JOYSTICK_NOT_A_NUMBER),
        (3.4e38, Reason.JOYSTICK_OUT_OF_RANGE),
    ],
)
def test_float_joysticks(value: float, command: float | Reason) -> None:
    assert read("FloatJoystick", struct.pack("<fB", value, 1))[1] == command


@pytest.mark.parametrize(("raw", "command"), [(3, 1.0), (-3, -1.0)])
def test_full_deflection_is_full_in_spite_of_rounding(raw: int, command: float) -> None:
    """3 steps of 0.1 are a little more than 0.3 in floating point."""
    assert VelocitySignal("S", 0.1, 0.0, 0.3, {}).read({"S": raw}) == command


@pytest.mark.parametrize("switch", [0, 1, 2, 3])
def test_switches_come_raw(switch: int) -> None:
    data = bytearray(raw_joystick(500))
    data[1] = data[1] & 0b11 | switch << 2
    values, _ = read("Joystick", bytes(data))
    assert values["Enable"] == switch


@given(data=st.binary(min_size=8, max_size=8))
def test_every_frame_decodes_to_a_command_or_a_fault(data: bytes) -> None:
    message = custom.get_message_by_name("Joystick")
    raw = Layout(message).decode(data)
    judge = message.decode(data, decode_choices=False)
    named = message.decode(data, decode_choices=True)
    assert isinstance(judge, dict) and isinstance(named, dict)
    for name in ("Joystick", "Motorola", "Plain"):
        command, scaled = velocity("Joystick", name).read(raw), judge[name]
        assert isinstance(scaled, int | float)
        if isinstance(command, Reason):
            coded = not isinstance(named[name], int | float) and str(named[name]) != "Centre"
            assert coded or abs(scaled) > 100
        else:
            assert command == pytest.approx(scaled / 100)
            assert -1.0 <= command <= 1.0


# -- valves ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "steps", "data"),
    [
        ("Offset", 0, "00 7d ff 00 00 00 c0 3f"),  # raw 125 is 0 %; the others at their start value
        ("Offset", -125, "00 00 ff 00 00 00 c0 3f"),
        ("Offset", 125, "00 fa ff 00 00 00 c0 3f"),
        ("Motorola", 10_000, "27 10 00 00"),
        ("Motorola", -1, "ff ff 00 00"),
        ("Falling", 125, "83 00"),
        ("Falling", -125, "7d 00"),
    ],
)
def test_steps_become_bytes(message: str, steps: int, data: str) -> None:
    assert sent(valve(message), steps).data == bytes.fromhex(data)


@pytest.mark.parametrize("message", ["Offset", "Motorola", "Falling"])
def test_steps_are_judged_by_cantools(message: str) -> None:
    codec = valve(message)
    for steps in {-codec.steps, -codec.steps // 3, -1, 0, 1, codec.steps // 2, codec.steps}:
        judge = custom.get_message_by_name(message).decode(sent(codec, steps).data)
        assert isinstance(judge, dict)
        assert judge["Velocity"] == pytest.approx(100.0 * steps / codec.steps)
        raw = custom.get_message_by_name(message).decode(sent(codec, steps).data, scaling=False)
        assert isinstance(raw, dict)
        assert codec.read(raw) == steps


@pytest.mark.parametrize("message", ["Offset", "Motorola", "Falling"])
def test_steps_beyond_full_command_are_refused(message: str) -> None:
    codec = valve(message)
    for steps in (codec.steps + 1, -codec.steps - 1, 10**9):
        text = f"expected up to \\+-{codec.steps} steps, got {steps}"
        with pytest.raises(ValueError, match=text):
            sent(codec, steps)


def test_the_alive_counter_counts_every_frame_and_wraps() -> None:
    sender = valve("Offset", "Counter").message.sender()
    counts = [sender.frame().data[0] & 0xF for _ in range(34)]
    assert counts == [*range(1, 16), *range(16), 0, 1, 2]


def test_a_frame_that_is_refused_is_not_counted() -> None:
    codec = valve("Offset", "Counter")
    sender = codec.message.sender()
    with pytest.raises(ValueError, match=r"got 126$"):
        codec.put(sender.raw, 126)
    assert sender.frame().data[0] & 0xF == 1


def test_start_values_beyond_the_bits_are_held_within() -> None:
    text = DBC.replace("SG_ 3 Unused 255", "SG_ 3 Unused 99999")
    message = cantools.database.load_string(text, "dbc").get_message_by_name("Offset")
    assert SentMessage("b", message).sender().frame({}).data[2] == 255
