"""Status messages: encoded, decoded, and their tables in the DBC files."""

import pickle
from pathlib import Path
from typing import Any

import cantools
import pytest

from canshaper.codec.codecs import Sender
from canshaper.codec.frame import FrameFault
from canshaper.codec.status import (
    AXIS_STATUS,
    IDENTITY,
    SERVICE_STATUS,
    StatusCodec,
    required_names,
)
from canshaper.shaping.states import Reason, State
from tests.rigs.reports import report

SHIPPED = Path(__file__).parents[2] / "dbc" / "forwarder.dbc"
shipped: Any = cantools.database.load_file(SHIPPED)


def axis_status(*values: Any) -> dict[str, Any]:
    message = shipped.get_message_by_name("SlewStatus")
    frame = StatusCodec(Sender("b", message), AXIS_STATUS).frame(report(*values))
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
    codec = StatusCodec(Sender("b", message), SERVICE_STATUS)
    names = [one.name for one in SERVICE_STATUS]
    decoded = message.decode(codec.frame({**dict.fromkeys(names, 10**6), "LastFault": 7}).data)
    assert isinstance(decoded, dict)
    assert decoded.pop("MissedDeadlines") == 65535
    assert str(decoded.pop("LastFault")) == "BUS_ERROR"
    assert set(decoded.values()) == {255}


def test_a_status_is_decoded_as_it_was_encoded() -> None:
    codec = StatusCodec(Sender("b", shipped.get_message_by_name("SlewStatus")), AXIS_STATUS)
    values = codec.decode(
        codec.frame(report(State.ACTIVE, Reason.JOYSTICK_MOVED, 0.5, 0.25, 1.5, active_set=3)).data
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
    codec = StatusCodec(Sender("b", shipped.get_message_by_name("SlewStatus")), AXIS_STATUS)
    values = codec.decode(codec.frame(report(State.READY, 254)).data)
    assert values is not None
    assert values["Reason"] == 254
    shown = {one.name: one.shown(values[one.name]) for one in codec.fields}
    assert (shown["State"], shown["Reason"]) == ("READY", "unknown (254)")


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
