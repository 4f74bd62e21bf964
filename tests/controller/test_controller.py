"""The controller on real frames: what it sends each tick, and what stops it."""

from typing import Any

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.shaping.states import State
from tests.rigs.forwarder import Rig

VALVES = ("SlewCommand", "NearFarCommand", "LiftCommand")
TICK_NS = 20_000_000
# stop_s of the shipped machine, 2 s, in ticks, and one in which it ends
STOP_TICKS = 100


def still(sent: dict[str, dict[str, Any]]) -> bool:
    return all(sent[v]["Velocity"] == 0 for v in VALVES)


def test_a_tick_is_punctual_by_default(rig: Rig) -> None:
    for _ in range(3):
        assert [*rig.controller.tick(rig.now_ns)]
        rig.now_ns += TICK_NS
    assert rig.count("MissedDeadlines") == 0


def test_every_valve_hears_every_tick_from_the_first(rig: Rig) -> None:
    for count in range(1, 600):
        sent = rig.tick()
        assert still(sent)
        assert [sent[v]["AliveCounter"] for v in VALVES] == [count % 256] * 3
    assert rig.state() is State.NEUTRAL_WAIT
    assert rig.reason() == "JOYSTICK_TIMEOUT"


def test_valve_frames_come_before_status_frames(rig: Rig) -> None:
    frames = list(rig.controller.tick(0))
    assert [f.can_id for f in frames] == [0x200, 0x201, 0x202, 0x300, 0x301, 0x302, 0x310]
    assert {f.bus for f in frames} == {"crane"}


def test_a_joystick_moves_its_own_axis_only(rig: Rig) -> None:
    rig.run(3)
    sent = rig.run(50, Slew=-1000)
    assert sent["SlewCommand"]["Velocity"] < -50
    assert sent["NearFarCommand"]["Velocity"] == sent["LiftCommand"]["Velocity"] == 0
    sent = rig.run(50, Lift=400)
    assert sent["LiftCommand"]["Velocity"] == pytest.approx(43, abs=0.8)  # 5 % deadband added


def test_one_joystick_does_not_enable_the_other(rig: Rig) -> None:
    for _ in range(5):
        rig.receive(rig.joystick("JoystickLeft"), rig.joystick("JoystickRight", Enable=0))
        rig.tick()
    for _ in range(50):
        rig.receive(
            rig.joystick("JoystickLeft", Slew=1000),
            rig.joystick("JoystickRight", Enable=0, Lift=999),
        )
        sent = rig.tick()
    assert sent["SlewCommand"]["Velocity"] > 50
    assert sent["LiftCommand"]["Velocity"] == 0


def test_silence_stops_the_axis_after_the_timeout(rig: Rig) -> None:
    rig.moving()
    # the last frame is one tick old in the first of these; it counts up to 100 ms
    for _ in range(5):
        assert rig.tick()["SlewCommand"]["Velocity"] > 50
        assert rig.state() is State.ACTIVE
    rig.tick()
    assert (rig.state(), rig.reason()) == (State.STOPPING, "JOYSTICK_TIMEOUT")
    for _ in range(STOP_TICKS):
        sent = rig.tick()
    assert still(sent)
    assert rig.state() is State.NEUTRAL_WAIT


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        ({"Slew": 32766}, "JOYSTICK_ERROR"),
        ({"Slew": 32767}, "JOYSTICK_NOT_AVAILABLE"),
        ({"Slew": 1001}, "JOYSTICK_OUT_OF_RANGE"),
        ({"Slew": -32768}, "JOYSTICK_OUT_OF_RANGE"),
        ({"Slew": 500, "Enable": 2}, "SWITCH_INVALID"),
        ({"Slew": 500, "Enable": 3}, "SWITCH_INVALID"),
    ],
)
def test_an_invalid_joystick_is_never_a_move(rig: Rig, raw: dict[str, int], reason: str) -> None:
    assert still(rig.run(20, **raw))
    rig.run(3)
    assert still(rig.run(20, **raw))
    assert rig.reason() == reason
    rig.run(3)
    rig.run(50, Slew=1000)
    speed = rig.run(1, Slew=1000)["SlewCommand"]["Velocity"]
    assert rig.count("InvalidSignals") == (80 if "Enable" in raw else 40)
    for _ in range(STOP_TICKS):
        sent = rig.run(1, **raw)
        assert 0 <= sent["SlewCommand"]["Velocity"] <= speed
        if rig.state() is State.STOPPING:
            assert rig.reason() == reason
    assert still(rig.run(1, **raw))
    assert rig.state() is State.NEUTRAL_WAIT


def test_anti_sway_off_gives_the_joystick_through_the_limits(rig: Rig) -> None:
    rig.run(3, AntiSwayOff=1)
    sent = rig.run(50, Slew=500, AntiSwayOff=1)
    assert rig.state() is State.BYPASS_ON
    assert sent["SlewCommand"]["Velocity"] == pytest.approx(52.5, abs=0.8)  # 5 % deadband added


@pytest.mark.parametrize(
    ("change", "name", "fault"),
    [
        ({"can_id": 0x123}, "UnknownId", FrameFault.UNKNOWN_ID),
        ({"extended": True}, "UnknownId", FrameFault.UNKNOWN_ID),
        ({"bus": "other"}, "UnknownId", FrameFault.UNKNOWN_ID),
        ({"cut": 7}, "WrongLength", FrameFault.WRONG_LENGTH),
        ({"cut": 0}, "WrongLength", FrameFault.WRONG_LENGTH),
        ({"cut": 9}, "WrongLength", FrameFault.WRONG_LENGTH),
    ],
)
def test_foreign_frames_are_counted_and_never_a_move(
    rig: Rig, change: dict[str, Any], name: str, fault: FrameFault
) -> None:
    def spoiled(**raw: int) -> Frame:
        frame = rig.joystick("JoystickLeft", **raw)
        if "cut" in change:
            return frame._replace(data=(frame.data + b"\0")[: change["cut"]])
        return frame._replace(**change)

    for _ in range(3):
        rig.receive(spoiled())
        assert still(rig.tick())
    for _ in range(47):
        rig.receive(spoiled(Slew=1000))
        sent = rig.tick()
        assert still(sent)
    assert rig.reason() == "JOYSTICK_TIMEOUT"
    while "ShaperStatus" not in sent:
        sent = rig.tick()
    assert sent["ShaperStatus"][name] == rig.count(name) == 50
    assert sent["ShaperStatus"]["LastFault"] == fault
    assert sum(rig.controller.counters.values.values()) == 50
