"""``canshaper tune`` from the outside."""

import json
import re
import shutil
from pathlib import Path

import pytest
from typer.testing import Result

from canshaper.config.load import load_config
from canshaper.design.tuning.deploy import deployed, setting
from canshaper.design.tuning.evaluate import Machine
from canshaper.design.tuning.optimal import Tuning, manual
from canshaper.edit.edit import flow, written_by
from canshaper.shaping.sway import SwayMode
from tests.cli.invocation import invoke
from tests.rigs.files import ROOT

MODE = SwayMode.from_grapple(1.2, 120.0, 300.0)
DESIGNED = (
    "designed_for: { period_s: 2.356, damping_ratio: 0.038, duration_s: 2.8,"
    " valve_rate_per_s: 5.0, objective: { q: [1.0, 1.0], r: 1.0, s: 3.0, p: 1.0, states: sway,"
    " pole_distance: text, horizon_s: 3.0, third_pole: false, within_command: true } }"
)
UNSTATED = (", stop_distance_m: 1 }", " }")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "config").mkdir()
    shutil.copytree(ROOT / "dbc", tmp_path / "dbc")
    return Path(shutil.copy(ROOT / "config" / "forwarder.yaml", tmp_path / "config"))


def run(file: Path, *options: str) -> Result:
    return invoke("tune", file, "--out", file.parent / "out", *options)


@pytest.mark.slow
def test_result_and_picture(file: Path) -> None:
    before = file.read_bytes()
    result = run(file, "--axis", "near_far")
    assert result.exit_code == 0, result.output
    for text in (
        "in the file",
        "0.6995",
        "0.122325",
        "length -30 %",
        "Held by: real poles (14d), within the command",
        "cost at most 1 % more",
        "3 of 3 starts ended here",
        "Use a1: 0.6995, a2: 0.122325 for near_far",
        "Released at full speed, near_far travels 0.7",
    ):
        assert text in re.sub(r"\s*\n", " ", result.output) or text in result.output
    picture = file.parent / "out" / "near_far.png"
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert picture.stat().st_size > 20_000
    assert file.read_bytes() == before


@pytest.mark.slow
def test_json(file: Path) -> None:
    result = run(file, "--axis", "slew", "--json", "--third-pole", "--max-run-on", "2.2")
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["axis"] == "slew"
    assert report["converged"] == 3
    assert report["third_pole_rad_s"] < 0.0
    assert report["run_on_s"] <= 2.2
    assert report["first_jump"] <= 0.1 + 1e-6
    assert [r["length_pct"] for r in report["residuals"]] == [-30, -20, -10, 0, 10, 20, 30]
    assert report["in_file"]["first_jump"] == pytest.approx(1.11, abs=0.01)
    assert report["written"] is None


@pytest.mark.slow
def test_write_and_write_back(file: Path) -> None:
    file.write_text(file.read_text().replace(", stop_distance_m: 4.7 }", " }"))  # the tail stays
    before = file.read_text()
    result = run(file, "--axis", "slew", "--third-pole", "--write")
    assert result.exit_code == 0, result.output
    assert "Written to" in result.output
    with_third = load_config(file)[0].axes["slew"].filter.parameters()
    assert set(with_third) == {"a1", "a2", "third_pole_rad_s"}
    changed = [
        a for a, b in zip(file.read_text().splitlines(), before.splitlines(), strict=True) if a != b
    ]
    assert len(changed) == 1
    result = run(file, "--axis", "slew", "--two-poles", "--write", "--json", "--starts", "1")
    assert result.exit_code == 0, result.output
    printed = json.loads(result.stdout)
    after = load_config(file)[0].axes["slew"].filter.parameters()
    assert after == {"a1": printed["a1"], "a2": printed["a2"]}
    origin = f"origin: {flow(written_by('tune', simulated=None))}"
    designed_for = f"{DESIGNED.removesuffix(' }')}, {origin} }}"
    expected = before.replace(
        "a1: 0.708, a2: 0.12 }\n", f"a1: {printed['a1']}, a2: {printed['a2']}, {designed_for} }}\n"
    )
    assert file.read_text() == expected


@pytest.mark.slow
def test_the_tail_is_written_where_the_stopping_distance_allows_it(file: Path) -> None:
    before = file.read_text().splitlines()
    result = run(file, "--axis", "near_far", "--write")
    assert result.exit_code == 0, result.output
    after = file.read_text().splitlines()
    changed = [pair for pair in zip(before, after, strict=True) if pair[0] != pair[1]]
    assert len(changed) == 2
    assert changed[1][1] == changed[1][0].replace("tail_s: 2.0", "tail_s: 2.6")
    diff = [line for line in result.output.splitlines() if line[:5] in ("-    ", "+    ")]
    assert sorted(diff) == sorted(
        s + one for pair in changed for s, one in zip("-+", pair, strict=True)
    )
    assert "WARNING" not in result.output
    assert "designed_for" not in invoke("check", file).output
    result = run(file, "--axis", "near_far", "--json", "--write")
    assert json.loads(result.stdout)["tail_needed_s"] is None
    assert json.loads(result.stdout)["changed"] == []
    assert file.read_text().splitlines() == after


@pytest.mark.slow
def test_the_longer_tail_leaves_less_swing_at_the_same_stop(file: Path) -> None:
    assert run(file, "--axis", "near_far", "--write").exit_code == 0
    measured = []
    for tail in ("tail_s: 2.6", "tail_s: 2.0"):
        file.write_text(file.read_text().replace("tail_s: 2.6", tail))
        in_file = json.loads(run(file, "--axis", "near_far", "--json").stdout)["in_file"]
        left = next(r["machine"] for r in in_file["residuals"] if r["length_pct"] == 0)
        measured.append((left, in_file["run_on_s"]))
    assert measured[0] == pytest.approx((0.012, 1.86), abs=0.001)
    assert measured[1] == pytest.approx((0.044, 1.86), abs=0.001)


@pytest.mark.slow
def test_a_tail_without_a_stated_distance_stays_and_check_warns(file: Path) -> None:
    file.write_text(file.read_text().replace(*UNSTATED))
    result = run(file, "--axis", "near_far", "--write", "--json")
    (minus, plus, warning) = json.loads(result.stdout)["changed"]
    assert (minus[0], plus[0]) == ("-", "+")
    assert warning.startswith(
        "WARNING: axes.near_far.limits.tail_s: expected 2.6 s, got 2 s, which stays:"
        " stop_distance_m: missing: to stop, the limits allow 2.73 m,"
    )
    assert load_config(file)[0].axes["near_far"].limits.tail_s == 2.0
    checked = invoke("check", file)
    assert checked.exit_code == 0
    says = "expected limits.tail_s of 2.6 s or more, got 2 s; lengthen it"
    line = file.read_text().splitlines().index(plus[1:]) + 1
    assert f"{file}:{line}: axes.near_far.filter.designed_for.duration_s: {says}" in checked.output


@pytest.mark.slow
def test_limits_that_the_file_leaves_out_get_a_section(file: Path) -> None:
    text = file.read_text()
    block = next(row for row in text.splitlines(keepends=True) if "stop_distance_m: 1 }" in row)
    file.write_text(text.replace(block, ""))
    result = run(file, "--axis", "near_far", "--write")
    assert "tail_s: expected 2.6 s, got 2 s, which stays: stop_distance_m: missing" in result.output
    near = "full_speed_m_s: 1.0 }"
    file.write_text(file.read_text().replace(near, near.replace("1.0", "0.7")))
    result = run(file, "--axis", "near_far", "--write")
    assert "+    limits: { tail_s: 2.6 }" in result.output.splitlines()
    assert load_config(file)[0].axes["near_far"].limits.tail_s == 2.6


@pytest.mark.slow
def test_another_filter_is_replaced_on_write(file: Path) -> None:
    file.write_text(
        file.read_text().replace("{ kind: gff, a1: 0.708, a2: 0.12 }\n", "{ kind: zv }\n")
    )
    result = run(file, "--axis", "slew", "--method", "manual", "--write", "--force")
    assert result.exit_code == 0, result.output
    assert "in the file" not in result.output
    assert load_config(file)[0].axes["slew"].filter.kind == "gff"


@pytest.mark.slow
def test_length_range_takes_the_tail_as_run_on(file: Path) -> None:
    result = run(file, "--axis", "near_far", "--length-range", "15", "--json")
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert "run-on" in report["active"]
    assert 1.9 < report["run_on_s"] <= 2.0


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ("crab", "expected one with sway data, slew, near_far, got no such"),
        ("lift", "no sway data"),
        ("slew --p -1", "weight P: expected 0 to 1e+06, got -1"),
        ("slew --method best", "--method: expected optimal or manual, got best"),
        ("slew --pole-distance far", "expected one of text, printed, off, got far"),
        ("slew --states all", "expected one of sway, deviation, companion, none, got all"),
        ("slew --starts 0", "expected 1 to 1000, got 0"),
        ("slew --method manual --max-jump 1", "are for --method optimal"),
        pytest.param(
            "near_far --max-run-on 1.2",
            "attainable with the others kept: run-on at most 1.8",
            marks=pytest.mark.slow,
        ),
        ("near_far --max-rate 0.1 --beyond-command --max-jump 0.01", "first jump"),
    ],
)
def test_errors_leave_the_file_alone(file: Path, options: str, text: str) -> None:
    before = file.read_bytes()
    result = run(file, "--axis", *options.split(), "--write")
    assert result.exit_code == 2, result.output
    assert text in result.output.replace("\n", " ")
    assert f"axis {options.split(maxsplit=1)[0]}" in result.output
    assert file.read_bytes() == before


def test_an_out_that_is_a_file_is_reported(file: Path, tmp_path: Path) -> None:
    (tmp_path / "here").touch()
    result = run(file, "--axis", "slew", "--method", "manual", "--out", str(tmp_path / "here"))
    assert (result.exit_code, result.output) == (2, f"{tmp_path / 'here'}: File exists\n")


@pytest.mark.parametrize("pole", [-0.71234567, -2.8591956, -3.3333333333, -17.77777777])
def test_digits_of_a_file_keep_poles_real_and_the_jump_small(pole: float) -> None:
    a1, a2 = -2.0 / pole, 1.0 / pole**2
    tuned = deployed(Tuning((pole, pole), pole, a1, a2, "optimal"), MODE, 0.02, Machine())
    assert tuned.a2 >= a2
    assert tuned.a1**2 >= 4.0 * tuned.a2
    assert tuned.poles_rad_s == pytest.approx((pole, pole), rel=5e-3)
    assert tuned.third_pole_rad_s == pytest.approx(pole, rel=1e-5)
    assert len(f"{tuned.a1}".replace(".", "").lstrip("0")) <= 6


def test_manual_setting_is_measured() -> None:
    tuned = deployed(manual(MODE), MODE, 0.02, Machine())
    assert tuned.measures.run_on_s > 5.0
    same = setting(
        a1=tuned.a1, a2=tuned.a2, third_pole_rad_s=None, mode=MODE, tick_s=0.02, machine=Machine()
    )
    assert same == tuned
