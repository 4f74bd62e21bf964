"""Counters and their places: an administrator reads the status message, not the log."""

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.controller.valve_messages import Counters

COUNTED = {
    "WrongLength": {"WRONG_LENGTH"},
    "UnknownId": {"UNKNOWN_ID"},
    "ErrorFrames": {"ERROR_FRAME", "BUS_OFF", "BUS_PASSIVE"},
    "InvalidSignals": {"INVALID_SIGNAL", "CHECKSUM", "COUNTER_REPEATED", "COUNTER_JUMP"},
    "SendFailures": {"SEND_FAILED", "NOT_CONFIRMED"},
    "MissedDeadlines": {"MISSED_DEADLINE"},
}
# Named as the last fault only: the message has no counter for them.
NAMED_ONLY = {
    "BUS_ERROR",
    "SECOND_SENDER",
    "FRAMES_LOST",
    "BUS_GONE",
    "BUS_DOWN",
    "ADDRESS_LOST",
    "NOT_FOLLOWING",
    "FEEDBACK_LOST",
    "HEARTBEAT_LOST",
    "NODE_EMERGENCY",
    "OUTPUT_REFUSED",
    "DECODERS_DISAGREE",
    "BUS_WRONG_DEVICE",
}


def test_every_fault_is_here() -> None:
    names = set().union(*COUNTED.values()) | NAMED_ONLY | {"NONE"}
    assert names == set(FrameFault.__members__)


@pytest.mark.parametrize("fault", [f for f in FrameFault if f is not FrameFault.NONE])
def test_a_fault_is_counted_once_and_named(fault: FrameFault) -> None:
    counters = Counters()
    assert counters.status() == {**dict.fromkeys(COUNTED, 0), "LastFault": 0}
    counters.add(fault)
    counters.add(fault, 3)
    expected = {name: 4 if fault.name in faults else 0 for name, faults in COUNTED.items()}
    assert counters.status() == {**expected, "LastFault": int(fault)}


def test_the_last_fault_is_named_and_earlier_ones_stay_counted() -> None:
    counters = Counters()
    counters.add(FrameFault.CHECKSUM)
    counters.add(FrameFault.BUS_GONE)
    assert counters.status()["InvalidSignals"] == 1
    assert counters.status()["LastFault"] == int(FrameFault.BUS_GONE)
