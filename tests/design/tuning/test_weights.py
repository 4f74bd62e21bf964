"""Each weight of Eq. 15 moves what its page says; weights that stand in a file."""

import math
import re
from pathlib import Path
from typing import Any

import pytest

from canshaper.commissioning.tuned import TunedDesign, design_tuned, write_tuned
from canshaper.config.desk import Objective
from canshaper.config.load import load_config
from canshaper.design.tuning.formulation import Task, Weights
from canshaper.design.tuning.optimal import tune
from canshaper.errors import ConfigError, DesignError, UsageError
from canshaper.machine.binding import load_deployment
from canshaper.shaping.sway import SwayMode
from tests.rigs.files import ROOT

PAGE = (ROOT / "docs" / "tuning.md").read_text("utf-8")
ROW = re.compile(
    r"^\| `--(\w)` \|.*\| ([\d.]+) to ([\d.]+)(?:, `--(\w) 0`)? \| (slower|quicker)"
    r" \| ([\d.]+) to ([\d.]+) \| (\d+) to (\d+) \|$",
    re.MULTILINE,
)
ROWS = ROW.findall(PAGE)


def tuned(file: Path, axis: str, **given: Any) -> TunedDesign:
    return design_tuned(load_deployment(file), axis, given, starts=1)


def test_the_page_has_a_row_of_each_weight() -> None:
    assert sorted(row[0] for row in ROWS) == ["p", "q", "r", "s"]


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_a_weight_moves_the_rise_as_the_page_says(row: tuple[str, ...]) -> None:
    name, low, high, other, does, *shown = row
    rise_s, left = [], []
    for text in (low, high):
        value = [float(text)] if name == "q" else float(text)
        given = {name: value, **({other: 0.0} if other else {})}
        measures = tuned(ROOT / "config" / "forwarder.yaml", "near_far", **given).setting.measures
        rise_s.append(measures.rise_s)
        left.append(measures.worst(0.0))
    assert [f"{one:.2f}" for one in rise_s] + [f"{100 * one:.0f}" for one in left] == shown
    ratio = rise_s[1] / rise_s[0]
    assert ratio >= 2.0 if does == "slower" else ratio <= 0.5


MODE = SwayMode.from_grapple(1.2, 120.0, 300.0)


@pytest.mark.slow
def test_a_matrix_counts_angle_and_rate_together() -> None:
    def poles(*q: float) -> tuple[float, float]:
        return tune(Task(MODE, weights=Weights(q)), 1).poles_rad_s

    assert poles(30.0) == poles(30.0, 30.0) == poles(30.0, 0.0, 0.0, 30.0)
    assert poles(30.0, 1.0) != poles(1.0, 30.0)
    assert poles(30.0, 29.0, 29.0, 30.0)[0] < -1.5 < poles(30.0, -29.0, -29.0, 30.0)[0]


BAD = {
    "not semi-definite": ((1.0, 5.0, 5.0, 1.0), "expected -1 to 1 beside the diagonal (positive"),
    "not symmetric": ((1.0, 0.5, 0.4, 1.0), "expected a symmetric matrix, got 0.5 and 0.4"),
    "three": ((1.0, 2.0, 3.0), "expected 1 number, 2 of the diagonal or 4 of the rows, got 3"),
    "negative": ((1.0, 0.0, 0.0, -1.0), "weight Q: expected 0 to 1e+06, got -1"),
    "no number": ((1.0, float("nan"), float("nan"), 1.0), "beside the diagonal"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_weight_says_what_is(name: str) -> None:
    q, text = BAD[name]
    with pytest.raises(DesignError) as caught:
        Weights(q)
    assert text in str(caught.value).replace("got nan and nan", "beside the diagonal")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("aim", "text"),
    [
        ("q: [1, 5, 5, 1]", "weight Q: expected -1 to 1 beside the diagonal"),
        ("q: []", "weight Q: expected 1 number, 2 of the diagonal or 4 of the rows, got 0"),
        ("r: 0, s: 0", "weights R and S: expected one above 0, got both 0"),
        ("states: angle", "expected 'sway', 'deviation', 'companion' or 'none', got 'angle'"),
    ],
)
def test_a_file_with_what_is_no_objective_is_refused(file: Path, aim: str, text: str) -> None:
    aims = f"period_s: 2.2, damping_ratio: 0.049, objective: {{ {aim} }}"
    new = f"a1: 0.708, a2: 0.12, designed_for: {{ {aims} }} }} # near-far"
    file.write_text(file.read_text().replace("a1: 0.708, a2: 0.12 } # near-far", new))
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    assert text in str(caught.value)
    assert "designed_for.objective" in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    "given",
    [
        {"q": [20.0, 1.0, 1.0, 2.0], "r": 0.5, "s": 0.1, "p": 4.0, "states": "deviation"},
        {"third_pole": True, "max_rate_per_s": 4.0, "pole_distance": "off", "max_run_on_s": 2.1},
        {"length_range_pct": 12.0, "within_command": False, "max_jump": 0.9},
        {"preference": 0.4},
        {"max_rate_per_s": math.inf, "within_command": False, "s": 50.0},
    ],
    ids=["weights", "requirements", "lengths", "preference", "any valve"],
)
def test_a_setting_is_made_again_from_its_file(file: Path, given: dict[str, Any]) -> None:
    one = tuned(file, "near_far", **given)
    write_tuned(load_deployment(file), one)
    again = tuned(file, "near_far")
    assert again.task == one.task
    assert again.objective == one.objective
    assert again.setting.values() == one.setting.values()
    assert again.before is not None
    assert again.before.values() == one.setting.values()


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["slew", "near_far"])
def test_the_shipped_setting_is_made_again_from_its_file(axis: str) -> None:
    one = design_tuned(load_deployment(ROOT / "config" / "forwarder-gff.yaml"), axis, {})
    assert one.before is not None
    assert one.setting.values() == one.before.values()
    assert one.verdict.word == "good"


def test_another_aim_takes_the_place_of_that_in_the_file(file: Path) -> None:
    aims = "period_s: 2.2, damping_ratio: 0.049, objective: { preference: 0.3, pole_distance: off }"
    text = file.read_text()
    new = f"a1: 0.708, a2: 0.12, designed_for: {{ {aims} }} }} # near-far"
    file.write_text(text.replace("a1: 0.708, a2: 0.12 } # near-far", new))
    design = load_config(file)[0].axes["near_far"].filter.design()
    assert design is not None
    assert design.objective == Objective(preference=0.3, pole_distance="off")
    one = tuned(file, "near_far", p=2.0)
    assert one.tuning.method == "optimal"
    assert (one.task.weights.p, one.task.require.pole_distance) == (2.0, "off")
    with pytest.raises(UsageError, match="one of --preference, --length-range and weights"):
        tuned(file, "near_far", p=2.0, preference=0.5)
