"""What the profiles of the shipped machine do; its file shows it."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app

ROOT = Path(__file__).parents[2]


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["profiles", *words])
    return done.exit_code, done.output


@pytest.fixture(scope="module")
def figures() -> dict[tuple[str, str], dict[str, float]]:
    status, output = run("--json", "--no-work")
    assert status == 0, output
    return {(one["axis"], one["profile"]): one for one in json.loads(output)["presses"]}


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["slew", "near_far"])
def test_quick_stops_sooner_and_fine_swings_less(
    figures: dict[tuple[str, str], dict[str, float]], axis: str
) -> None:
    normal, quick, fine = (figures[axis, name] for name in ("normal", "quick", "fine"))
    for key in ("run_on_s", "run_on_travel_s"):
        assert quick[key] < 0.85 * normal[key] < normal[key] < 0.9 * fine[key]
    for key in ("peak_deg", "residual_wrong_deg"):
        assert quick[key] > normal[key] > fine[key]
    assert max(one["residual_deg"] for one in (normal, quick, fine)) < 0.35


@pytest.mark.slow
def test_the_file_has_these_figures(figures: dict[tuple[str, str], dict[str, float]]) -> None:
    text = (ROOT / "config" / "j1939-profiles.yaml").read_text(encoding="utf-8")
    rows = re.findall(r"^#  (\w+), (\w+) +([\d. ]+)$", text, re.MULTILINE)
    assert {(axis, name) for axis, name, _ in rows} == figures.keys()
    for axis, name, numbers in rows:
        one = figures[axis, name]
        keys = ("run_on_s", "run_on_travel_s", "peak_deg", "residual_deg", "residual_wrong_deg")
        for value, key, room in zip(
            numbers.split(), keys, (0.03, 0.02, 0.15, 0.05, 0.15), strict=True
        ):
            assert float(value) == pytest.approx(one[key], abs=room), (axis, name, key)


def test_without_profiles_it_says_so() -> None:
    status, output = run(str(ROOT / "config" / "forwarder.yaml"))
    assert status != 0
    assert output.strip().endswith("forwarder.yaml: expected an axis with profiles, got none")
