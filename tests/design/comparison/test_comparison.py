"""The comparison of filters: what is driven, what is measured, what is said."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.design.comparison.candidates import candidates, nominal_mode, with_candidate
from canshaper.design.comparison.limits import limits_for
from canshaper.design.comparison.manoeuvres import RANDOM_SEEDS, manoeuvres
from canshaper.design.comparison.measure import Outcome, measure, measure_all
from canshaper.design.comparison.summary import beaten_by, recommendations, rows
from canshaper.design.tuning.robust import least_residual
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.report.pareto import Limits, Point, draw, figure
from canshaper.shaping.registry import KINDS

FILE = Path(__file__).parents[3] / "config" / "forwarder.yaml"


@pytest.fixture(scope="module")
def deployment() -> Deployment:
    return load_deployment(FILE)


def test_every_filter_of_the_registry_takes_part(deployment: Deployment) -> None:
    found = candidates(deployment, "near_far")
    assert {c.filter.kind for c in found} == set(KINDS)
    assert len({c.name for c in found}) == len(found)
    assert not any(c.motion for c in found)
    assert any(c.motion for c in candidates(deployment, "slew"))


def test_manoeuvres_end_in_rest_and_cover_what_they_should() -> None:
    tasks = manoeuvres("near_far")
    names = [t.name for t in tasks]
    assert names[:6] == [
        "pulse",
        "partial stroke",
        "early release",
        "reversal",
        "double tap",
        "loading cycle",
    ]
    assert sum(n.startswith("random") for n in names) == len(RANDOM_SEEDS) == 12
    assert names[-1] == "initial sway"
    assert tasks[-1].initial_deg == 10.0
    for task in tasks:
        assert task.script.duration_s - max(s.end_s for s in task.script.strokes) >= 5.0


def test_the_pulse_with_robust_and_off(deployment: Deployment) -> None:
    by_name = {c.name: c for c in candidates(deployment, "near_far")}
    pulse = manoeuvres("near_far")[0]
    off = measure(deployment, "near_far", by_name["off"], pulse, 0)
    assert off.residual_deg == pytest.approx(16.0, abs=0.5)
    assert off.peak_deg == pytest.approx(21.8, abs=0.5)
    robust = measure(deployment, "near_far", by_name["robust 1.7 s ±15 %"], pulse, 0)
    assert robust.residual_deg <= 0.15
    assert robust.peak_deg <= 5.0
    assert robust.stop_s is not None
    assert robust.stop_s <= 1.82
    assert robust.dip is not None
    assert robust.dip <= 0.02
    longer = measure(deployment, "near_far", by_name["robust 1.7 s ±15 %"], pulse, 15)
    assert robust.residual_deg < longer.residual_deg < 1.5


def test_initial_sway_is_hung_in_the_plane_of_the_axis(deployment: Deployment) -> None:
    off = candidates(deployment, "slew")[0]
    still = replace(manoeuvres("slew")[-1], initial_deg=0.0)
    swinging = measure(deployment, "slew", off, manoeuvres("slew")[-1], 0)
    assert swinging.residual_deg != measure(deployment, "slew", off, still, 0).residual_deg


def test_processes_give_what_one_gives(deployment: Deployment) -> None:
    found = candidates(deployment, "near_far")[:2]
    tasks = [replace(manoeuvres("near_far")[2], lengths_pct=(0,))]
    seen: list[float] = []
    outcomes = measure_all(FILE, "near_far", found, tasks, on_progress=seen.append, processes=2)
    assert outcomes == [measure(deployment, "near_far", c, tasks[0], 0) for c in found]
    assert seen == [0.5, 1.0]


def made(name: str, stop_s: float, residual_deg: float) -> list[Outcome]:
    """Outcomes of a filter that leaves this much at the right length, three times that at 30 %."""
    pulse = Outcome(name, "pulse", 0, residual_deg, 0.0, 9.0, stop_s + 0.1, stop_s, 0.1, 0.2)
    return [
        pulse,
        *(replace(pulse, length_pct=p, residual_deg=residual_deg * 2) for p in (-15, 15)),
        *(replace(pulse, length_pct=p, residual_deg=residual_deg * 3) for p in (-30, 30)),
        replace(pulse, manoeuvre="random 1", residual_deg=residual_deg * 5),
        replace(pulse, manoeuvre="initial sway", residual_deg=4.0),
    ]


def test_rows_and_recommendations(deployment: Deployment) -> None:
    pool = candidates(deployment, "near_far")
    names = {"off": (0.3, 16.0), "ZV": (1.2, 0.9), "robust 1.7 s ±15 %": (1.8, 0.3)}
    names["robust 2.2 s ±30 %"] = (2.3, 0.1)
    found = [c for c in pool if c.name in names]
    outcomes = [o for c in found for o in made(c.name, *names[c.name])]
    table = rows(found, outcomes)
    off = table[0]
    assert (off.residual_deg, off.worst_15_deg, off.worst_30_deg) == (16.0, 32.0, 48.0)
    assert (off.random_deg, off.initial_deg) == (80.0, 4.0)
    advice = recommendations(table, period_s=2.2)
    assert [advice[k][0].name for k in ("fast", "balanced", "calm")] == [
        "ZV",
        "robust 1.7 s ±15 %",
        "robust 2.2 s ±30 %",
    ]
    assert "1.2 s after release" in advice["fast"][1]
    assert beaten_by(table[1], table) is None  # nothing of ours stops as soon as ZV
    slow = replace(table[1], stop_s=1.9)
    better = beaten_by(slow, table)
    assert better is not None
    assert better.name == "robust 1.7 s ±15 %"


def test_limits_lie_below_what_was_measured(deployment: Deployment) -> None:
    found = [c for c in candidates(deployment, "near_far") if c.name in ("off", "ZV")]
    pulse = manoeuvres("near_far")[0]
    outcomes = [
        measure(deployment, "near_far", c, pulse, p) for c in found for p in pulse.lengths_pct
    ]
    limits = limits_for(deployment, "near_far", outcomes)
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
    task = {"tick_s": 0.02, "range_pct": 30.0, "rate_per_s": 5.0, "swing": swing}
    mode = nominal_mode(deployment, "near_far")
    floor = [least_residual(mode, duration_s=d - 0.15, **task).residual for d in durations[1:4]]
    assert all(limit < 0.99 * one for limit, one in zip(left[1:4], floor, strict=True))


def test_picture_has_every_name_once_in_each_panel(tmp_path: Path) -> None:
    points = [
        Point(f"filter {i}", i % 2 == 0, 1.0 + 0.01 * i, 1.1 + 0.01 * i, 5.0 + 0.1 * i)
        for i in range(12)
    ]
    drawn = figure(points, Limits([(1.0, 3.0), (1.2, 2.0), (1.4, 1.0), (2.0, 0.5)], 0.9), "title")
    for panel in drawn.axes:
        texts = [t.get_text() for t in panel.texts]
        assert all(texts.count(p.name) == 1 for p in points)
    draw(points, Limits([], 0.9), "title", tmp_path / "p.png")
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")


def test_a_candidate_gets_time_to_run_on(deployment: Deployment) -> None:
    candidate = candidates(deployment, "near_far")[-1]
    changed = with_candidate(deployment, "near_far", candidate)
    assert changed.axes["near_far"].config.limits.tail_s == 3.0
    assert changed.axes["near_far"].config.filter == candidate.filter
    assert changed.axes["slew"] is deployment.axes["slew"]
    assert nominal_mode(changed, "near_far") == nominal_mode(deployment, "near_far")


@pytest.mark.parametrize(
    "axis, message",
    [
        ("lift", "axis lift: expected one with sway data, slew, near_far, got no sway data"),
        ("boom", "axis boom: expected one with sway data, slew, near_far, got no such axis"),
    ],
)
def test_an_axis_that_cannot_be_compared(axis: str, message: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["compare", str(FILE), "--axis", axis, "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert message in done.output
    assert not list(tmp_path.iterdir())


def test_outcomes_are_json() -> None:
    assert json.loads(json.dumps(made("ZV", 1.2, 0.5)[0].__dict__))["stop_s"] == 1.2
