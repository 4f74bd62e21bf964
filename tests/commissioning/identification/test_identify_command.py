"""``canshaper identify`` from the outside."""

import json
import math
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from canshaper.cli.app import app
from canshaper.config.section import Origin
from canshaper.edit.edit import written_by
from canshaper.machine.binding import load_deployment
from canshaper_sim.grapple import Sway
from tests.commissioning.identification.machine import (
    EMPTY,
    LOADED,
    candump,
    driven,
    main,
    period_of,
    phone,
)
from tests.rigs.files import ROOT, machine_file


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("logs")
    main(directory)
    candump(directory / "still.log", driven(20.0))
    phone(directory / "Gyroscope.csv", driven(30.0, sway=Sway(0.2)))
    return directory


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "config").mkdir()
    shutil.copytree(ROOT / "dbc", tmp_path / "dbc")
    return Path(shutil.copy(ROOT / "config" / "forwarder.yaml", tmp_path / "config"))


def run(tmp_path: Path, *options: str | Path) -> Result:
    out = str(tmp_path / "out")
    return CliRunner().invoke(app, ["identify", *map(str, options), "--out", out])


def said(result: Result) -> str:
    return " ".join(result.output.split())


@pytest.mark.slow
def test_a_speed_with_which_the_tip_stops_too_late_is_not_written(
    tmp_path: Path, file: Path, logs: Path
) -> None:
    """The file would be refused at the next start."""
    text = file.read_text().replace("full_speed_m_s: 1.0", "full_speed_m_s: 0.5")
    file.write_text(text.replace("stop_distance_m: 1 }", "stop_distance_m: 0.2 }"))
    before = file.read_text()
    result = run(tmp_path, logs / "empty.log", "--file", file, "--write")
    assert result.exit_code == 2
    assert "axis near_far: with sway: { period_s: 2.20" in said(result)
    assert "limits.stop_distance_m: expected" in said(result)
    assert file.read_text() == before


@pytest.mark.slow
def test_both_axes_of_a_log_are_written(tmp_path: Path, file: Path, logs: Path) -> None:
    before = file.read_text().splitlines()
    result = run(tmp_path, logs / "empty.log", "--file", file, "--write")
    assert result.exit_code == 0, result.output
    assert "Slew: period 2.35" in result.output
    assert "Near-far: period 2.20" in result.output
    assert "Use sway: { period_s: 2.35" in said(result)
    assert f"Written to {file}" in result.output
    assert f"canshaper robust {file} --axis slew" in result.output
    assert f"replaces the filter gff, which canshaper tune {file} --axis slew keeps" in said(result)
    axes = load_deployment(file).axes
    for name, mode in (("slew", EMPTY.mode5), ("near_far", EMPTY.mode6)):
        sway = axes[name].config.sway
        assert sway and sway.period_s and sway.damping_ratio
        assert sway.length_m is None
        assert sway.period_s == pytest.approx(period_of(mode), rel=0.005)
        assert sway.damping_ratio == pytest.approx(mode.zeta, rel=0.1)
    assert axes["slew"].config.sway.full_speed_m_s == pytest.approx(1.5, rel=0.15)  # type: ignore[union-attr]
    # Two lines are others, and the comment above each.
    after = file.read_text().splitlines()
    changed = [b for a, b in zip(before, after, strict=True) if a != b]
    assert changed[::2] == ["    # Written by canshaper identify."] * 2
    origin = axes["slew"].config.sway.origin  # type: ignore[union-attr]
    assert origin == Origin(**written_by("identify", simulated=True, log="empty.log"))
    assert len(changed) == 4
    check = CliRunner().invoke(app, ["check", str(file)])
    assert check.exit_code == 0, check.output
    picture = tmp_path / "out" / "identify.png"
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert picture.stat().st_size > 30_000


@pytest.mark.slow
def test_empty_and_loaded(tmp_path: Path, file: Path, logs: Path) -> None:
    labelled = f"empty={logs / 'empty.log'}", f"loaded={logs / 'loaded.log'}"
    result = run(tmp_path, *labelled, "--file", file, "--json", "--write")
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert [(f["axis"], f["label"]) for f in report["findings"]] == [
        ("slew", "empty"),
        ("near_far", "empty"),
        ("slew", "loaded"),
        ("near_far", "loaded"),
    ]
    for finding in report["findings"]:
        grapple = EMPTY if finding["label"] == "empty" else LOADED
        mode = grapple.mode5 if finding["axis"] == "slew" else grapple.mode6
        assert finding["usable"]
        assert finding["period_s"]["low"] < period_of(mode) < finding["period_s"]["high"]
    near = report["axes"]["near_far"]
    lengths = [period_of(g.mode6) ** 2 for g in (EMPTY, LOADED)]
    assert near["sway"]["period_s"] == pytest.approx(math.sqrt(sum(lengths) / 2), rel=0.003)
    spread = 100.0 * (lengths[1] - lengths[0]) / sum(lengths)
    assert near["spread_pct"] == pytest.approx(spread, abs=1.0)
    assert (
        f"robust shaper for ±{math.ceil(near['spread_pct'] + 3)} % length" in near["recommendation"]
    )
    assert report["written"] == ["slew", "near_far"]
    sway = load_deployment(file).axes["near_far"].config.sway
    assert sway and sway.period_s == near["sway"]["period_s"]


@pytest.mark.slow
def test_sets_where_the_deployment_knows_the_grapple(
    tmp_path: Path, file: Path, logs: Path
) -> None:
    """Numbers as labels are the values of its signal."""
    text = "load_state: { bus: crane, message: TipPosition, signal: Radius, timeout_ms: 500 }\n"
    file.write_text(file.read_text() + text)
    labelled = f"300={logs / 'empty.log'}", f"1200={logs / 'loaded.log'}"
    result = run(tmp_path, *labelled, "--file", file)
    assert result.exit_code == 0, result.output
    assert "give slew a gain schedule, a breakpoint for each state" in said(result)
    assert f"canshaper robust {file} --axis slew --range 1" in said(result)
    assert "- breakpoint: 300 # 300 sway: { period_s: 2.35" in said(result)
    assert "- breakpoint: 1200 # 1200 sway: { period_s: 2.7" in said(result)


@pytest.mark.slow
def test_a_log_without_a_deployment(tmp_path: Path, logs: Path) -> None:
    dbc = ROOT / "dbc" / "forwarder.dbc"
    options = "--dbc", dbc, "--signal", "boom=GrappleSway.SwayParallel"
    result = run(tmp_path, logs / "empty.log", *options)
    assert result.exit_code == 0, result.output
    assert "Boom: period 2.20" in result.output


@pytest.mark.slow
def test_a_phone(tmp_path: Path, file: Path, logs: Path) -> None:
    phone_ = logs / "Gyroscope.csv"
    result = run(tmp_path, phone_, "--file", file, "--axis", "slew", "--write")
    assert result.exit_code == 0, result.output
    sway = load_deployment(file).axes["slew"].config.sway
    assert sway and sway.period_s == pytest.approx(period_of(EMPTY.mode5), rel=0.002)
    assert sway.full_speed_m_s == 1.5  # what was there
    column = "near_far=Gyroscope x (rad/s)"
    result = run(tmp_path, phone_, "--file", file, "--signal", column)
    assert result.exit_code == 0, result.output
    assert "Near-far: period 2.35" in result.output


def test_a_stopwatch(tmp_path: Path, file: Path) -> None:
    timed = "--swings", "10", "--seconds", "23.6", "--first", "20", "--last", "5"
    result = run(tmp_path, *timed)
    assert result.exit_code == 0, result.output
    assert "Use sway: { period_s: 2.3" in said(result)
    result = run(tmp_path, *timed, "--file", file, "--axis", "near_far", "--write")
    assert result.exit_code == 0, result.output
    sway = load_deployment(file).axes["near_far"].config.sway
    assert sway and (sway.period_s, sway.damping_ratio) == (2.3539, 0.0221)
    assert not (tmp_path / "out").exists()  # nothing to draw


def test_an_axis_that_follows_its_rope_keeps_the_rope(tmp_path: Path) -> None:
    file = machine_file(tmp_path, "bridge-crane")
    timed = "--swings", "10", "--seconds", "60", "--first", "20", "--last", "5"
    before = file.read_bytes()
    result = run(tmp_path, *timed, "--file", file, "--axis", "trolley", "--write")
    assert result.exit_code == 2
    assert "axis trolley: expected an axis with a period, got one that follows" in said(result)
    assert file.read_bytes() == before


def test_without_enough_data_nothing_is_written(tmp_path: Path, file: Path, logs: Path) -> None:
    before = file.read_bytes()
    result = run(tmp_path, logs / "still.log", "--file", file, "--write")
    assert result.exit_code == 1
    assert "not enough data" in result.output
    assert "drive the axis shortly, let go of the joysticks" in result.output
    assert "Written" not in result.output
    assert file.read_bytes() == before


@pytest.mark.slow
def test_a_state_without_enough_data_keeps_the_axis_from_being_written(
    tmp_path: Path, file: Path, logs: Path
) -> None:
    before = file.read_bytes()
    labelled = f"empty={logs / 'empty.log'}", f"loaded={logs / 'still.log'}"
    result = run(tmp_path, *labelled, "--file", file, "--write")
    assert result.exit_code == 1
    assert "1 of 2 states could not be used" in said(result)
    assert file.read_bytes() == before


LOG = "{logs}/empty.log"
BAD = {
    "nothing": ("", "expected a log or a stopwatch, got neither"),
    "no such log": ("nowhere.log", "nowhere.log"),
    "no such table": ("nowhere.csv", "nowhere.csv"),
    "no log": ("{logs}/empty", "each but .db also with .gz behind, got none"),
    "no such file": (f"{LOG} --file nowhere.yaml", "nowhere.yaml"),
    "write to nothing": (f"{LOG} --write", "--write: expected --file too"),
    "no equals": (f"{LOG} --signal slew", "--signal: expected AXIS=NAME, got 'slew'"),
    "no such axis": (
        f"{LOG} --file {{file}} --signal crab=A.B",
        "expected an axis, got 'crab'; there are slew, near_far, lift",
    ),
    "twice": (
        f"{LOG} --signal slew=A.B --signal slew=A.C",
        "--signal: expected one signal of slew, got two",
    ),
    "phone without axis": (
        "{logs}/Gyroscope.csv --file {file}",
        "--axis: expected an axis, got none; there are slew, near_far, lift",
    ),
    "axis without sway": (
        "{logs}/Gyroscope.csv --file {file} --axis lift --write",
        "axis lift: expected a section sway to write to, got none; put in sway: { period_s: 2.35",
    ),
    "half a stopwatch": (
        "--swings 10 --seconds 23",
        "together, and no log, got none of --first, --last",
    ),
    "stopwatch and log": (
        f"{LOG} --swings 9 --seconds 20 --first 9 --last 5",
        "together, and no log, got the log",
    ),
    "dbc": (f"{LOG} --dbc {{file}}", "not a DBC file"),
    "one of two axes without sway": (
        f"{LOG} --file {{file}} --write --signal slew=GrappleSway.SwayPerpendicular"
        " --signal lift=GrappleSway.SwayParallel",
        "axis lift: expected a section sway to write to, got none",
    ),
    "no signal of an axis": (
        f"{LOG} --file {{file}} --axis lift",
        "expected --signal AXIS=MESSAGE.SIGNAL with what shows the swing, got none",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_is_reported(tmp_path: Path, file: Path, logs: Path, name: str) -> None:
    before = file.read_bytes()
    options, text = BAD[name]
    result = run(tmp_path, *options.format(logs=logs, file=file).split())
    assert result.exit_code == 2, result.output
    assert text in result.output
    assert "Traceback" not in result.output
    assert file.read_bytes() == before


def test_a_shipped_file_is_not_written_to(
    tmp_path: Path, logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(tmp_path, logs / "empty.log", "--file", "forwarder.yaml", "--write")
    assert result.exit_code == 2
    assert "copy it" in result.output
