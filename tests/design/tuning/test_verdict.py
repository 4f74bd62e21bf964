"""No design that does not damp: what is good, poor, useless; what would leave less; who says so."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from canshaper.design.tuning.evaluate import Machine, evaluate, gff
from canshaper.design.tuning.verdict import GOOD, Verdict, judge, verdicts
from canshaper.machine.binding import load_deployment
from canshaper.shaping.sway import SwayMode
from tests.cli.invocation import invoke
from tests.design.tuning.random_machines import COUNT, judged
from tests.rigs.files import ROOT

MODE = SwayMode.from_grapple(1.2, 120.0, 300.0)
DOUBLE = gff((-2.859, -2.859))
RATES = "rise_per_s: 5, fall_per_s: 5"


def machine(**limits: float) -> Machine:
    return replace(Machine(), limits=replace(Machine().limits, **limits))  # type: ignore[arg-type]


def changed(file: Path, old: str, new: str) -> Path:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    return file


@pytest.mark.parametrize(("left", "word"), [(0.1, "good"), (0.11, "poor"), (0.51, "useless")])
def test_a_tenth_is_good_and_more_than_half_is_useless(left: float, word: str) -> None:
    one = Verdict(left, 0.0)
    assert (one.word, one.useless) == (word, word == "useless")
    assert str(one).startswith(f"{word}: {100 * left:.1f} % of the swing is left at the right")


def test_a_good_filter_needs_no_cure() -> None:
    one = judge(MODE, 0.02, DOUBLE, machine())
    assert (one.word, one.cures) == ("good", ())
    assert one.left == evaluate(MODE, 0.02, DOUBLE, machine(), (0,)).worst()
    assert one.with_cure(0.0, "another") is one


def test_both_ends_of_the_range_count() -> None:
    one = judge(MODE, 0.02, DOUBLE, machine(tail_s=3.0), 30.0)
    assert (one.word, one.length_pct) == ("poor", -30.0)
    right = 100.0 * judge(MODE, 0.02, DOUBLE, machine(tail_s=3.0)).left
    assert one.cures == (f"the right length would leave {right:.1f} %",)


def test_what_a_longer_tail_is_said_to_leave_it_leaves() -> None:
    one = judge(MODE, 0.02, DOUBLE, machine(tail_s=1.0))
    assert one.word != "good"
    tail_s, left = re.fullmatch(r"tail_s: ([\d.]+) would leave ([\d.]+) %", one.cures[0]).groups()  # type: ignore[union-attr]
    then = judge(MODE, 0.02, DOUBLE, machine(tail_s=float(tail_s)))
    assert f"{100 * then.left:.1f}" == left
    assert then.word == "good"
    assert judge(MODE, 0.02, DOUBLE, machine(tail_s=float(tail_s) - 0.1)).word != "good"


def test_what_a_quicker_valve_is_said_to_leave_it_leaves() -> None:
    fast = gff((-8.0, -8.0))
    one = judge(MODE, 0.02, fast, machine(rise_per_s=1.0, fall_per_s=4.0, tail_s=5.0))
    text = r"a valve with rise_per_s of ([\d.]+) would leave ([\d.]+) %"
    rate, left = re.fullmatch(text, one.cures[0]).groups()  # type: ignore[union-attr]
    then = judge(MODE, 0.02, fast, machine(rise_per_s=float(rate), fall_per_s=4.0, tail_s=5.0))
    assert f"{100 * then.left:.1f}" == left


@pytest.mark.slow
def test_a_filter_that_never_moves_is_not_called_calm() -> None:
    """Its first steps are less than half a step of the valve frame; nothing helps."""
    text = str(judge(MODE, 0.02, gff((-0.1, -0.1)), machine()))
    assert text.startswith("useless: 100.0 % of the swing is left at the right length")
    assert text.endswith("; tail, valve and stopping distance do not help: design it again")


def test_a_tool_that_swings_out_by_itself_needs_no_filter() -> None:
    one = judge(SwayMode(2.86, 0.9), 0.02, DOUBLE, machine())
    assert one.cures == ("filter: { kind: off }: the tool comes to rest by itself",)


@pytest.mark.slow
def test_tune_writes_nothing_useless_without_force(file: Path) -> None:
    before = file.read_bytes()
    words = ("tune", str(file), "--axis", "near_far", "--q", "100", "--write", "--starts", "1")
    out = ("--out", str(file.parent / "out"))
    result = invoke(*words, *out)
    assert result.exit_code == 1
    text = " ".join(result.output.split())
    assert "Verdict: useless: 53.5 % of the swing is left at the right length" in text
    assert "the filter in the file would leave 4.9 %" in text
    assert "Use a1" not in text
    assert file.read_bytes() == before
    forced = invoke(*words, *out, "--force", "--json")
    assert forced.exit_code == 0
    data = json.loads(forced.stdout)
    assert data["verdict"]["word"] == "useless"
    assert data["objective"]["q"] == [100.0]
    assert file.read_bytes() != before


@pytest.mark.slow
def test_with_a_slow_valve_tune_is_no_worse_than_the_paper(file: Path) -> None:
    changed(file, RATES, "rise_per_s: 0.6, fall_per_s: 1")
    out = ("--out", str(file.parent / "out"))
    result = invoke("tune", str(file), "--axis", "near_far", "--json", "--starts", "1", *out)
    data = json.loads(result.stdout)
    before = next(r["machine"] for r in data["in_file"]["residuals"] if r["length_pct"] == 0)
    assert data["verdict"]["left"] < before
    assert data["verdict"]["word"] == "good"


@pytest.mark.slow
def test_robust_names_the_duration_that_a_slow_valve_needs(file: Path) -> None:
    changed(file, RATES, "rise_per_s: 0.6, fall_per_s: 1")
    before = file.read_bytes()
    words = ("robust", str(file), "--axis", "near_far")
    result = invoke(*words, "--write")
    assert result.exit_code == 1
    assert file.read_bytes() == before
    cure = re.search(r"--duration ([\d.]+) would leave ([\d.]+) %", " ".join(result.output.split()))
    assert cure is not None
    changed(file, "tail_s: 2.0", "tail_s: 4.0")
    then = json.loads(invoke(*words, "--duration", cure[1], "--json").stdout)["verdict"]
    assert then["word"] == "good"
    assert 100.0 * then["left"] == pytest.approx(float(cure[2]), abs=1.0)
    assert invoke(*words, "--write", "--force").exit_code == 0


@pytest.mark.parametrize("verb", ["tune", "robust"])
def test_an_overdamped_tool_is_refused_with_the_bound(file: Path, verb: str) -> None:
    changed(file, "damping_nms: 120", "damping_nms: 2200")
    result = invoke(verb, str(file), "--axis", "near_far", "--write")
    assert result.exit_code == 2
    assert "damping ratio: expected 0 to 0.3, got 0.891" in result.output
    assert result.output.count("\n") == 1


@pytest.mark.slow
def test_an_undamped_tool_gets_a_good_filter(file: Path) -> None:
    changed(file, "damping_nms: 120", "damping_nms: 0")
    assert "Verdict: good" in invoke("robust", str(file), "--axis", "near_far").output
    printed = invoke("tune", str(file), "--axis", "near_far", "--pole-distance", "printed")
    assert printed.exit_code == 2
    assert "allows no pole: the sway is undamped" in printed.output


@pytest.mark.parametrize("path", sorted((ROOT / "config").glob("*.yaml")), ids=lambda p: p.stem)
def test_every_shipped_filter_is_good(path: Path) -> None:
    if "axes:" not in path.read_text():
        pytest.skip("no deployment")
    judged = dict(verdicts(load_deployment(path)))
    assert judged
    assert {place: str(one) for place, one in judged.items() if one.left > GOOD} == {}


@pytest.mark.slow
def test_check_warns_of_a_filter_that_does_not_damp(file: Path) -> None:
    changed(file, "a1: 0.708, a2: 0.12 } # near-far", "a1: 6, a2: 9 } # near-far")
    result = invoke("check", str(file))
    assert result.exit_code == 0
    line = (
        file.read_text()
        .splitlines()
        .index(next(row for row in file.read_text().splitlines() if "a1: 6" in row))
    )
    assert f"WARNING: {file}:{line + 1}: axes.near_far.filter: useless: " in result.output
    data = json.loads(invoke("check", str(file), "--json").stdout)
    assert [(one["place"][1], one["word"]) for one in data["filters"]] == [
        ("slew", "good"),
        ("near_far", "useless"),
    ]
    assert "worst filter: near_far, useless" in result.output


def test_a_stopping_distance_that_ends_the_run_on_is_seen(file: Path) -> None:
    changed(file, "stop_distance_m: 1 }", "stop_distance_m: 0.6 }")
    near_far = {place[1]: one for place, one in verdicts(load_deployment(file))}["near_far"]
    changed(file, "stop_distance_m: 0.6 }", "stop_distance_m: 5 }")
    slew, free = (one for _, one in verdicts(load_deployment(file)))
    assert max(slew.left, free.left) < GOOD < near_far.left
    left = f"would leave {100 * free.left:.1f} %"
    assert near_far.cures[-1] == f"a stop_distance_m long enough {left}"


def test_a_profile_is_judged_too() -> None:
    places = [place for place, _ in verdicts(load_deployment(ROOT / "config/j1939-profiles.yaml"))]
    assert ("axes", "slew", "profiles", "quick", "filter") in places


@pytest.mark.study
def test_the_verdict_is_what_a_drive_shows() -> None:
    results = [judged(seed) for seed in range(COUNT)]
    wrong = [str(one) for one in results if not one.agrees]
    assert len(wrong) <= 0.05 * COUNT, wrong
    assert all(one.left <= 0.15 for one in results if one.verdict.word == "good")
    assert all(one.machine.damping_ratio > 0.5 for one in results if not one.agrees)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "word"), [(1, "poor"), (6, "good"), (8, "poor"), (101, "useless")]
)
def test_each_word_is_what_a_drive_shows(seed: int, word: str) -> None:
    one = judged(seed)
    assert (one.verdict.word, one.agrees) == (word, True)
    assert one.left == pytest.approx(one.verdict.left, abs=0.01)
