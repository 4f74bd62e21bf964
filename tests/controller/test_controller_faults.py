"""The controller when the machine PC fails it: frames not sent, ticks missed, two buses, status."""

from typing import Any

import pytest

from canshaper.protocols.interface import BusProtocol
from canshaper.shaping.states import State
from tests.rigs.forwarder import Make, Rig

VALVES = ("SlewCommand", "NearFarCommand", "LiftCommand")
TWO_BUSES = {
    "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }": (
        "crane: { interface: socketcan, channel: vcan0 }\n"
        "  boom: { interface: socketcan, channel: vcan1 }"
    ),
    "valve: { bus: crane": "valve: { bus: boom",
}
SLOW_VALVE = {"BO_ 512 20;": "BO_ 512 40;"}


def still(sent: dict[str, dict[str, Any]]) -> bool:
    return all(sent[v]["Velocity"] == 0 for v in VALVES if v in sent)


def swing(rig: Rig) -> tuple[float, float]:
    model = rig.controller.axes["slew"].axis.sway
    assert model
    return model.angle, model.rate


# -- sending ---------------------------------------------------------------------------------------


def test_a_valve_frame_not_sent_trips_its_axis_only(rig: Rig) -> None:
    rig.run(3)
    sent = rig.run(50, Slew=1000, Lift=1000)
    rig.controller.send_failed(sent["SlewCommand"][""])
    sent = rig.run(1, Slew=1000, Lift=1000)
    assert sent["SlewCommand"]["Velocity"] == 0
    assert (rig.state("slew"), rig.reason("slew")) == (State.TRIPPED, "SEND_FAILED")
    assert sent["SlewStatus"]["Reason"] == 66
    assert sent["LiftCommand"]["Velocity"] > 50
    assert rig.count("SendFailures") == 1


def test_a_status_frame_not_sent_is_only_counted(rig: Rig) -> None:
    rig.moving()
    sent: dict[str, dict[str, Any]] = {}
    while "ShaperStatus" not in sent:
        sent = rig.run(1, Slew=1000)
    for name in ("SlewStatus", "ShaperStatus"):
        rig.controller.send_failed(sent[name][""])
    rig.run(1, Slew=1000)
    assert rig.state() is State.ACTIVE
    assert rig.count("SendFailures") == 2


def test_a_neutral_frame_not_sent_trips_nothing(rig: Rig) -> None:
    rig.controller.send_failed(rig.run(3)["SlewCommand"][""])
    rig.run(1)
    assert rig.state() is State.READY
    assert rig.count("SendFailures") == 1


def test_a_trip_meets_the_valve_of_that_id_and_kind(changed_rig: Make) -> None:
    rig = changed_rig(dbc={" 513 ": " 2147484160 "})  # near_far on 0x200 too, but extended
    rig.run(3)
    sent = rig.run(50, Slew=1000, NearFar=1000)
    assert sent["SlewCommand"][""].can_id == sent["NearFarCommand"][""].can_id == 0x200
    rig.controller.send_failed(sent["SlewCommand"][""])
    rig.run(1, Slew=1000, NearFar=1000)
    assert (rig.state("slew"), rig.state("near_far")) == (State.TRIPPED, State.ACTIVE)
    rig.controller.send_failed(sent["NearFarCommand"][""])
    rig.run(1, Slew=1000, NearFar=1000)
    assert rig.state("near_far") is State.TRIPPED


def test_neutral_frames_are_neutral_whatever_moves(rig: Rig) -> None:
    rig.moving()
    frames = rig.controller.neutral_frames()
    assert [(f.bus, f.can_id, f.data[0]) for f in frames] == [
        ("crane", 0x200, 0),
        ("crane", 0x201, 0),
        ("crane", 0x202, 0),
    ]
    counted = rig.run(1, Slew=1000)["SlewCommand"]["AliveCounter"]
    assert counted == (frames[0].data[1] + 1) % 256


def test_a_protocol_that_cannot_leave_costs_no_valve_its_neutral(rig: Rig) -> None:
    class Raising(BusProtocol):
        def leave(self) -> None:
            raise LookupError("no leave")

    rig.controller._protocols = [Raising()]
    assert len(rig.controller.neutral_frames()) == 3
    assert str(rig.controller.not_neutral) == "no leave"
    rig.controller._protocols = []
    rig.controller.neutral_frames()
    assert rig.controller.not_neutral is None


# -- time ------------------------------------------------------------------------------------------


def test_a_stall_trips_what_moves_and_invalidates_the_joysticks(rig: Rig) -> None:
    rig.moving()
    rig.controller.stalled()
    assert still(rig.tick())
    assert (rig.state("slew"), rig.reason("slew")) == (State.TRIPPED, "LOOP_STALLED")
    assert rig.state("near_far") is State.NEUTRAL_WAIT
    assert rig.reason("near_far") == "JOYSTICK_TIMEOUT"


def test_after_a_stall_the_last_frame_seen_again_is_no_news(rig: Rig) -> None:
    rig.run(2)
    frame = rig.joystick()
    rig.receive(frame)
    rig.tick()
    rig.controller.stalled()
    rig.receive(frame)
    rig.tick()
    assert rig.reason() == "JOYSTICK_TIMEOUT"
    rig.receive(rig.joystick())
    rig.tick()
    assert rig.state() is State.READY


@pytest.mark.parametrize("missed", [1, 2, 4])
def test_missed_ticks_are_counted_and_the_model_swings_on(rig: Rig, missed: int) -> None:
    rig.moving()
    axis = rig.controller.axes["slew"].axis
    assert axis.sway
    judge = axis.sway.retuned(axis.sway.mode, axis.output.setpoint)
    for _ in range(missed):
        judge.step(axis.output.setpoint)
    rig.receive(rig.joystick(Slew=1000))
    rig.tick(missed)
    judge.step(axis.output.setpoint)
    assert swing(rig) == pytest.approx((judge.angle, judge.rate))
    assert rig.count("MissedDeadlines") == missed


@pytest.mark.parametrize("late", [[1], [2], [3], [1, 1, 1], [5, 0, 2], [1] * 9, [2, 3] * 4])
def test_a_slower_valve_loses_no_time_when_ticks_are_missed(
    changed_rig: Make, late: list[int]
) -> None:
    """Model time and real time stay together, wherever in the valve's cycle ticks are missed."""
    rig = changed_rig(dbc=SLOW_VALVE)
    steps = 0
    model = rig.controller.axes["slew"].axis.sway
    assert model
    kind = type(model)
    real = kind.step

    def counted(self: Any, velocity: float) -> None:
        nonlocal steps
        steps += self is model
        real(self, velocity)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kind, "step", counted)
        ticks = 0
        for missed in [0, 0, 0, *late, 0, 0, 0]:
            rig.tick(missed)
            ticks += 1 + missed
    assert steps == (ticks + 1) // 2


def test_a_loop_that_is_always_late_still_serves_every_valve(changed_rig: Make) -> None:
    rig = changed_rig(dbc=SLOW_VALVE)
    rig.tick()
    for _ in range(20):
        assert set(VALVES) <= rig.tick(1).keys()  # odd ticks only, every 40 ms


# -- cycles, status, buses -------------------------------------------------------------------------


def test_a_valve_of_40_ms_is_served_every_second_tick(changed_rig: Make) -> None:
    rig = changed_rig(dbc=SLOW_VALVE)
    served = ["SlewCommand" in rig.run() for _ in range(10)]
    assert served == [True, False] * 5
    sent = rig.run(60, Slew=1000)
    while "SlewCommand" not in sent:
        sent = rig.run(1, Slew=1000)
    assert sent["SlewCommand"]["Velocity"] > 50
    counts = [rig.run(1, Slew=1000).get("SlewCommand") for _ in range(4)]
    numbers = [c["AliveCounter"] for c in counts if c]
    assert numbers == [(numbers[0] + i) % 256 for i in range(2)]
    sent = rig.run(1, Slew=1000, Enable=0) | rig.run(1, Slew=1000, Enable=0)
    assert sent["SlewCommand"]["Velocity"] == 0


def test_a_slow_valve_does_not_slow_its_status(changed_rig: Make) -> None:
    rig = changed_rig(dbc=SLOW_VALVE)  # status every 100 ms, no multiple of 40 ms
    shown = [i for i in range(40) if "SlewStatus" in rig.tick()]
    assert shown == list(range(0, 40, 5))


def test_status_comes_in_its_cycle_and_with_every_transition(rig: Rig) -> None:
    reported: list[tuple[int, int, int]] = []
    for tick in range(200):
        sent = rig.run(1, Slew=800 if 20 <= tick < 60 else 0)
        if "SlewStatus" in sent:
            reported.append((tick, sent["SlewStatus"]["State"], sent["SlewStatus"]["Reason"]))
        assert ("SlewStatus" in sent) is (tick % 5 == 0 or bool(rig.controller.events))
        for event in rig.controller.events:
            if event.axis == "slew":
                assert reported[-1] == (tick, event.transition.new, event.transition.reason)
        assert ("ShaperStatus" in sent) is (tick % 25 == 0)
        rig.controller.events = [e for e in rig.controller.events if e.axis == "none"]
    assert [s for _, s, _ in reported][:1] == [State.READY]
    assert {s for _, s, _ in reported} == {State.READY, State.ACTIVE}


def test_status_shows_joystick_and_valve(rig: Rig) -> None:
    rig.run(3)
    sent: dict[str, dict[str, Any]] = {}
    rig.run(150, Slew=800)
    while "SlewStatus" not in sent:
        sent = rig.run(1, Slew=800)
    assert sent["SlewStatus"]["RawCommand"] == 80
    assert sent["SlewStatus"]["ShapedCommand"] == pytest.approx(80, abs=1.5)
    assert sent["SlewStatus"]["PredictedSway"] != 0


def test_joysticks_and_valves_on_two_buses(changed_rig: Make) -> None:
    rig = changed_rig(yaml=TWO_BUSES)
    rig.run(3)
    sent = rig.run(50, Slew=1000)
    assert sent["SlewCommand"][""].bus == "boom"
    assert sent["SlewCommand"]["Velocity"] > 50
    assert {f.bus for f in rig.controller.neutral_frames()} == {"boom"}
    while "SlewStatus" not in sent:
        sent = rig.run(1, Slew=1000)
    assert sent["SlewStatus"][""].bus == "crane"
    for _ in range(7):  # the joystick's frames on the valves' bus are none of the joystick
        rig.receive(rig.joystick(Slew=1000)._replace(bus="boom"))
        rig.tick()
    assert rig.state() is State.STOPPING
    assert rig.count("UnknownId") == 7
