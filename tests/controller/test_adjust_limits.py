"""Numbers of a running machine outside the filter: limits, full speed, and the way to stop."""

from itertools import pairwise
from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.adjust import Adjuster
from tests.rigs.files import text_of
from tests.rigs.forwarder import Make, Rig
from tests.rigs.sent import status_frame


def test_limits_change_in_neutral_only(make: Make) -> None:
    rig = make()
    adjuster = Adjuster(rig.controller)
    rig.moving()
    before = adjuster.table()
    with pytest.raises(ValueError, match=r"axes\.slew\.limits: the axis is ACTIVE; .* neutral"):
        adjuster.change({"axes.slew.limits.max_pct": 40, "axes.near_far.sway.length_m": 1.0})
    assert adjuster.table() == before
    with pytest.raises(ValueError, match="neutral only"):
        rig.controller.axes["slew"].axis.limit(
            rig.deployment.config.axes["slew"].limits.output_limits()
        )
    rig.run(200)
    assert rig.state().name == "READY"
    adjuster.change({"axes.slew.limits.max_pct": 40, "axes.slew.limits.rise_per_s": 1})
    speeds = []
    for _ in range(300):
        rig.run(Slew=1000)
        speeds.append(rig.controller.axes["slew"].axis.output.setpoint)
    assert 0.39 < max(speeds) <= 0.4
    # One full speed a second is 2 % a tick, and one step of the frame.
    assert max(b - a for a, b in pairwise(speeds)) <= 0.02 + 1 / 125


def test_an_axis_without_sway_has_adjustable_limits(make: Make) -> None:
    rig = make()
    Adjuster(rig.controller).change({"axes.lift.limits.max_pct": 30})
    rig.run(3)
    rig.run(50, Lift=1000)
    assert rig.controller.axes["lift"].axis.output.setpoint == pytest.approx(0.3, abs=1 / 125)


def test_the_sway_shown_follows_full_speed(make: Make) -> None:
    rig, other = make(), make()
    Adjuster(rig.controller).change({"axes.slew.sway.full_speed_m_s": 3.0})
    rig.run(3)
    other.run(3)
    shown = []
    for one in (rig, other):
        one.run(20, Slew=1000)
        slew = one.controller.axes["slew"]
        frame = status_frame(slew.bound.status, slew)
        shown.append(one.messages["SlewStatus"].decode(frame.data)["PredictedSway"])
    assert shown[0] == pytest.approx(2 * shown[1], rel=0.01)


def test_a_two_axis_motion_takes_the_new_sway_of_near_far(tmp_path: Path) -> None:
    text = text_of("forwarder-robust")
    assert "full_speed_m_s: 1.0 }" in text
    control = "control: { adjustable: { axes.near_far.sway.full_speed_m_s: [0.5, 2.0] } }\n"
    rigs = []
    for name, content in (
        ("set", text + control),
        ("written", text.replace("full_speed_m_s: 1.0 }", "full_speed_m_s: 0.6 }")),
        ("as it was", text),
    ):
        file = tmp_path / f"{name}.yaml"
        file.write_text(content, encoding="utf-8")
        rigs.append(Rig(file))
    Adjuster(rigs[0].controller).change({"axes.near_far.sway.full_speed_m_s": 0.6})
    sent = []
    for rig in rigs:
        tip = rig.message("TipPosition")
        data = tip.encode({s.name: 7.0 if s.name == "Radius" else 0 for s in tip.signals})
        rows = []
        for number in range(150):
            rig.receive(Frame("crane", tip.frame_id, tip.is_extended_frame, data))
            rows.append(rig.run(Slew=1000 if 3 < number < 80 else 0)["NearFarCommand"]["Velocity"])
        sent.append(rows)
    assert any(sent[0])
    assert sent[0] == sent[1] != sent[2]


@pytest.mark.parametrize(
    ("stated", "values", "why"),
    [
        # 4.8 m/s at the largest radius: 0.14 s at max_pct and the fall are within 0.8 m at 78 %.
        (0.8, {"axes.slew.limits.max_pct": 79}, "expected 0.8[0-9] m or more, .*, got 0.8 m$"),
        (0.8, {"axes.slew.limits.max_pct": 70}, None),
        (None, {"axes.slew.limits.max_pct": 41}, "missing: to stop, the limits allow 3.93 m"),
        (None, {"axes.slew.limits.max_pct": 20}, None),
    ],
)
def test_a_stop_over_a_longer_way_than_is_stated_is_refused(
    make: Make, stated: float | None, values: dict[str, object], why: str | None
) -> None:
    slew = "stop_s: 2.0, stop_distance_m: 200 }\n\n  near_far"
    limits = f"max_pct: 40, stop_distance_m: {stated}" if stated else "max_pct: 20"
    radius = "9.6" if stated else "9.0"
    rig = make({slew: slew.replace("stop_distance_m: 200", limits), "9.6": radius})
    adjuster = Adjuster(rig.controller)
    if why is None:
        assert adjuster.change(values)
        return
    with pytest.raises(ValueError, match=r"^axes\.slew\.limits\.stop_distance_m: " + why):
        adjuster.change(values)
    assert adjuster.table()["axes.slew.limits.max_pct"]["now"] == (40 if stated else 20)


def test_a_faster_tip_counts_where_nothing_else_says_how_fast_it_is(make: Make) -> None:
    slewing = "    slewing: { full_speed_rad_s: 0.5, largest_radius_m: 9.6 }\n"
    adjuster = Adjuster(
        make({slewing: "", "stop_distance_m: 200": "stop_distance_m: 0.45"}).controller
    )
    adjuster.change({"axes.slew.sway.full_speed_m_s": 1.8})
    with pytest.raises(ValueError, match=r"expected 0.4[0-9] m or more, .*, got 0.45 m"):
        adjuster.change({"axes.slew.sway.full_speed_m_s": 2.0})
