"""An axis is stopped ahead of its end stops; a lost position means that it is as without them."""

import pytest

from canshaper.codec.frame import Frame
from canshaper.errors import ConfigError
from canshaper.shaping.states import Reason, State
from tests.rigs.files import ROOT
from tests.rigs.forwarder import Make, Rig

TIP = "bus: crane, message: TipPosition, signal: Radius, timeout_ms: 200"
ENDS = f"ends: {{ {TIP}, lowest: 2, highest: 8, margin: 0, full_speed: 1 }}"
# Behind the limits of an axis.
SLEW, NEAR_FAR = "}\n\n  near_far:", "}\n\n  lift:"
TURNED = ENDS.replace("Radius", "SlewAngle").replace("full_speed: 1 ", "full_speed: 28.6 ")


@pytest.fixture
def pump() -> Rig:
    return Rig(ROOT / "config" / "forwarder-pump.yaml")


def tip(rig: Rig, radius_m: float, slew_deg: float = 0.0) -> None:
    message = rig.message("TipPosition")
    values = {"SlewAngle": slew_deg, "Radius": radius_m, "Height": 0}
    rig.receive(Frame("crane", message.frame_id, False, message.encode(values)))


def run(rig: Rig, radius_m: float, ticks: int, **joystick: int) -> None:
    for _ in range(ticks):
        tip(rig, radius_m)
        rig.run(1, **joystick)


def demand(rig: Rig, axis: str = "near_far") -> float:
    return rig.controller.axes[axis].axis.demand


def news(rig: Rig) -> list[str]:
    return [event.text for event in rig.controller.events if "ends=" in event.text]


def test_far_from_its_ends_it_is_as_without_them(pump: Rig) -> None:
    run(pump, 5.0, 3)
    run(pump, 5.0, 20, NearFar=1000)
    assert demand(pump) == 1.0


@pytest.mark.parametrize(("radius_m", "joystick"), [(7.95, 1000), (1.85, -1000)])
def test_at_an_end_only_the_way_back_is_open(pump: Rig, radius_m: float, joystick: int) -> None:
    run(pump, radius_m, 3)
    run(pump, radius_m, 20, NearFar=joystick)
    assert demand(pump) == 0.0
    assert pump.state("near_far") is State.ACTIVE
    assert pump.controller.axes["near_far"].reason is Reason.END_STOP
    run(pump, radius_m, 3)
    run(pump, radius_m, 20, NearFar=-joystick)
    assert demand(pump) == -joystick / 1000
    assert pump.controller.axes["near_far"].reason is Reason.JOYSTICK_MOVED


def test_near_an_end_it_creeps(pump: Rig) -> None:
    run(pump, 7.89, 3)
    run(pump, 7.89, 1, NearFar=1000)
    assert demand(pump) == pytest.approx(0.1)


def test_in_bypass_the_crane_is_as_it_is(pump: Rig) -> None:
    run(pump, 7.95, 3, AntiSwayOff=1)
    run(pump, 7.95, 20, NearFar=1000, AntiSwayOff=1)
    assert demand(pump) == 1.0


def test_an_axis_at_its_end_takes_no_oil(pump: Rig) -> None:
    run(pump, 7.95, 3)
    run(pump, 7.95, 20, NearFar=1000, Slew=1000)
    assert demand(pump, "slew") == 1.0


def test_without_a_position_it_is_as_without_ends_and_that_is_logged(pump: Rig) -> None:
    run(pump, 7.95, 3)
    assert news(pump) == []
    run(pump, 7.95, 5, NearFar=1000)
    pump.run(11, NearFar=1000)  # the last position is 0.2 s old, and then too old
    assert demand(pump) == 1.0
    assert news(pump) == ["axis=near_far ends=lost"]
    run(pump, 7.95, 5, NearFar=1000)
    assert demand(pump) == 0.0
    assert news(pump)[1:] == ["axis=near_far ends=known"]


def test_two_axes_and_a_motion_read_one_message(changed_rig: Make) -> None:
    """A code that is no angle takes nothing from the radius."""
    motion = f"motion: {{ crane: {{ slew: slew, near_far: near_far, radius: {{ {TIP} }} }} }}"
    changes = {SLEW: f", {TURNED} {SLEW}", NEAR_FAR: f", {ENDS} {NEAR_FAR}"}
    changes["axes:\n"] = f"{motion}\naxes:\n"
    rig = changed_rig(changes, {"VAL_ 272": 'VAL_ 1025 SlewAngle 500 "Error" ;\nVAL_ 272'})
    tip(rig, 4.0, 8.0)
    rig.run(3)
    tip(rig, 4.0, 8.0)
    rig.run(1, Slew=1000, NearFar=1000)
    assert demand(rig, "slew") == 0.0
    assert demand(rig) == 1.0
    for _ in range(15):
        tip(rig, 4.0, 5.0)  # raw 500
        rig.run(1)
    texts = [event.text for event in rig.controller.events]
    assert texts.count("axis=slew ends=lost") == 1
    assert not any("radius=lost" in text for text in texts[-5:])


def test_a_demand_counts_once_for_each_command_to_the_valve(changed_rig: Make) -> None:
    changes = {NEAR_FAR: f", {ENDS} {NEAR_FAR}"}
    slow, quick = changed_rig(changes), changed_rig(changes | {"tick_ms: 20": "tick_ms: 10"})
    room = []
    for rig, ticks in ((slow, 1), (quick, 2)):
        run(rig, 5.0, 3 * ticks)
        run(rig, 5.0, 25 * ticks, NearFar=1000)
        room.append(rig.controller.axes["near_far"].room[1])
    assert room[0] == pytest.approx(room[1], abs=0.05)
    assert room[0] < 2.8


@pytest.mark.parametrize(
    ("ends", "why"),
    [
        ("lowest: 8, highest: 2, margin: 0, full_speed: 1", "ends: highest: expected more than"),
        ("lowest: 2, highest: 3, margin: 0.5, full_speed: 1", "twice the margin, got 3"),
        ("lowest: 2, highest: 8, margin: 0, full_speed: 0", "full_speed: expected a speed, got 0"),
        ("lowest: 2, highest: 8, full_speed: 1", "ends.margin: missing"),
        ("signal: Nothing, lowest: 2, highest: 8, margin: 0, full_speed: 1", "got 'Nothing'"),
        ("lowest: 2, highest: 80, margin: 0, full_speed: 1", "within the range of Radius, [0|60]"),
    ],
)
def test_what_cannot_be_is_refused(changed_rig: Make, ends: str, why: str) -> None:
    tip = TIP.replace("signal: Radius, ", "") if "signal" in ends else TIP
    with pytest.raises(ConfigError) as refused:
        changed_rig({NEAR_FAR: f", ends: {{ {tip}, {ends} }} {NEAR_FAR}"})
    assert why in str(refused.value)


def test_a_signal_without_range_is_refused(changed_rig: Make) -> None:
    with pytest.raises(ConfigError) as refused:
        changed_rig(
            {NEAR_FAR: f", {ENDS} {NEAR_FAR}"},
            {"(0.001,0) [0|60]": "(0.001,0) [0|0]"},
        )
    assert "Radius has no range in the DBC" in str(refused.value)


def test_who_reads_one_message_agrees_on_it(changed_rig: Make) -> None:
    motion = f"motion: {{ crane: {{ slew: slew, near_far: near_far, radius: {{ {TIP} }} }} }}"
    ends = ENDS.replace("timeout_ms: 200", "timeout_ms: 300")
    with pytest.raises(ConfigError) as refused:
        changed_rig({NEAR_FAR: f", {ends} {NEAR_FAR}", "axes:\n": f"{motion}\naxes:\n"})
    assert "timeout_ms: expected the same as axes.near_far.limits.ends" in str(refused.value)
