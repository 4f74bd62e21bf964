"""The shipped bridge crane on the simulated one, whose rope is no model of the controller's."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from canshaper.design.comparison.ropes import (
    RopeFilter,
    compare_ropes,
    left_deg,
    rope_filters,
    works,
)
from canshaper.design.lockstep import drive
from canshaper.errors import DesignError
from canshaper.machine.binding import load_deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.operator import script_for
from canshaper_sim.overhead import OverheadBoom
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script, Stroke
from tests.rigs.files import CONFIG, read
from tests.rigs.overhead import FILE, changed
from tests.rigs.swing import crane_of, last_swing, swing_from

OWN = RopeFilter("the file's", {})


def residual_deg(file: Path, error_pct: float, strokes: Sequence[Stroke], rope_m: float) -> float:
    """Swing that is left 10 s after the last stroke."""
    end_s = max(one.end_s for one in strokes) + 10.0
    overhead = replace(CraneParameters().overhead, rope_m=rope_m, rope_error_pct=error_pct)
    parameters = CraneParameters(overhead=overhead)
    recording = drive(read(file), Script("one", tuple(strokes), end_s + 4.0), parameters=parameters)
    return swing_from(recording, end_s)


def test_both_axes_while_the_load_is_hoisted() -> None:
    strokes = [Stroke("bridge", 0.5, 4.0, 1.0), Stroke("hoist", 1.0, 5.0, 1.0)]
    strokes.append(Stroke("trolley", 1.5, 3.0, 1.0))
    assert residual_deg(FILE, 0.0, strokes, 5.0) < 0.6


@pytest.mark.slow
def test_what_the_file_leaves_with_every_rope_still_and_hoisted() -> None:
    left = [left_deg(read(FILE), (OWN, work)) for work in works(read(FILE))]
    assert sum(left) / len(left) < 0.15
    assert max(left) < 0.4


@pytest.mark.slow
@pytest.mark.parametrize("error_pct", [-5.0, 5.0])
def test_with_a_length_signal_that_is_wrong(error_pct: float) -> None:
    for work in works(read(FILE)):
        assert residual_deg(FILE, error_pct, work.strokes, work.rope_m) < 2.0


@pytest.mark.slow
def test_every_filter_that_is_compared_is_driven() -> None:
    """With ropes of another length the filter for one leaves more, those that follow do not."""
    deployment = read(FILE)
    work = {one.name: one for one in works(read(FILE))}["5 m still"]
    left = {one.name: left_deg(deployment, (one, work)) for one in rope_filters(deployment)}
    assert left["off"] > 10.0
    assert left["ZVD for 8 m"] > 1.0
    assert max(left[name] for name in ("ZV by length", "G_FF by length", "the file's")) < 0.3


@pytest.mark.slow
def test_with_a_hook_block_both_modes_are_compared_and_left_in_peace() -> None:
    deployment = read(CONFIG / "bridge-crane-hook.yaml")
    filters = {one.name: one for one in rope_filters(deployment)}
    still = [one for one in works(deployment) if one.name == "6 m still"][1::2]
    left = {
        name: [left_deg(deployment, (filters[name], work)) for work in still]
        for name in ("off", "ZV of both modes", "the file's")
    }
    off, both, own = left.values()
    assert min(off) > 5.0
    assert max(own) < 0.03 * min(off)
    assert max(both) < 0.03 * min(off)


def test_what_cannot_be_compared_is_said(tmp_path: Path) -> None:
    file = changed(tmp_path, (" trolley: trolley,", ""))
    says = "expected bridge and trolley in crane, without trolley"
    with pytest.raises(DesignError, match=says):
        rope_filters(load_deployment(file))


MULTICOPTER = CONFIG / "multicopter.yaml"


@pytest.mark.parametrize(
    "script", ["pulse-ahead", "reversal", pytest.param("random-3", marks=pytest.mark.slow)]
)
def test_a_load_under_a_multicopter(script: str) -> None:
    """The plant is the one that the file describes: 5 m of rope, 5 m/s, a tilt of 0.3 s."""
    deployment = read(MULTICOPTER)
    if script == "reversal":
        strokes = (Stroke("ahead", 0.5, 4.0, 1.0), Stroke("ahead", 4.5, 4.0, -1.0))
        played = Script(script, strokes, 18.5)
    else:
        played = script_for(deployment, script)
        played = replace(played, duration_s=max(s.end_s for s in played.strokes) + 10.0)
    raw, shaped = (last_swing(drive(deployment, played, bypass=one), 4.0) for one in (True, False))
    assert raw > 4.0
    assert shaped < 0.1 * raw


def test_what_a_file_says_of_its_crane_is_simulated(tmp_path: Path) -> None:
    parameters = changed_parameters([], read(MULTICOPTER))
    assert parameters.overhead.rope_m == 5.0
    assert parameters.overhead.bridge.lag_s == 0.3
    assert changed_parameters(["overhead.rope_m=6"], read(MULTICOPTER)).overhead.rope_m == 6.0
    boom = PlantNode(read(MULTICOPTER)).crane.boom
    assert isinstance(boom, OverheadBoom)
    assert boom.rope_m == 5.0
    assert boom.axes["bridge"].valve.parameters == parameters.overhead.bridge
    file = changed(tmp_path, ("kind: cartesian,", "kind: cartesian, simulated: { rope: 1 },"))
    with pytest.raises(DesignError, match=r"machine.yaml: crane.simulated: rope=1.*parameter"):
        changed_parameters([], load_deployment(file))


@pytest.mark.slow
def test_a_rope_that_is_not_measured_is_compared_a_tenth_wrong() -> None:
    table = compare_ropes(read(MULTICOPTER), lambda _part: None, 1)
    assert [*table["the file's"]] == ["4.5 m still", "5 m still", "5.5 m still"]
    assert table["off"]["5 m still"] > 40.0
    assert max(table["the file's"].values()) < 0.1 * min(table["off"].values())


AXES = [
    ("bridge: bridge", "bridge: long_travel"),
    ("\n  bridge:\n", "\n  long_travel:\n"),
    ("hoist: hoist", "hoist: main_hoist"),
    ("\n  hoist:\n", "\n  main_hoist:\n"),
]


def test_axes_may_have_any_name(tmp_path: Path) -> None:
    deployment = load_deployment(changed(tmp_path, *AXES))
    for name in ("pulse-bridge", "pulse-long_travel"):
        assert script_for(deployment, name).axes == ("long_travel",)
    short = replace(script_for(deployment, "pulse-bridge"), duration_s=7.0)
    recording = drive(deployment, short)
    assert max(recording.axes["long_travel"].speed) == pytest.approx(1.0, abs=0.01)
    assert max(recording.axes["long_travel"].sway_deg or []) > 0.3
    assert recording.axes["main_hoist"].sway_deg is None
    x_m, y_m = crane_of(recording).tip_m[-1]
    assert 2.0 < x_m < 6.0
    assert y_m == 0.0
    assert recording.dwell_s == 10.0


def test_a_script_of_another_crane_is_refused_in_a_line() -> None:
    says = "script pulse-slew moves slew; the crane has bridge, trolley, hoist"
    with pytest.raises(DesignError, match=says):
        script_for(read(FILE), "pulse-slew")
