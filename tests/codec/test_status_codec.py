"""Status messages: encoded, decoded, and their tables in the DBC files."""

import pickle
from pathlib import Path
from typing import Any

import cantools
import pytest

from canshaper.codec.frame import FrameFault
from canshaper.codec.message import SentMessage
from canshaper.codec.status import (
    AXIS_STATUS,
    IDENTITY,
    SERVICE_STATUS,
    StatusCodec,
    required_names,
    status_faults,
)
from canshaper.shaping.states import Reason, State, Trust
from tests.rigs.reports import report
from tests.rigs.sent import status_frame

SHIPPED = Path(__file__).parents[2] / "dbc" / "forwarder.dbc"
shipped: Any = cantools.database.load_file(SHIPPED)


def axis_status(*values: Any) -> dict[str, Any]:
    message = shipped.get_message_by_name("SlewStatus")
    frame = status_frame(StatusCodec(SentMessage("b", message), AXIS_STATUS), report(*values))
    decoded = message.decode(frame.data, decode_choices=False)
    assert isinstance(decoded, dict)
    return decoded


def test_status_carries_what_it_gets() -> None:
    decoded = axis_status(State.ACTIVE, Reason.JOYSTICK_MOVED, 0.5, -0.25, 12.34)
    assert decoded == pytest.approx(
        {
            "State": 2,
            "ActiveSet": 0,
            "Reason": 2,
            "RawCommand": 50,
            "ShapedCommand": -25,
            "PredictedSway": 12.34,
        }
    )


@pytest.mark.parametrize(("sway", "shown"), [(1e9, 327.67), (-1e9, -327.68), (327.68, 327.67)])
def test_status_beyond_its_bits_stays_at_the_end(sway: float, shown: float) -> None:
    assert axis_status(State.READY, Reason.START, 0.0, 0.0, sway)["PredictedSway"] == shown


def test_counters_stop_at_their_largest_value() -> None:
    message = shipped.get_message_by_name("ShaperStatus")
    codec = StatusCodec(SentMessage("b", message), SERVICE_STATUS)
    names = [one.name for one in SERVICE_STATUS]
    decoded = message.decode(
        status_frame(codec, {**dict.fromkeys(names, 10**6), "LastFault": 7}).data
    )
    assert isinstance(decoded, dict)
    assert decoded.pop("MissedDeadlines") == 65535
    assert str(decoded.pop("LastFault")) == "BUS_ERROR"
    assert set(decoded.values()) == {255}


def test_a_status_is_decoded_as_it_was_encoded() -> None:
    codec = StatusCodec(SentMessage("b", shipped.get_message_by_name("SlewStatus")), AXIS_STATUS)
    values = codec.decode(
        status_frame(
            codec, report(State.ACTIVE, Reason.JOYSTICK_MOVED, 0.5, 0.25, 1.5, active_set=3)
        ).data
    )
    assert values == {
        "State": State.ACTIVE,
        "Reason": Reason.JOYSTICK_MOVED,
        "RawCommand": 50.0,
        "ShapedCommand": 25.0,
        "PredictedSway": 1.5,
        "ActiveSet": 3,
    }
    assert codec.decode(b"") is None


def test_a_status_can_be_sent_to_another_process() -> None:
    for table in (AXIS_STATUS, SERVICE_STATUS, IDENTITY):
        assert [one.name for one in pickle.loads(pickle.dumps(table))] == [o.name for o in table]


def test_a_code_of_another_version_is_shown_by_its_number() -> None:
    codec = StatusCodec(SentMessage("b", shipped.get_message_by_name("SlewStatus")), AXIS_STATUS)
    values = codec.decode(status_frame(codec, report(State.READY, 254)).data)
    assert values is not None
    assert values["Reason"] == 254
    shown = {one.name: one.shown(values[one.name]) for one in codec.fields}
    assert (shown["State"], shown["Reason"]) == ("READY", "unknown (254)")


def test_a_measurement_is_shown_as_a_number() -> None:
    shown = {one.name: one.shown(12.5) for one in AXIS_STATUS}
    assert (shown["SwingLength"], shown["State"]) == ("12.5", "unknown (12.5)")


def test_a_code_is_sent_as_it_is_whatever_the_scale_of_its_signal() -> None:
    """Old DBC files have their tables of raw values; a scale would move them."""
    message = text_message("SG_ Digest : 0|16@1+ (0.5,-10) [0|0]")
    codec = StatusCodec(SentMessage("b", message), IDENTITY)
    assert status_frame(codec, 0x1234).data == b"\x34\x12"
    assert codec.decode(b"\x34\x12") == {"Digest": 0x1234}


def test_what_a_status_message_lacks() -> None:
    assert status_faults(text_message("SG_ Digest : 0|16@1+ (1,0) [0|0]"), IDENTITY) == []
    signals = (
        "SG_ State : 0|4@1+ (0,0) [0|0]",
        "SG_ Reason : 8|6@1+ (1,0) [0|0]",
        "SG_ ShapedCommand : 32|32@1- (1,0) [0|0]",
        "SG_ SwaySensor : 16|1@1+ (1,0) [0|0]",
        "SG_ ActiveSet : 17|1@1- (1,0) [0|0]",  # no codes: any number of bits will do
    )
    assert status_faults(text_message(*signals), AXIS_STATUS) == [
        "lacks the signals RawCommand, PredictedSway",
        "State: expected an integer signal with a scale, got a scale of 0",
        f"Reason cannot carry {max(Reason)} with 6 bits",
        "ShapedCommand: expected an integer signal with a scale, got a float",
        f"SwaySensor cannot carry {max(Trust)} with 1 bits",
    ]


def text_message(*signals: str) -> Any:
    lines = "\n ".join(f'{line} "" A' for line in signals)
    floats = "SIG_VALTYPE_ 1 ShapedCommand : 1;\n" if len(signals) > 1 else ""
    size = 8 if len(signals) > 1 else 2
    text = f'VERSION ""\n\nBU_: A\n\nBO_ 1 M: {size} A\n {lines}\n\n{floats}'
    (message,) = cantools.database.load_string(text, "dbc").messages
    return message


def test_tables_of_the_dbc_are_the_numbers_of_the_program() -> None:
    for name in ("SlewStatus", "NearFarStatus", "LiftStatus"):
        message = shipped.get_message_by_name(name)
        for field, enum in (("State", State), ("Reason", Reason)):
            table = {n: str(text) for n, text in message.get_signal_by_name(field).choices.items()}
            assert table == {int(m): m.name for m in enum}
    faults = shipped.get_message_by_name("ShaperStatus").get_signal_by_name("LastFault").choices
    assert {n: str(text) for n, text in faults.items()} == {int(m): m.name for m in FrameFault}


def test_a_message_needs_no_optional_signal() -> None:
    needed = required_names(AXIS_STATUS)
    assert needed < {one.name for one in AXIS_STATUS}
    assert "SwaySensor" not in needed
    message = shipped.get_message_by_name("SlewStatus")
    assert needed <= {signal.name for signal in message.signals}
