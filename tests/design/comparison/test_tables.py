"""The comparison of filters: its rows, its recommendation, its tables and its picture."""

import json
from dataclasses import replace
from itertools import combinations

import pytest
from matplotlib.text import Annotation, Text

from canshaper.cli.verbs.compare import _felt, _limits, _residuals, _worst
from canshaper.design.comparison.manoeuvres import Candidate, candidates
from canshaper.design.comparison.measure import Outcome, measure
from canshaper.design.comparison.summary import (
    Least,
    Row,
    beaten_by,
    least,
    limits_for,
    recommendations,
    rows,
)
from canshaper.design.tuning.robust import least_residual
from canshaper.machine.deployment import Deployment
from canshaper.report.console import SafeConsole
from canshaper.report.pareto import Limits, Point, figure
from tests.design.comparison.candidates import ROBUST, task


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
        *(
            replace(pulse, work=work, residual_deg=residual_deg * 9)
            for work in ("load", "gain", "pump", "end", "start")
        ),
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


def test_a_recommendation_claims_no_bound_that_no_filter_keeps(deployment: Deployment) -> None:
    """Where no filter leaves little, or none stops in time, the sentence says so."""
    table = table_of(deployment, ("off", 2.5, 16.0, 0.0), ("ZV", 2.6, 8.0, 0.0))
    advice = {name: text for name, (_, text) in recommendations(table, period_s=2.2).items()}
    assert advice["fast"] == (
        "fast: off stops soonest, 2.5 s after release; none leaves at most 12 % of the unshaped"
        " swing at lengths within 15 % (32.0 of 32.0 degrees)"
    )
    assert advice["balanced"] == (
        "balanced: ZV leaves least at lengths within 15 % (16.0 degrees); none stops within 0.9"
        " of a swing (2.6 s)"
    )


@pytest.mark.slow
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
    assert printed.count("G_FF near-far poles") == 5  # two tables have two parts each
    assert " 1.2 s               50.0    25.0   12.5    90.0" in printed


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_picture_has_every_name_once_in_each_panel() -> None:
    points = [
        Point(f"filter {i}", i % 2 == 0, 1.0 + 0.01 * i, 1.1 + 0.01 * i, 5.0 + 0.1 * i)
        for i in range(12)
    ]
    drawn = figure(points, Limits([(1.0, 3.0), (1.2, 2.0), (1.4, 1.0), (2.0, 0.5)], 0.9), "title")
    for panel in drawn.axes:
        texts = [t.get_text() for t in panel.texts]
        assert all(texts.count(p.name) == 1 for p in points)


@pytest.mark.slow
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


def test_outcomes_are_json() -> None:
    assert json.loads(json.dumps(made("ZV", 1.2, 0.5)[0].__dict__))["stop_s"] == 1.2
