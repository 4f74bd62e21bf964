"""The comparison of filters: what is driven, what is measured, what is said."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest
from matplotlib.text import Annotation, Text
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.cli.verbs.compare import _felt, _limits, _residuals, _worst
from canshaper.design.comparison.candidates import Candidate, candidates, with_candidate
from canshaper.design.comparison.limits import Least, least, limits_for
from canshaper.design.comparison.manoeuvres import RANDOM_SEEDS, Manoeuvre, manoeuvres
from canshaper.design.comparison.measure import Outcome, measure, measure_all
from canshaper.design.comparison.summary import Row, beaten_by, recommendations, rows
from canshaper.design.tuning.robust import least_residual
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.report.console import SafeConsole
from canshaper.report.pareto import Limits, Point, figure
from canshaper.shaping.registry import KINDS
from canshaper_sim.operator import SCRIPTS

CONFIG = Path(__file__).parents[3] / "config"
FILE = CONFIG / "forwarder-robust.yaml"
ROBUST = "robust 1.8 s ±15 %"


@pytest.fixture(scope="module")
def deployment() -> Deployment:
    return load_deployment(FILE)


@pytest.fixture(scope="module")
def by_name(deployment: Deployment) -> dict[str, Candidate]:
    return {c.name: c for c in candidates(deployment)}


def task(name: str) -> Manoeuvre:
    return next(t for t in manoeuvres() if t.name == name)


def test_every_filter_of_the_registry_takes_part_on_both_axes(deployment: Deployment) -> None:
    every = candidates(deployment)
    for axis in ("slew", "near_far"):
        assert {c.filters[axis].kind for c in every} == set(KINDS)
    assert len({c.name for c in every}) == len(every)
    assert [c.name for c in every if c.ours and not c.motion] == ["robust 1.8 s apart"]
    assert not next(c for c in every if c.name == "off").motion
    without = candidates(replace(deployment, motions={}))
    assert [c.name for c in without] == [c.name for c in every][:-1]


def test_manoeuvres_end_in_rest_and_cover_what_they_should() -> None:
    tasks = manoeuvres()
    assert len({t.name for t in tasks}) == len(tasks)
    works = [t.work for t in tasks]
    assert works.count("random") == len(RANDOM_SEEDS) == 12
    assert {t.script.axes for t in tasks if t.work == "random"} == {("slew", "near_far")}
    for work in ("pulse", "tap", "reversal"):
        alone = {t.script.axes for t in tasks if t.work == work}
        assert alone == {("slew",), ("near_far",)}
    for both in (t for t in tasks if t.work in ("both", "gain", "cycle", "load")):
        assert {"slew", "near_far"} <= set(both.script.axes)
    for one in tasks:
        assert one.script.duration_s - max(s.end_s for s in one.script.strokes) >= 5.0


def test_the_load_is_picked_up_while_the_joysticks_are_neutral() -> None:
    load = task("load picked up")
    assert load.load_s is not None
    assert all(load.script.command(axis, load.load_s) == 0.0 for axis in load.script.axes)
    before, after = (
        [s for s in load.script.strokes if (s.start_s < load.load_s) is first]
        for first in (True, False)
    )
    assert before
    assert after
    assert set(load.script.strokes) < set(SCRIPTS["loading"].strokes)


def test_a_pulse_with_robust_and_off(deployment: Deployment, by_name: dict[str, Candidate]) -> None:
    pulse = task("pulse near-far")
    off = measure(deployment, by_name["off"], pulse, 0)
    assert off.residual_deg == pytest.approx(16.0, abs=0.5)
    assert off.peak_deg == pytest.approx(21.8, abs=0.5)
    assert off.path == pytest.approx(3.0, abs=0.05)
    robust = measure(deployment, by_name[ROBUST], pulse, 0)
    assert robust.residual_deg <= 0.15
    assert robust.peak_deg <= 5.0
    assert robust.stop_s is not None
    assert robust.stop_s <= 1.9
    assert robust.run_on_m == pytest.approx(0.87, abs=0.05)
    assert robust.dip is not None
    assert robust.dip <= 0.02
    longer = measure(deployment, by_name[ROBUST], pulse, 15)
    assert robust.residual_deg < longer.residual_deg < 1.5
    # Half a radian a second on 9.6 m is 4.8 m/s.
    slew = measure(deployment, by_name["off"], task("pulse slew"), 0)
    assert slew.run_on_m is not None
    assert off.run_on_m is not None
    assert slew.run_on_m == pytest.approx(4.8 * off.run_on_m, rel=0.05)


def test_residual_swing_is_that_of_both_planes(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    """A slew without compensation leaves swing along the boom, which no filter of slew sees."""
    pulse = task("pulse slew")
    assert measure(deployment, by_name[ROBUST], pulse, 0).residual_deg < 0.2
    apart = measure(deployment, by_name["robust 1.8 s apart"], pulse, 0)
    assert apart.residual_deg > 2.0


def test_both_axes_need_the_motion(deployment: Deployment, by_name: dict[str, Candidate]) -> None:
    both = task("both -1.2 s out")
    assert measure(deployment, by_name[ROBUST], both, 0).residual_deg < 0.4
    assert measure(deployment, by_name["robust 1.8 s apart"], both, 0).residual_deg > 3.0


def test_movements_of_a_tap_are_counted(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    """The two impulses of ZV are half a swing apart, and the tap is shorter than that."""
    tap = task("tap 0.15 s 100 % near-far")
    moves = {n: measure(deployment, by_name[n], tap, 0).movements for n in ("off", "ZV", ROBUST)}
    assert moves == {"off": 1, "ZV": 2, ROBUST: 1}


def test_a_load_and_a_slow_valve_change_the_crane(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    for name, less in (("load picked up", {"load_s": None}), ("slow slew", {})):
        changed = task(name)
        usual = replace(changed, crane=task("pulse slew").crane, **less)
        left = measure(deployment, by_name[ROBUST], changed, 0).residual_deg
        assert left > 1.0
        assert measure(deployment, by_name[ROBUST], usual, 0).residual_deg < 0.5 * left


def test_initial_sway_hangs_along_the_boom(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    swinging = measure(deployment, by_name[ROBUST], task("swinging"), 0)
    assert 3.0 < swinging.residual_deg < 5.0
    assert swinging.peak_deg >= 10.0


def test_processes_give_what_one_gives(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    every = [by_name["off"], by_name[ROBUST]]
    tap = task("tap 0.6 s 20 % slew")
    seen: list[float] = []
    outcomes = measure_all(FILE, every, [tap], on_progress=seen.append, processes=2)
    assert outcomes == [measure(deployment, c, tap, 0) for c in every]
    assert seen == [0.5, 1.0]


def made(name: str, stop_s: float, residual_deg: float, dip: float = 0.0) -> list[Outcome]:
    """Outcomes of a filter that leaves this much at the right length, three times that at 30 %."""
    felt = {"rise_s": stop_s + 0.1, "stop_s": stop_s, "run_on_m": 0.5, "dip": dip, "re_rise": 0.2}
    pulse = Outcome(name, "pulse near-far", "pulse", "near_far", 0, residual_deg, 9.0, 3.0, **felt)
    tap = replace(pulse, manoeuvre="tap", work="tap", travel=stop_s, movements=2)
    return [
        pulse,
        replace(pulse, axis="slew", run_on_m=2.5),
        tap,
        *(replace(pulse, length_pct=p, residual_deg=residual_deg * 2) for p in (-15, 15)),
        *(replace(pulse, length_pct=p, residual_deg=residual_deg * 3) for p in (-30, 30)),
        replace(pulse, work="reversal"),
        replace(pulse, work="both", peak_deg=20.0),
        replace(pulse, work="cycle", path=0.0),
        replace(pulse, manoeuvre="random 1", work="random", path=10.0 - stop_s),
        replace(pulse, manoeuvre="random 2", work="random", residual_deg=residual_deg * 1.5),
        *(replace(pulse, work=w, residual_deg=residual_deg * 9) for w in ("load", "gain", "start")),
    ]


def table_of(deployment: Deployment, *of: tuple[str, float, float, float]) -> list[Row]:
    outcomes = [o for one in of for o in made(*one)]
    kept = {one[0] for one in of}
    return rows([c for c in candidates(deployment) if c.name in kept], outcomes)


def test_rows_and_recommendations(deployment: Deployment) -> None:
    names = ("robust 1.5 s ±15 %", 1.6, 0.9, 0.0), (ROBUST, 1.8, 0.3, 0.0)
    quick = ("ZV", 1.2, 0.8, 0.06)  # leaves little, but its dip is felt
    calm = ("robust 2.4 s ±30 %", 2.4, 0.1, 0.05)
    table = table_of(deployment, ("off", 0.3, 16.0, 0.0), quick, *names, calm)
    off, zv = table[:2]
    assert (off.worst_deg["pulse"], off.worst_15_deg, off.worst_30_deg) == (16.0, 32.0, 48.0)
    assert (off.worst_deg["random"], off.mean_deg["random"]) == (24.0, 20.0)
    assert (off.worst_deg["load"], off.worst_case) == (144.0, "pulse near-far -30 %")
    assert (zv.run_on_m, zv.slew_run_on_m, zv.peak_deg, zv.tap_movements) == (0.5, 2.5, 20.0, 2)
    assert zv.tap_part == pytest.approx(4.0)
    assert zv.path_part == pytest.approx((8.8 + 3.0) / (9.7 + 3.0))
    advice = recommendations(table, period_s=2.2)
    assert [advice[k][0].name for k in ("fast", "balanced", "calm")] == [
        "robust 1.5 s ±15 %",
        ROBUST,
        "robust 2.4 s ±30 %",
    ]
    assert "1.6 s after release" in advice["fast"][1]
    assert beaten_by(zv, table) is None  # nothing of ours stops as soon as ZV
    better = beaten_by(replace(zv, stop_s=1.9), table)
    assert better is not None
    assert better.name == ROBUST


def test_the_tables_fit_80_columns(
    deployment: Deployment, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ("off", "ZV", "G_FF near-far poles", ROBUST)
    table = table_of(deployment, *((name, 2.0, 10.5, 0.5) for name in names))
    worst = replace(table[0], worst_case="both at once out -30 %", stop_s=12.3, slew_run_on_m=12.3)
    table.append(worst)
    limits = [Least(1.2, 0.5, 0.25, 0.125, 0.9)]
    console = SafeConsole(width=80)
    for drawn in (_residuals(table), _felt(table), _worst(table), _limits(limits)):
        console.print(drawn)
    printed = capsys.readouterr().out
    assert "…" not in printed
    assert printed.count("G_FF near-far poles") == 3
    assert " 1.2 s               50.0    25.0   12.5    90.0" in printed


def test_limits_lie_below_what_was_measured(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    pulse = task("pulse near-far")
    every = [by_name["off"], by_name["ZV"]]
    outcomes = [measure(deployment, c, pulse, p) for c in every for p in pulse.lengths_pct]
    limits = limits_for(deployment, outcomes)
    durations, left = zip(*limits.curve, strict=True)
    assert list(durations) == sorted(durations)
    assert list(left) == sorted(left, reverse=True)
    assert 0.9 < limits.time_optimal_s < 1.2
    zv = next(o for o in outcomes if o.candidate == "ZV" and o.length_pct == 0)
    assert zv.stop_s is not None
    assert zv.stop_s > limits.time_optimal_s
    # A limit of every shaper has no floor of ours: the one with a floor leaves more. The lag of the
    # valve is 0.15 s of the duration.
    swing = sorted({o.length_pct: o.residual_deg for o in outcomes if o.candidate == "off"}.items())
    given = {"tick_s": 0.02, "range_pct": 30.0, "rate_per_s": 5.0, "swing": swing}
    sway = deployment.axes["near_far"].config.sway
    assert sway is not None
    floor = [
        least_residual(sway.mode(), duration_s=d - 0.15, **given).residual for d in durations[1:4]
    ]
    assert all(limit < 0.99 * one for limit, one in zip(left[1:4], floor, strict=True))


def test_the_table_of_limits(deployment: Deployment) -> None:
    """Each gives up what the one before is bound to; some figures are known from elsewhere."""
    limits = least(deployment)
    assert [limit.duration_s for limit in limits][:4] == [1.2, 1.4, 1.6, 1.8]
    for limit in limits:
        assert limit.ours_15 >= limit.no_dip_15 >= limit.any_15 > 0.0
        assert limit.no_dip_30 > limit.no_dip_15
    assert limits[0].no_dip_15 == pytest.approx(0.126, abs=0.001)
    assert limits[3].any_15 == pytest.approx(0.009, abs=0.001)
    assert limits[3].no_dip_30 == pytest.approx(0.124, abs=0.003)


def test_picture_has_every_name_once_in_each_panel() -> None:
    points = [
        Point(f"filter {i}", i % 2 == 0, 1.0 + 0.01 * i, 1.1 + 0.01 * i, 5.0 + 0.1 * i)
        for i in range(12)
    ]
    drawn = figure(points, Limits([(1.0, 3.0), (1.2, 2.0), (1.4, 1.0), (2.0, 0.5)], 0.9), "title")
    for panel in drawn.axes:
        texts = [t.get_text() for t in panel.texts]
        assert all(texts.count(p.name) == 1 for p in points)


def test_no_line_to_a_name_goes_through_another_name() -> None:
    """Names and dots of the shipped deployment: run-on in s, swing left in degrees."""
    spots = {
        "ZV": (1.28, 11.8), "limit-aware ZV": (1.28, 11.4), "G_FF slew poles": (1.41, 12.4),
        "G_FF third pole -5": (1.57, 11.0), "robust 1.5 s": (1.6, 10.4), "two-mode": (1.64, 9.4),
        "robust 1.8 s apart": (1.87, 11.2), "G_FF third pole -4": (1.85, 8.9),
        "robust 1.8 s": (1.87, 8.3), "G_FF no jump": (1.94, 7.7), "G_FF near-far": (1.97, 8.1),
        "off": (0.32, 53.6), "robust 2.4 s": (2.44, 2.7),
    }  # fmt: skip
    points = [Point(name, True, x, x + 0.1, y) for name, (x, y) in spots.items()]
    drawn = figure(points, Limits([], 0.9), "title")
    for panel in drawn.axes:
        texts = [t for t in panel.texts if isinstance(t, Annotation) and t.get_text() in spots]
        boxes = [
            t.get_tightbbox() if not t.arrow_patch else Text.get_window_extent(t) for t in texts
        ]
        assert all(not a.overlaps(b) for a, b in combinations(boxes, 2))
        lines = [(i, t.arrow_patch.get_path()) for i, t in enumerate(texts) if t.arrow_patch]
        assert lines
        for i, path in lines:
            others = [box for j, box in enumerate(boxes) if j != i]
            assert not any(path.intersects_bbox(box, filled=False) for box in others)


def test_a_candidate_gets_time_to_run_on(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    changed = with_candidate(deployment, by_name["ZV"])
    for axis in ("slew", "near_far"):
        assert changed.axes[axis].config.limits.tail_s == 3.0
        assert changed.axes[axis].config.filter == by_name["ZV"].filters[axis]
    assert changed.axes["lift"] is deployment.axes["lift"]
    assert changed.motions == deployment.motions
    assert with_candidate(deployment, by_name["off"]).motions == {}


def test_an_out_that_is_a_file_is_reported_before_anything_is_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drives(*_arguments: object, **_options: object) -> None:
        raise AssertionError

    monkeypatch.setattr("canshaper.design.comparison.measure.measure_all", drives)
    (tmp_path / "out").touch()
    done = CliRunner().invoke(app, ["compare", "--out", str(tmp_path / "out")])
    assert (done.exit_code, done.output) == (2, f"{tmp_path / 'out'}: File exists\n")


def test_a_machine_without_slew_and_near_far_is_not_compared(tmp_path: Path) -> None:
    file = str(CONFIG / "forwarder-joints.yaml")
    done = CliRunner().invoke(app, ["compare", file, "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert "axis near_far: expected one with sway data, slew, lift_cylinder" in done.output
    assert not list(tmp_path.iterdir())


def test_outcomes_are_json() -> None:
    assert json.loads(json.dumps(made("ZV", 1.2, 0.5)[0].__dict__))["stop_s"] == 1.2


# Ctrl-C is ignored in a shell's background job, such as a build's.
COMPARE = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from canshaper.design.comparison import measure
of_file = measure._deployment
def loaded(file):
    if not of_file.cache_info().currsize:
        print("works\\n", end="", flush=True)  # in one piece: two processes print
    return of_file(file)
measure._deployment = loaded
from canshaper.cli.app import app
app(["compare", sys.argv[1], "--out", sys.argv[2], "--processes", "2"])
"""


@pytest.mark.parametrize("to_all", [True, False], ids=["terminal", "parent"])
def test_ctrl_c_leaves_no_process_behind(to_all: bool, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", COMPARE, str(FILE), str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == process.stdout.readline() == "works\n"
        (os.killpg if to_all else os.kill)(process.pid, signal.SIGINT)
        # The pipes are at their end when the last process is gone.
        out, err = process.communicate(timeout=60)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert (process.returncode, out, err) == (130, "", "interrupted\n")
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)
    assert not list(tmp_path.iterdir())
