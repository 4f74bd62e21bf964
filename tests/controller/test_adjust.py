"""Numbers of a running machine: changed in motion without a jump, within the file's limits only."""

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.adjust import Adjuster
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.sway import SwayModel
from tests.rigs.forwarder import Rig

ROOT = Path(__file__).parents[2]
CONTROL = """
control:
  adjustable:
    axes.slew.sway.period_s: [1.8, 3.0]
    axes.slew.sway.full_speed_m_s: [1, 3]
    axes.slew.filter.a1: [0.3, 1.0]
    axes.slew.filter.a2: [0.03, 0.2]
    axes.slew.limits.max_pct: [20, 100]
    axes.slew.limits.rise_per_s: [1, 5]
    axes.near_far.sway.length_m: [0.5, 2.0]
    axes.lift.limits.max_pct: [20, 100]
"""
STATUS = "status: { bus: crane, message: ShaperStatus }\n"
SLEW = "sway: { period_s: 2.356, damping_ratio: 0.038, full_speed_m_s: 1.5 }"
FILTER = "filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"


class Make(Protocol):
    def __call__(self, yaml: dict[str, str] | None = None) -> Rig: ...


@pytest.fixture
def make(changed_rig: Callable[..., Rig]) -> Make:
    def made(yaml: dict[str, str] | None = None) -> Rig:
        return changed_rig({STATUS: STATUS + CONTROL} | (yaml or {}))

    return made


def strokes(rig: Rig, *, ticks: int = 400) -> list[int]:
    """Velocity of slew over some quick strokes."""
    sent = []
    for number in range(ticks):
        joystick = (0, 1000, 1000, -600, 0)[number // 40 % 5]
        sent.append(rig.run(Slew=joystick)["SlewCommand"]["Velocity"])
    return sent


def test_the_table_reports_now_and_file_and_ends(make: Make) -> None:
    adjuster = Adjuster(make().controller)
    assert adjuster.table()["axes.slew.sway.period_s"] == {
        "now": 2.356,
        "file": 2.356,
        "low": 1.8,
        "high": 3.0,
    }
    reported = adjuster.change({"axes.slew.sway.period_s": 2})
    assert reported == ["axes.slew.sway.period_s=2 was=2.356"]
    assert adjuster.table()["axes.slew.sway.period_s"]["now"] == 2.0
    assert adjuster.table()["axes.slew.sway.period_s"]["file"] == 2.356


def test_a_machine_without_a_control_section_lets_nothing_be_changed(rig: Rig) -> None:
    adjuster = Adjuster(rig.controller)
    assert adjuster.table() == {}
    with pytest.raises(ValueError, match="period_s: expected an adjustable number; there are none"):
        adjuster.change({"axes.slew.sway.period_s": 2.0})


def test_at_rest_it_is_as_if_the_file_had_said_so(make: Make) -> None:
    new = SLEW.replace("2.356", "1.9")
    written = make({SLEW: new, FILTER: FILTER.replace("0.708", "0.5").replace("0.12", "0.06")})
    rig = make()
    rig.run(3)
    written.run(3)
    Adjuster(rig.controller).change(
        {
            "axes.slew.sway.period_s": 1.9,
            "axes.slew.filter.a1": 0.5,
            "axes.slew.filter.a2": 0.06,
        }
    )
    expected = strokes(written)
    assert strokes(rig) == expected
    assert strokes(make()) != expected


@pytest.mark.parametrize("at", [50, 90, 130, 170])
def test_in_motion_nothing_jumps_and_the_new_filter_is_in_force(make: Make, at: int) -> None:
    rig = make()
    rig.run(3)
    first = strokes(rig, ticks=at)
    Adjuster(rig.controller).change({"axes.slew.sway.period_s": 1.8, "axes.slew.filter.a1": 0.9})
    joystick = (0, 1000, 1000, -600, 0)[at // 40 % 5]
    # The next command is the last one, and from there on it goes over to the new filter.
    now = rig.run(Slew=joystick)["SlewCommand"]["Velocity"]
    assert abs(now - first[-1]) <= 1
    tuned = rig.controller.axes["slew"].axis.sway
    assert tuned is not None
    assert tuned.mode.period_s == pytest.approx(1.8)


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({}, "^expected a number to change, got none$"),
        (
            {f"axes.slew.sway.{i}": 1.0 for i in range(17)},
            "^expected 16 numbers at most, got 17$",
        ),
        (
            {f"axes.slew.sway.{i}": 1.0 for i in range(16)},
            "axes.slew.sway.0: expected an adjustable number",
        ),
        (
            {"axes.slew.command.neutral_pct": 2.0},
            r"expected an adjustable number; there are axes\.slew\.sway\.period_s,"
            r" axes\.slew\.sway\.full",
        ),
        ({"axes.slew.sway.period_s": 1.79}, "expected 1.8 to 3, got 1.79"),
        ({"axes.slew.sway.period_s": 3.01}, "expected 1.8 to 3, got 3.01"),
        ({"axes.slew.sway.period_s": math.nan}, "expected 1.8 to 3, got nan"),
        ({"axes.slew.sway.period_s": math.inf}, "expected 1.8 to 3, got inf"),
        ({"axes.slew.sway.period_s": "2"}, "expected a number, got '2'"),
        ({"axes.slew.sway.period_s": True}, "expected a number, got True"),
        ({"axes.slew.sway.period_s": [2.0]}, "expected a number, got"),
        # No real poles: each within its range, but not together.
        ({"axes.slew.filter.a1": 0.3}, r"axes\.slew\.filter: .*real"),
        ({"axes.slew.sway.period_s": 2.0, "axes.slew.filter.a1": 9.0}, "expected 0.3 to 1, got 9"),
        ({"axes.near_far.sway.length_m": 1.0, "axes.slew.filter.a1": 0.3}, "real"),
    ],
)
def test_what_is_refused_changes_nothing(make: Make, values: dict[str, object], why: str) -> None:
    rig = make()
    adjuster = Adjuster(rig.controller)
    before = adjuster.table()
    with pytest.raises(ValueError, match=why):
        adjuster.change(values)
    assert adjuster.table() == before
    assert strokes(rig) == strokes(make())


def test_a_filter_that_cannot_run_at_the_period_of_its_valve_is_refused(make: Make) -> None:
    rig = make(
        {
            "axes.slew.filter.a1: [0.3, 1.0]": "axes.slew.filter.a1: [0.0021, 1.0]",
            "axes.slew.filter.a2: [0.03, 0.2]": "axes.slew.filter.a2: [0.000001, 0.2]",
        }
    )
    with pytest.raises(ValueError, match=r"axes\.slew\.filter: "):
        Adjuster(rig.controller).change(
            {"axes.slew.filter.a1": 0.0021, "axes.slew.filter.a2": 0.000001}
        )


@pytest.mark.parametrize(
    ("kind", "number"),
    [
        ("first_order, time_constant_s: 0.4", "time_constant_s"),
        (f"robust, tick_ms: 20, taps: {[0.05] * 20}", "taps"),
    ],
)
def test_the_new_filter_is_made_as_the_file_makes_it(
    make: Make, monkeypatch: pytest.MonkeyPatch, kind: str, number: str
) -> None:
    """For the period of its valve, and with the rate of its valve."""
    made: list[tuple[tuple[object, ...], dict[str, object]]] = []

    def noted(kind: str, tick_s: float, sway: SwayModel | None, **others: object) -> Shaper:
        made.append(((kind, tick_s), others))
        return build_shaper(kind, tick_s, sway, **others)  # type: ignore[arg-type]

    monkeypatch.setattr("canshaper.controller.runner.build_shaper", noted)
    rig = make(
        {
            f"{SLEW}\n    {FILTER}": f"{SLEW}\n    filter: {{ kind: {kind} }}\n",
            "    axes.slew.filter.a1: [0.3, 1.0]\n    axes.slew.filter.a2: [0.03, 0.2]\n": "",
        }
    )
    at_first = next(one for one in made if number in one[1])
    Adjuster(rig.controller).change({"axes.slew.sway.period_s": 2.5})
    if number == "taps":  # drawn out in time, see below
        assert made[-1][1]["taps"] != at_first[1]["taps"]
        at_first[1]["taps"] = made[-1][1]["taps"]
    assert made[-1] == at_first


def test_a_filter_made_for_one_period_is_drawn_out_to_another(make: Make) -> None:
    """Two impulses half a swing apart: they stay that, and the file's own come back bit for bit."""
    taps = [0.5, *[0.0] * 58, 0.5]
    robust = f"filter: {{ kind: robust, tick_ms: 20, taps: {taps} }}"
    rig = make(
        {
            f"{SLEW}\n    {FILTER}": f"{SLEW}\n    {robust}\n",
            "    axes.slew.filter.a1: [0.3, 1.0]\n    axes.slew.filter.a2: [0.03, 0.2]\n": "",
        }
    )
    adjuster, runner = Adjuster(rig.controller), rig.controller.axes["slew"]
    adjuster.change({"axes.slew.sway.period_s": 2.9})
    drawn = runner.bound.config.filter.parameters()["taps"]
    half = len(drawn) // 2
    first, second = (
        sum(k * tap for k, tap in part) / 0.5
        for part in ([*enumerate(drawn)][:half], [*enumerate(drawn)][half:])
    )
    assert second - first == pytest.approx(59 * 2.9 / 2.356, abs=0.25)  # ticks
    for period in (1.8, 3.0, 2.0):
        adjuster.change({"axes.slew.sway.period_s": period})
    assert runner.bound.config.filter.parameters()["taps"] != taps
    adjuster.change({"axes.slew.sway.period_s": 2.356})
    assert runner.bound.config.filter.parameters()["taps"] == taps


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
        speeds.append(rig.controller.axes["slew"].axis.sent)
    assert 0.39 < max(speeds) <= 0.4
    # One full speed a second is 2 % a tick, and one step of the frame.
    assert max(b - a for a, b in pairwise(speeds)) <= 0.02 + 1 / 125


def test_an_axis_without_sway_has_adjustable_limits(make: Make) -> None:
    rig = make()
    Adjuster(rig.controller).change({"axes.lift.limits.max_pct": 30})
    rig.run(3)
    rig.run(50, Lift=1000)
    assert rig.controller.axes["lift"].axis.sent == pytest.approx(0.3, abs=1 / 125)


def test_the_sway_shown_follows_full_speed(make: Make) -> None:
    rig, other = make(), make()
    Adjuster(rig.controller).change({"axes.slew.sway.full_speed_m_s": 3.0})
    rig.run(3)
    other.run(3)
    shown = []
    for one in (rig, other):
        one.run(20, Slew=1000)
        frame = one.controller.axes["slew"].status_frame()
        assert frame is not None
        shown.append(one.messages["SlewStatus"].decode(frame.data)["PredictedSway"])
    assert shown[0] == pytest.approx(2 * shown[1], rel=0.01)


def test_a_two_axis_motion_takes_the_new_sway_of_near_far(tmp_path: Path) -> None:
    text = (ROOT / "config" / "forwarder-robust.yaml").read_text(encoding="utf-8")
    text = text.replace("../dbc", str(ROOT / "dbc"))
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
        # 4.8 m/s at the largest radius: 2.03 s at max_pct and the fall are within 8 m at 78 %.
        (8, {"axes.slew.limits.max_pct": 79}, "expected 8.0[0-9] m or more, .*, got 8 m$"),
        (8, {"axes.slew.limits.max_pct": 70}, None),
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
        make({slewing: "", "stop_distance_m: 200": "stop_distance_m: 4"}).controller
    )
    adjuster.change({"axes.slew.sway.full_speed_m_s": 1.8})
    with pytest.raises(ValueError, match=r"expected 4.2[0-9] m or more, .*, got 4 m"):
        adjuster.change({"axes.slew.sway.full_speed_m_s": 2.0})
