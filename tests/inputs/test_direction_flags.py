"""A joystick with direction flags at the controller: what moves, and what a contradiction stops."""

import pytest

from canshaper.shaping.states import State
from tests.rigs.forwarder import Make, Rig, velocity

YAML = {
    "signal: Slew, neutral_pct: 2": (
        "signal: Slew, flags: { neutral: SlewNeutral, negative: SlewNegative,"
        " positive: SlewPositive }"
    )
}
DBC = {
    ' SG_ Slew : 0|16@1- (0.1,0) [-100|100] "%" SHAPER': (
        ' SG_ SlewNeutral : 0|2@1+ (1,0) [0|3] "" SHAPER\n'
        ' SG_ SlewNegative : 2|2@1+ (1,0) [0|3] "" SHAPER\n'
        ' SG_ SlewPositive : 4|2@1+ (1,0) [0|3] "" SHAPER\n'
        ' SG_ Slew : 6|10@1+ (0.1,0) [0|100] "%" SHAPER'
    ),
    'VAL_ 272 Slew 32766 "Error" 32767': 'VAL_ 272 Slew 1022 "Error" 1023',
}


def joystick(neutral: int, negative: int, positive: int, position: int) -> dict[str, int]:
    return {
        "SlewNeutral": neutral,
        "SlewNegative": negative,
        "SlewPositive": positive,
        "Slew": position,
    }


CENTRE = joystick(1, 0, 0, 0)
LEFT, RIGHT = joystick(0, 1, 0, 1000), joystick(0, 0, 1, 1000)


@pytest.fixture
def flagged(changed_rig: Make) -> Rig:
    """Ready, the joystick in neutral."""
    rig = changed_rig(YAML, DBC)
    rig.run(3, **CENTRE)
    assert rig.state() is State.READY
    return rig


def test_the_flags_show_the_way(flagged: Rig) -> None:
    assert velocity(flagged.run(100, **RIGHT)) > 90
    assert velocity(flagged.run(200, **LEFT)) < -90
    assert velocity(flagged.run(300, **CENTRE)) == 0
    assert flagged.state() is State.READY


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (joystick(0, 1, 1, 1000), "JOYSTICK_CONTRADICTORY"),
        (joystick(1, 0, 0, 1000), "JOYSTICK_CONTRADICTORY"),
        (joystick(0, 2, 1, 1000), "JOYSTICK_ERROR"),
        (joystick(0, 0, 1, 1001), "JOYSTICK_OUT_OF_RANGE"),
        (joystick(0, 0, 1, 1023), "JOYSTICK_NOT_AVAILABLE"),
    ],
)
def test_what_is_no_joystick_stops_through_the_filter_within_its_time(
    flagged: Rig, raw: dict[str, int], reason: str
) -> None:
    flagged.run(100, **RIGHT)
    sent = flagged.run(1, **raw)
    assert flagged.state() is State.STOPPING
    assert flagged.reason() == reason
    assert sent["SlewStatus"]["Reason"] == flagged.controller.axes["slew"].axis.reason
    assert velocity(sent) > 50  # not at once
    ticks = 1
    while flagged.state() is State.STOPPING:
        assert velocity(flagged.run(1, **raw)) >= 0
        ticks += 1
    assert ticks <= 101  # stop_s is 2 s
    assert velocity(flagged.run(20, **raw)) == 0
    assert flagged.reason() == reason  # what is waited for
    assert flagged.count("InvalidSignals") == ticks + 20
    # and back only through neutral
    assert velocity(flagged.run(20, **RIGHT)) == 0
    assert flagged.reason() == "JOYSTICK_NOT_NEUTRAL"
    flagged.run(2, **CENTRE)
    assert flagged.state() is State.READY


def test_a_contradiction_keeps_the_axis_from_getting_ready(changed_rig: Make) -> None:
    rig = changed_rig(YAML, DBC)
    rig.run(20, **joystick(1, 1, 0, 0))
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "JOYSTICK_CONTRADICTORY")


def test_a_slow_way_through_neutral_stops_nothing(flagged: Rig) -> None:
    """Neutral switch and direction switches open and close one after the other."""
    way = [joystick(0, 0, 1, p) for p in range(1000, -1, -25)]
    way += [joystick(0, 0, 0, 0), joystick(1, 0, 0, 0), joystick(1, 0, 0, 40), joystick(0, 0, 0, 0)]
    way += [joystick(0, 1, 0, p) for p in range(0, 1001, 25)]
    for raw in way:
        flagged.run(2, **raw)
        assert flagged.state() in (State.READY, State.ACTIVE)
    assert velocity(flagged.run(100, **LEFT)) < -90
    assert flagged.count("InvalidSignals") == 0
