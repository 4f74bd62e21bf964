"""``canshaper campaign`` as a person, a batch system and a CI use it."""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from canshaper.campaign.store import parts
from canshaper.design.parallel import Processes
from tests.cli.invocation import invoke
from tests.rigs.files import CONFIG, machine_file

PLAIN = str(CONFIG / "forwarder.yaml")


campaign = partial(invoke, "campaign", columns=120)


def machine(folder: Path, more: str) -> str:
    return str(machine_file(folder, "forwarder", more=f"\n{more}\n"))


def rows(folder: Path) -> list[dict[str, Any]]:
    rows = [row for path in parts(folder) for row in pq.read_table(path).to_pylist()]
    return sorted(rows, key=lambda row: row["seed"])


@pytest.mark.slow
def test_drives_are_summed_up_and_kept(tmp_path: Path) -> None:
    report = tmp_path.with_suffix(".html")
    arguments = ("-n", "24", "--processes", "1", "--out", str(tmp_path), "--report", str(report))
    done = campaign(PLAIN, *arguments, "--engine", "python")
    assert done.exit_code == 0, done.output
    assert "Drives by engine: 24 python; " in done.output
    assert "Promises: 0 of 24 drives" in report.read_text()
    assert "forwarder.yaml: 24 drives" in done.output
    assert "Promises: 0 of 24 drives broke one; with 95 % confidence at most 0.12 of" in done.output
    kept = rows(tmp_path)
    assert [row["seed"] for row in kept] == [*range(24)]
    assert pq.read_table(tmp_path).num_rows == 24  # as any program reads a folder
    summary = json.loads((tmp_path / "_summary.json").read_text())
    assert summary["accepted"] is True
    assert summary["promises"]["most"] == pytest.approx(1.0 - 0.05 ** (1 / 24))
    worst = [row["seed"] for row in summary["worst"]]
    sound = [row for row in kept if not row["fault"] and row["residual_deg"] is not None]
    assert worst[0] == max(sound, key=lambda row: row["residual_deg"])["seed"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limit", "code", "text"),
    [(90, 0, "kept"), (0.001, 1, "EXCEEDED"), ("p99", 1, "NOT SHOWN")],
)
def test_the_limits_of_the_file_decide(tmp_path: Path, limit: Any, code: int, text: str) -> None:
    # Of 24 drives no upper bound of a p99 is known, however far the limit is.
    key = "residual_deg_p99: 1000" if limit == "p99" else f"residual_deg_p50: {limit}"
    file = machine(tmp_path, f"accept: {{ {key} }}")
    done = campaign(file, "-n", "24", "--processes", "1", "--out", str(tmp_path / "out"))
    assert done.exit_code == code
    assert f": {text}" in done.output


@pytest.mark.slow
def test_shares_make_the_same_drives_as_one_campaign(tmp_path: Path) -> None:
    whole = ("-n", "7", "--processes", "1")
    assert campaign(PLAIN, *whole, "--out", str(tmp_path / "whole")).exit_code == 0
    merge = []
    for part in (1, 2, 3):
        out = tmp_path / f"share{part}"
        assert campaign(PLAIN, *whole, "--shard", f"{part}/3", "--out", str(out)).exit_code == 0
        merge += ["--merge", str(out)]
    done = campaign(PLAIN, *merge, "--out", str(tmp_path / "merged"))
    assert done.exit_code == 0
    merged, drives = rows(tmp_path / "merged"), rows(tmp_path / "whole")
    # The first drive of each share is driven by both engines.
    assert [{**row, "engine": ""} for row in merged] == [{**row, "engine": ""} for row in drives]


@pytest.mark.slow
def test_it_goes_on_where_it_was_and_never_by_mistake(tmp_path: Path) -> None:
    arguments = (PLAIN, "--processes", "1", "--out", str(tmp_path))
    campaign(*arguments, "-n", "3")
    refused = campaign(*arguments, "-n", "5")
    assert refused.exit_code == 2
    assert "expected a folder without drives, or --resume" in refused.output
    before = [path.stat().st_mtime_ns for path in parts(tmp_path)]
    assert campaign(*arguments, "-n", "5", "--resume").exit_code == 0
    assert [row["seed"] for row in rows(tmp_path)] == [0, 1, 2, 3, 4]
    assert [path.stat().st_mtime_ns for path in parts(tmp_path)][:1] == before


@pytest.mark.slow
def test_two_files_meet_the_same_drives(tmp_path: Path) -> None:
    other = str(CONFIG / "forwarder-robust.yaml")
    arguments = ("-n", "12", "--processes", "1", "--out", str(tmp_path))
    done = campaign(PLAIN, "--against", other, *arguments)
    assert done.exit_code == 0
    assert "second - first" in done.output
    one, two = rows(tmp_path / "a-forwarder"), rows(tmp_path / "b-forwarder-robust")
    drawn = ("seed", "operator", "fault", "length_pct", "radius_m", "slew_lag_s")
    assert [[row[key] for key in drawn] for row in one] == [
        [row[key] for key in drawn] for row in two
    ]
    assert [row["residual_deg"] for row in one] != [row["residual_deg"] for row in two]


@pytest.mark.parametrize(
    ("more", "line"),
    [
        (
            "uncertainty: { length_pct: [15, -15] }",
            "uncertainty.length_pct: expected the lower end first, got 15 to -15",
        ),
        (
            "uncertainty: { valve_lag_s: [0.05, 2] }",
            "uncertainty.valve_lag_s.1: expected 0.01 to 1 s, got 2",
        ),
        ("accept: { residual_p99: 1 }", "accept.residual_p99: "),
    ],
)
def test_a_wrong_range_or_limit_is_reported_with_its_line(
    tmp_path: Path, more: str, line: str
) -> None:
    done = campaign(machine(tmp_path, more), "--out", str(tmp_path / "out"))
    assert done.exit_code == 2
    assert line in done.output
    assert len(done.output.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("shard", ["0/3", "4/3", "1", "a/b", "5/5"])
def test_a_share_that_cannot_be_or_has_no_drive_is_refused(tmp_path: Path, shard: str) -> None:
    done = campaign(PLAIN, "-n", "3", "--shard", shard, "--out", str(tmp_path))
    expected = "3 shares at most" if shard == "5/5" else "I/N with I from 1 to N"
    assert (done.exit_code, done.output) == (2, f"--shard: expected {expected}, got {shard}\n")


def test_a_report_that_cannot_be_is_reported_before_anything_is_driven(tmp_path: Path) -> None:
    out, file = tmp_path / "out", tmp_path / "file"
    file.touch()
    for report, text in (
        ("campaign.pdf", "--report: expected a file with .html, got campaign.pdf\n"),
        (str(file / "campaign.html"), f"{file}: File exists\n"),
    ):
        done = campaign(PLAIN, "-n", "1", "--out", str(out), "--report", report)
        assert (done.exit_code, done.output) == (2, text)
        assert not out.exists()


def test_an_out_that_is_a_file_is_reported(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    done = campaign(PLAIN, "--out", str(tmp_path / "out"))
    assert (done.exit_code, done.output) == (2, f"{tmp_path / 'out'}: File exists\n")


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = Processes.run

    def interrupted(self: Processes, work: Any, jobs: Any) -> Iterator[Any]:
        for count, result in enumerate(run(self, work, jobs)):
            yield result
            if count == 1:
                raise KeyboardInterrupt

    arguments = (PLAIN, "-n", "60", "--processes", "1", "--out", str(tmp_path))
    with monkeypatch.context() as patch:
        patch.setattr(Processes, "run", interrupted)
        done = campaign(*arguments)
    assert done.exit_code == 130
    assert "interrupted; what is done is kept, --resume goes on" in done.output
    assert "forwarder.yaml: 32 drives" in done.output
    assert [row["seed"] for row in rows(tmp_path)] == [*range(32)]
    assert campaign(*arguments, "--resume").exit_code == 0
    assert [row["seed"] for row in rows(tmp_path)] == [*range(60)]


@pytest.mark.slow
def test_the_worst_drive_can_be_looked_at(tmp_path: Path) -> None:
    campaign(PLAIN, "-n", "3", "--processes", "1", "--out", str(tmp_path / "drives"))
    row = rows(tmp_path / "drives")[2]
    done = invoke("demo", PLAIN, "--seed", "2", "--out", tmp_path)
    assert done.exit_code == 0, done.output
    shaped = json.loads((tmp_path / "report.json").read_text())["crane"]["shaped"]
    assert shaped["residual_deg"] == pytest.approx(row["residual_deg"], abs=0.02)
    assert shaped["peak_deg"] == pytest.approx(row["peak_deg"], abs=0.02)


@pytest.mark.slow
def test_a_drive_of_the_second_file_is_looked_at_with_ranges_and_tails_of_the_first(
    tmp_path: Path,
) -> None:
    more, longer = "\nuncertainty: { length_pct: [10, 15] }\n", ("tail_s: 2.0", "tail_s: 6.0")
    first, second = str(machine_file(tmp_path, "forwarder", longer, more=more)), PLAIN
    drives = ("-n", "2", "--processes", "1", "--out", str(tmp_path / "drives"))
    assert campaign(first, "--against", second, *drives).exit_code == 0
    row = rows(tmp_path / "drives" / "b-forwarder")[1]
    peaks = []
    for more in ([], ["--ranges", first]):
        looked = ["demo", second, "--seed", "1", "--out", str(tmp_path), *more]
        assert invoke(*looked).exit_code == 0
        peaks.append(json.loads((tmp_path / "report.json").read_text())["crane"]["shaped"])
    assert peaks[1]["peak_deg"] == pytest.approx(row["peak_deg"], abs=0.02)
    assert peaks[1]["residual_deg"] == pytest.approx(row["residual_deg"], abs=0.02)
    assert peaks[0]["peak_deg"] != pytest.approx(row["peak_deg"], abs=0.02)


@pytest.mark.slow
def test_files_with_other_axes_are_not_compared(tmp_path: Path) -> None:
    joints = str(CONFIG / "forwarder-joints.yaml")
    line = (
        f"{joints}: expected the axes of forwarder.yaml, slew, near_far, lift,"
        " got slew, lift_cylinder, knuckle, extension\n"
    )
    refused = campaign(PLAIN, "--against", joints, "--out", str(tmp_path))
    assert (refused.exit_code, refused.output) == (2, line)
    looked = invoke("demo", joints, "--seed", "1", "--ranges", PLAIN)
    assert (looked.exit_code, looked.output) == (2, line)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("more", [["--ranges", PLAIN], ["--seed", "1", "--crane", "left"]])
def test_options_that_say_nothing_of_a_drive_are_refused(more: list[str]) -> None:
    refused = invoke("demo", PLAIN, *more)
    expected = "--seed: expected with --ranges, and without --crane or --rest\n"
    assert (refused.exit_code, refused.output) == (2, expected)
