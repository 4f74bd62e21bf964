"""Frames of another sender with the id of a valve: two controllers must not drive one crane."""

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.shaping.states import State
from tests.rigs.forwarder import SLOW_VALVE, Make, Rig

# How long the other one must be silent before a reset counts: 1 s, in ticks.
SILENT_TICKS = 50
FOREIGN = Frame("crane", 0x200, False, b"\x00\x00")
TRIPPED = (State.TRIPPED, "SECOND_SENDER")


def slew(rig: Rig) -> tuple[State, str]:
    return rig.state("slew"), rig.reason("slew")


@pytest.mark.parametrize("data", [b"\x00\x00", b"\x7d\x05", b"", bytes(8)])
def test_its_valve_is_neutral_in_the_next_tick_and_no_other(rig: Rig, data: bytes) -> None:
    """Whatever the frame carries: that it is there is the fault."""
    rig.run(3)
    rig.run(50, Slew=1000, Lift=1000)
    rig.receive(FOREIGN._replace(data=data))
    sent = rig.run(1, Slew=1000, Lift=1000)
    assert sent["SlewCommand"]["Velocity"] == 0
    assert slew(rig) == TRIPPED
    assert sent["SlewStatus"]["Reason"] == 70
    assert sent["LiftCommand"]["Velocity"] > 50
    assert rig.controller.counters.last_fault is FrameFault.SECOND_SENDER


def test_it_is_reported_before_anything_moves(rig: Rig) -> None:
    rig.receive(FOREIGN)
    rig.run(1)
    assert slew(rig) == TRIPPED
    assert rig.state("near_far") is State.READY


def reset(rig: Rig) -> None:
    """A rising edge of the reset switch, joystick in neutral."""
    rig.run(1, Reset=1)
    rig.run(1)


@pytest.mark.parametrize(("silent", "back"), [(SILENT_TICKS, False), (SILENT_TICKS + 1, True)])
def test_a_reset_counts_after_a_second_of_silence(rig: Rig, silent: int, back: bool) -> None:
    rig.moving()
    rig.receive(FOREIGN)
    rig.run(silent)  # the first of these ticks is that of the frame
    rig.run(1, Reset=1)
    assert (rig.state() is State.NEUTRAL_WAIT) is back
    rig.run(2)
    assert slew(rig) == ((State.READY, "JOYSTICK_NEUTRAL") if back else TRIPPED)


def test_a_reset_during_the_second_is_not_kept_for_later(rig: Rig) -> None:
    rig.moving()
    rig.receive(FOREIGN)
    rig.run(SILENT_TICKS - 10)
    rig.run(20, Reset=1)
    assert slew(rig) == TRIPPED
    rig.run(5)
    reset(rig)
    assert rig.state() is State.READY


def test_every_new_frame_begins_the_second_again(rig: Rig) -> None:
    rig.moving()
    rig.receive(FOREIGN)
    rig.run(SILENT_TICKS - 5)
    rig.receive(FOREIGN)
    rig.run(10)
    reset(rig)
    assert slew(rig) == TRIPPED


@pytest.mark.parametrize(
    ("frame", "fault"),
    [
        (FOREIGN._replace(can_id=0x300), FrameFault.SECOND_SENDER),  # status of the axis
        (FOREIGN._replace(can_id=0x310), FrameFault.SECOND_SENDER),  # status of the service
        (FOREIGN._replace(extended=True), FrameFault.UNKNOWN_ID),
        (FOREIGN._replace(bus="boom"), FrameFault.UNKNOWN_ID),
    ],
)
def test_only_the_message_of_a_valve_stops_a_valve(
    rig: Rig, frame: Frame, fault: FrameFault
) -> None:
    rig.moving()
    for _ in range(5):
        rig.receive(frame)
        rig.run(1, Slew=1000)
    assert [rig.state(axis) for axis in ("slew", "near_far", "lift")] == [
        State.ACTIVE,
        State.READY,
        State.READY,
    ]
    assert rig.controller.counters.last_fault is fault


def test_a_slow_valve_is_tripped_by_a_frame_between_its_own(changed_rig: Make) -> None:
    rig = changed_rig(dbc=SLOW_VALVE)
    rig.run(30)
    rig.run(50, Slew=1000)
    rig.receive(FOREIGN)
    sent = [rig.run(1, Slew=1000) for _ in range(10)]
    (valve,) = [s["SlewCommand"]["Velocity"] for s in sent if "SlewCommand" in s]
    assert valve == 0
    assert slew(rig) == TRIPPED
