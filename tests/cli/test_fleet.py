"""``replay`` and ``identify`` over a folder of logs: one table of machines and days."""

import gzip
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from canshaper.cli.app import app
from canshaper.cli.log_folders import logs_below
from canshaper.codec.frame import Frame
from canshaper.design.lockstep import Simulation
from canshaper.machine.binding import load_deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.operator import Script, Stroke
from tests.rigs.files import CONFIG

PLAIN, ROBUST = str(CONFIG / "forwarder.yaml"), str(CONFIG / "forwarder-robust.yaml")
DAY_S = 86_400
FIRST_DAY_S = 1_780_000_000  # 2026-05-28 in UTC

# Full strokes, each with a rest of seven swings.
SCRIPT = Script(
    "swings", (Stroke("slew", 0.5, 0.6, 0.6, 0.1), Stroke("near_far", 22.0, 0.6, 0.8, 0.1)), 44.0
)


def write_log(path: Path, start_s: float, longer_pct: float = 0.0) -> None:
    """A drive without anti-sway, as candump writes it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    crane = CraneParameters()
    crane = replace(crane, grapple=crane.grapple.longer(longer_pct))
    with path.open("w", encoding="ascii") as log:

        def write(frame: Frame, time_s: float) -> None:
            data = frame.data.hex().upper()
            log.write(f"({start_s + time_s:.6f}) crane {frame.can_id:03X}#{data}\n")

        deployment = load_deployment(Path(PLAIN))
        for _ in Simulation(deployment, SCRIPT, write, parameters=crane, bypass=True).ticks():
            pass


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fleet")
    write_log(folder / "north" / "monday.log", FIRST_DAY_S)
    write_log(folder / "north" / "tuesday.log", FIRST_DAY_S + DAY_S, longer_pct=25.0)
    write_log(folder / "south" / "monday.log", FIRST_DAY_S)
    (folder / "south" / "rubbish.asc").write_text("no log\n")
    (folder / "south" / "notes.txt").write_text("not a log at all\n")
    return folder


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, [*arguments, "--processes", "1"], env={"COLUMNS": "100"})


def logs(out: Path) -> dict[str, Any]:
    rows = json.loads((out / "fleet.json").read_text())
    return {f"{log['machine']}/{Path(log['log']).name}": log for log in rows}


@pytest.mark.slow
def test_every_log_is_replayed_through_both_and_a_bad_one_is_reported(
    fleet: Path, tmp_path: Path
) -> None:
    done = run("replay", str(fleet), "--config", PLAIN, "--config", ROBUST, "--out", str(tmp_path))
    assert done.exit_code == 1
    assert "3 of 4 logs" in done.output
    assert f"not read: {fleet / 'south' / 'rubbish.asc'}:1: " in done.output
    by_log = logs(tmp_path)
    assert [*by_log] == [
        "north/monday.log",
        "north/tuesday.log",
        "south/monday.log",
        "south/rubbish.asc",
    ]
    rows = {(row["deployment"], row["axis"]): row for row in by_log["north/monday.log"]["rows"]}
    assert rows.keys() >= {
        (d, a) for d in ("forwarder", "forwarder-robust") for a in ("slew", "near_far")
    }
    assert rows["forwarder", "slew"]["day"] == "2026-05-28"
    assert rows["forwarder", "slew"]["residual_deg"] < rows["forwarder", "slew"]["straight_deg"]
    assert by_log["south/monday.log"]["rows"] == by_log["north/monday.log"]["rows"]


@pytest.mark.slow
def test_a_log_of_a_folder_says_the_same_as_alone(fleet: Path, tmp_path: Path) -> None:
    run("replay", str(fleet), "--config", ROBUST, "--out", str(tmp_path / "all"))
    one = fleet / "north" / "monday.log"
    CliRunner().invoke(
        app, ["replay", str(one), "--config", ROBUST, "--out", str(tmp_path / "one")]
    )
    alone = json.loads((tmp_path / "one" / "replay.json").read_text())["forwarder-robust"]["axes"]
    rows = logs(tmp_path / "all")["north/monday.log"]["rows"]
    for row in rows:
        assert row["residual_deg"] == alone[row["axis"]]["replayed"]["residual_deg"]
        assert row["stops"] == alone[row["axis"]]["stops"]


@pytest.mark.slow
def test_periods_of_all_machines_and_where_one_has_drifted(fleet: Path, tmp_path: Path) -> None:
    done = run("identify", str(fleet), "--file", PLAIN, "--out", str(tmp_path))
    assert done.exit_code == 1  # one cannot be read
    drift = r"DRIFT: north slew: period 2\.3\d+ s on 2026-05-28, 2\.(5|6)\d+ s on 2026-05-29"
    assert re.search(drift, done.output)
    assert "DRIFT: south" not in done.output
    rows = {row["axis"]: row for row in logs(tmp_path)["south/monday.log"]["rows"]}
    near_far = rows["near_far"]
    assert abs(near_far["period_s"] - 2.2) < near_far["period_s_half"] + 0.02


def test_what_is_made_of_a_log_is_none(tmp_path: Path) -> None:
    (tmp_path / "north").mkdir()
    logs = ["north/drive.log", "packed.ASC.gz", "stop.blackbox", "two.days.blf"]
    others = ["notes.txt", "drive.log.png", "drive.log.bak", "stop.blackbox.part", "old.zip.part"]
    for name in (*logs, *others, "bundle.zip"):
        (tmp_path / name).touch()
    names = [path.relative_to(tmp_path).as_posix() for _, path in logs_below(tmp_path)]
    assert names == logs
    assert ("north", tmp_path / "north" / "drive.log") in logs_below(tmp_path)
    with_bundles = [path.name for machine, path in logs_below(tmp_path, ".zip") if machine == "."]
    assert with_bundles == ["bundle.zip", *logs[1:]]


@pytest.mark.parametrize("verb", [("replay", "--config"), ("identify", "--file")])
def test_a_folder_without_logs_is_reported(verb: tuple[str, str], tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    done = run(verb[0], str(tmp_path / "empty"), verb[1], PLAIN, "--out", str(tmp_path / "out"))
    text = f"{tmp_path / 'empty'}: expected a folder with logs, got one without\n"
    assert (done.exit_code, done.output) == (2, text)


@pytest.mark.slow
def test_a_log_that_is_cut_off_is_reported_as_it_is_alone(fleet: Path, tmp_path: Path) -> None:
    whole = gzip.compress((fleet / "north" / "monday.log").read_bytes())
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "cut.log.gz").write_bytes(whole[: len(whole) // 2])
    for verb in (("replay", "--config"), ("identify", "--file")):
        arguments = (verb[0], str(tmp_path / "logs"), verb[1], PLAIN, "--out", str(tmp_path))
        done = run(*arguments)
        assert done.exit_code == 0
        assert re.search(r"note: cut\.log\.gz: .*: the log is cut off", done.output)


@pytest.mark.slow
def test_every_row_names_its_axis_on_a_narrow_terminal(fleet: Path, tmp_path: Path) -> None:
    arguments = ["replay", str(fleet / "north"), "--config", PLAIN, "--out", str(tmp_path)]
    done = CliRunner().invoke(app, [*arguments, "--processes", "1"], env={"COLUMNS": "50"})
    lines = done.output.splitlines()
    names = [line.partition("  ")[0] for line in lines if line.lstrip().startswith("monday.log")]
    axes = [f" monday.log {axis}" for axis in ("slew", "near_far", "lift")]
    assert len(names) > 3
    assert names == axes * (len(names) // 3)
    assert max(map(len, lines[:-1])) <= 50


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("replay", "--config", PLAIN, "--verify"), "--verify: expected one log, got the folder "),
        (("replay", "--config", PLAIN, "--to", "5"), "--to: expected one log, got the folder "),
        (("identify", "--file", PLAIN, "--json"), "--json: expected one log, got the folder "),
        (("identify", "--together"), "--together: expected one log, got the folder "),
        (("identify", "--swings", "0"), "--swings: expected one log, got the folder "),
        (("identify", "more.log"), "more.log: expected a folder like "),
        (("replay", "--config", PLAIN, "--channel", "x=1"), "--channel: expected a bus, got x;"),
    ],
)
def test_what_says_nothing_of_many_logs_is_refused(
    fleet: Path, tmp_path: Path, arguments: tuple[str, ...], text: str
) -> None:
    verb, *others = arguments
    done = run(verb, str(fleet), *others, "--out", str(tmp_path / "out"))
    assert (done.exit_code, len(done.output.splitlines())) == (2, 1)
    assert done.output.startswith(text)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_report_of_a_fleet_says_which_file_it_is_of(fleet: Path, tmp_path: Path) -> None:
    report = tmp_path / "fleet.html"
    arguments = ("--config", PLAIN, "--out", str(tmp_path), "--report", str(report))
    assert run("replay", str(fleet / "north"), *arguments).exit_code == 0
    assert load_deployment(Path(PLAIN)).identity.lines()[0] in report.read_text()


@pytest.mark.slow
def test_a_part_that_the_log_does_not_have_is_reported(fleet: Path, tmp_path: Path) -> None:
    log = str(fleet / "north" / "monday.log")
    done = CliRunner().invoke(
        app, ["replay", log, "--config", PLAIN, "--from", "900", "--out", str(tmp_path)]
    )
    assert done.exit_code == 2
    assert done.output.startswith("--from, --to: expected a part of 4")
