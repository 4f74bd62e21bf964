"""Numbers of a running machine: changed in motion without a jump, within the file's limits only."""

import math

import pytest

from canshaper.controller.adjust import Adjuster
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.sway import SwayModel
from tests.rigs.forwarder import Make, Rig

SLEW = "sway: { period_s: 2.356, damping_ratio: 0.038, full_speed_m_s: 1.5 }"
FILTER = "filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"


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


@pytest.mark.parametrize("at", [50, 90, 130])
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


def test_with_the_joystick_released_nothing_is_changed_before_the_axis_rests(make: Make) -> None:
    """A filter for another swing would open the valve again, though no one asks for motion."""
    rig = make()
    adjuster = Adjuster(rig.controller)
    rig.moving().run(50, Slew=1000)
    rig.run(20, Slew=0)
    axis = rig.controller.axes["slew"].axis
    while axis.output.commanded:
        with pytest.raises(ValueError, match=r"^axes\.slew: it runs on with its joystick released"):
            adjuster.change({"axes.slew.sway.period_s": 3.0})
        assert adjuster.table()["axes.slew.sway.period_s"]["now"] != 3.0
        rig.run(1, Slew=0)
    adjuster.change({"axes.slew.sway.period_s": 3.0})
    for _ in range(150):
        assert rig.run(1, Slew=0)["SlewCommand"]["Velocity"] == 0


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

    monkeypatch.setattr("canshaper.controller.axis_control.build_shaper", noted)
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
    adjuster, control = Adjuster(rig.controller), rig.controller.axes["slew"]
    adjuster.change({"axes.slew.sway.period_s": 2.9})
    drawn = control.bound.config.filter.parameters()["taps"]
    half = len(drawn) // 2
    first, second = (
        sum(k * tap for k, tap in part) / 0.5
        for part in ([*enumerate(drawn)][:half], [*enumerate(drawn)][half:])
    )
    assert second - first == pytest.approx(59 * 2.9 / 2.356, abs=0.25)  # ticks
    for period in (1.8, 3.0, 2.0):
        adjuster.change({"axes.slew.sway.period_s": period})
    assert control.bound.config.filter.parameters()["taps"] != taps
    adjuster.change({"axes.slew.sway.period_s": 2.356})
    assert control.bound.config.filter.parameters()["taps"] == taps
