"""Effects of the profiles of the shipped machine; its file shows them."""

import json
import re
from pathlib import Path

import pytest

from canshaper.campaign import work_results
from tests.cli.invocation import invoke
from tests.rigs.files import ROOT, text_of


def run(*words: str) -> tuple[int, str]:
    done = invoke("profiles", *words)
    return done.exit_code, done.output


@pytest.fixture(scope="module")
def figures() -> dict[tuple[str, str], dict[str, float]]:
    status, output = run("j1939-profiles.yaml", "--json", "--no-work")
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


@pytest.mark.slow
def test_the_recommended_file_has_a_calmer_and_a_quicker_one_and_all_last_half_a_swing() -> None:
    status, output = run("--json", "--no-work")
    assert status == 0, output
    data = json.loads(output)
    assert not data["faults"]
    by_name = {(one["axis"], one["profile"]): one for one in data["presses"]}
    for axis in ("slew", "near_far"):
        precise, own, rough = (by_name[axis, name] for name in ("precise", "normal", "rough"))
        for key in ("run_on_s", "run_on_travel_s"):
            assert rough[key] < 0.8 * own[key] < own[key] < 0.95 * precise[key]
        for key in ("peak_deg", "residual_wrong_deg"):
            assert precise[key] < own[key] < rough[key]
        assert precise["residual_deg"] < 0.4


@pytest.mark.slow
def test_the_crane_is_the_one_of_set(figures: dict[tuple[str, str], dict[str, float]]) -> None:
    status, output = run("j1939-profiles.yaml", "--json", "--no-work", "--set", "grapple.l2_m=1.4")
    assert status == 0, output
    for one in json.loads(output)["presses"]:
        if one["profile"] == "normal":
            assert one["residual_deg"] > 2.0 * figures[one["axis"], "normal"]["residual_deg"]


def short(folder: Path) -> Path:
    """Profiles on near-far alone, one of them shorter than half a swing."""
    slew, near_far = text_of("j1939-profiles").partition("  near_far:\n")[::2]
    slew = re.sub(r"    profiles:\n(      \w+: .*\n)+", "", slew)
    taps = "taps: [2 x 0.1, 32 x 0.0125, 4 x 0.1]"
    near_far = re.sub(r"(quick: .*?)taps: \[.*?\], designed_for: {.*?} ", rf"\1{taps} ", near_far)
    near_far = re.sub(r"      fine: .*\n", "", near_far)
    file = folder / "short.yaml"
    file.write_text(f"{slew}  near_far:\n{near_far}")
    return file


@pytest.mark.slow
def test_a_response_shorter_than_half_a_swing_is_named(tmp_path: Path) -> None:
    status, output = run(str(short(tmp_path)), "--no-work")
    assert status == 0, output
    line = "near_far.profiles.quick.filter: expected half a swing, 1.10 s, or longer, got 0.7"
    assert line in " ".join(output.split())
    assert output.count("half a swing") == 1


@pytest.mark.slow
def test_operators_work_with_each_profile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work_results, "_SPEEDS", (1.0,))
    monkeypatch.setattr(work_results, "_CATCHES", (0.0,))
    tasks = {name: work_results.TASKS[name] for name in ("loading", "tip only")}
    monkeypatch.setattr(work_results, "TASKS", tasks)
    status, output = run(str(short(tmp_path)), "--seeds", "2", "--json")
    assert status == 0, output
    data = json.loads(output[output.index("{") :])
    for task in tasks:
        assert data["work"][task].keys() == {"off", "normal", "quick"}
    still, tip = (data["work"][task] for task in tasks)
    assert still["normal"]["empty"] < still["off"]["empty"]
    assert tip["off"]["empty"] < min(tip["quick"]["empty"], tip["normal"]["empty"])
    slower = [
        fault for fault in data["faults"] if fault.endswith("slower than off at 30 cm, tip only")
    ]
    assert [fault.partition(":")[0] for fault in slower] == ["normal", "quick"]


def test_a_wrong_parameter_is_named_first() -> None:
    status, output = run("forwarder.yaml", "--set", "pump=1")
    assert status == 2
    assert output.startswith("--set pump=1: expected a parameter, got 'pump'")


def test_without_profiles_it_says_so() -> None:
    status, output = run(str(ROOT / "config" / "forwarder.yaml"))
    assert status != 0
    assert output.strip().endswith("forwarder.yaml: expected an axis with profiles, got none")
