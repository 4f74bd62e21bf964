"""One HTML file of what a verb shows, and the pictures."""

import json
import re
import shutil
import sys
from base64 import b64decode
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from rich.table import Table
from rich.text import Text
from typer import Exit
from typer.testing import CliRunner

from canshaper import __version__
from canshaper.cli.app import app
from canshaper.cli.results import Results
from canshaper.commissioning.calibration.fit import Calibration, Direction
from canshaper.commissioning.doctor.measure import Run
from canshaper.commissioning.plots import in_file, of_runs, of_valve
from canshaper.config.limits import Limits
from canshaper.errors import UsageError
from canshaper.machine.binding import load_deployment
from canshaper.report import html
from canshaper.report.style import new_figure
from tests.rigs.files import ROOT

FORWARDER = ROOT / "config" / "forwarder.yaml"
MOST_BYTES = 2_000_000


def read(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    assert path.stat().st_size < MOST_BYTES
    assert not re.search(r"""(src|href)=["'](?!data:)""", text), "it loads something"
    assert "<script" not in text
    return text


def drawn() -> Figure:
    return new_figure(200, 100)


def test_a_report_says_of_what_it_is_and_has_a_place_to_sign(tmp_path: Path) -> None:
    deployment = load_deployment(FORWARDER)
    path = tmp_path / "new" / "report.html"
    results = Results("A title", deployment, path, quiet=True)
    results.print("a < b \x1b[31m")
    assert results.picture(tmp_path / "p.png", drawn) == tmp_path / "p.png"
    results.write()
    text = read(path)
    assert "<h1>A title</h1>" in text
    assert "a &lt; b \\x1b[31m" in text
    for line in deployment.identity.lines():
        assert line in text
    assert f"<td>{__version__}</td>" in text
    assert re.search(r"<th>date</th><td>\d{4}-\d\d-\d\d \d\d:\d\d", text)
    assert "<th>machine</th>" in text
    assert "<th>signature</th>" in text
    picture = re.search(r"data:image/svg\+xml;base64,([^\"]+)", text)
    assert picture and b"<svg" in b64decode(picture[1])


def test_nothing_is_written_where_nothing_is_asked_for(tmp_path: Path) -> None:
    results = Results("A title", None, None, quiet=True)
    assert results.picture(None, drawn) is None
    results.write()
    assert list(tmp_path.iterdir()) == []


def test_a_verb_ends_with_results_picture_what_follows_and_its_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    picture = tmp_path / "p.png"
    results = Results("A title", None, tmp_path / "r.html", picture, soft_wrap=True)
    with pytest.raises(Exit) as ended:
        results.conclude(
            lambda to: to.print("found"), figure=drawn, finish=lambda: ["Written"], code=1
        )
    report = f"Report: {tmp_path / 'r.html'}"
    said = capsys.readouterr().out.splitlines()
    assert (said, ended.value.exit_code) == (["found", f"Picture: {picture}", "Written", report], 1)
    monkeypatch.setitem(sys.modules, "canshaper.report.style", None)  # without matplotlib
    Results("A title", None, None, picture, quiet=True).conclude(
        lambda to: to.print("found"), figure=drawn, data=lambda path: {"picture": path}
    )
    assert json.loads(capsys.readouterr().out) == {"picture": None}


@pytest.mark.parametrize(
    ("suffix", "begins"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")]
)
def test_the_suffix_of_a_picture_is_its_format(tmp_path: Path, suffix: str, begins: bytes) -> None:
    path = tmp_path / f"picture.{suffix}"
    results = Results("A title", None, None, path, quiet=True)
    assert results.picture(tmp_path / "other.png", drawn) == path
    assert path.read_bytes().startswith(begins)


@pytest.mark.parametrize(("report", "picture"), [("report.pdf", None), (None, "picture.jpg")])
def test_another_suffix_is_refused_before_anything_runs(
    report: str | None, picture: str | None
) -> None:
    paths = [Path(one) if one else None for one in (report, picture)]
    with pytest.raises(UsageError, match=r"expected a file with \.(html|png)"):
        Results("A title", None, *paths)


def test_a_stamp_names_deployment_version_and_date() -> None:
    fig = drawn()
    Results("A title", load_deployment(FORWARDER), Path("r.html"), quiet=True).picture(
        None, lambda: fig
    )
    assert re.fullmatch(
        rf"forwarder\.yaml, canshaper {re.escape(__version__)}, \d{{4}}-\d\d-\d\d",
        fig.texts[-1].get_text(),
    )


def test_a_table_of_the_terminal_becomes_one_of_the_page() -> None:
    table = Table(title="what")
    table.add_column("name")
    table.add_column("°", justify="right")
    table.add_column("bar")
    table.add_row("<slew>", Text("1.5", style="bold"), "██")
    text = html.table(table)
    assert "<caption>what</caption>" in text
    assert '<td>&lt;slew&gt;</td><td class="right">1.5</td><td>██</td>' in text


@pytest.mark.slow
def test_report_of_a_demo(tmp_path: Path) -> None:
    report, picture = tmp_path / "report.html", tmp_path / "demo.svg"
    words = ["demo", "--lockstep", "--out", str(tmp_path), "--report", str(report)]
    done = CliRunner().invoke(app, [*words, "--picture", str(picture)])
    assert done.exit_code == 0, done.output
    text = read(report)
    assert "residual sway, deg" in text
    assert "run-on, m" in text
    assert "forwarder-robust.yaml" in text
    assert text.count("<img") == 1
    assert picture.read_text(encoding="utf-8").startswith("<?xml")


@pytest.mark.slow
def test_robust_as_json_and_as_a_report(tmp_path: Path) -> None:
    words = ["robust", str(FORWARDER), "--axis", "near_far"]
    done = CliRunner().invoke(app, [*words, "--json", "--report", str(tmp_path / "r.html")])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert result["axis"] == "near_far"
    assert result["filter"]["kind"] == "robust"
    assert result["written"] is None
    assert [r["length_pct"] for r in result["measures"]["residuals"]][:2] == [-30, -20]
    text = read(tmp_path / "r.html")
    assert "through the machine" in text
    assert text.count("<img") == 1
    assert "filter: { kind: robust" in text


def test_robust_as_json_writes_the_same_as_without(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "dbc", tmp_path / "dbc")
    files = []
    for options in ([], ["--json"]):
        directory = tmp_path / f"config{len(options)}"
        directory.mkdir()
        file = Path(shutil.copy(FORWARDER, directory))
        words = ["robust", str(file), "--axis", "slew", "--write", *options]
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output
        files.append(file.read_text())
    assert files[0] == files[1] != FORWARDER.read_text()
    assert json.loads(done.stdout)["written"] == str(file)


def test_the_curve_of_the_file_is_the_one_that_the_controller_uses() -> None:
    limits = Limits(deadband_pct=10.0).output_limits()
    assert in_file(limits, [-100.0, -10.0, 0.0, 5.0, 55.0, 100.0]) == pytest.approx(
        [-100.0, 0.0, 0.0, 0.0, 50.0, 100.0]
    )


def test_picture_of_a_calibration_has_both_curves_and_where_the_valve_opens() -> None:
    one = Direction(0.08, ((0.2, 0.1), (0.4, 0.3)), 0.01, 1.0)
    limits, measured = Limits().output_limits(), Calibration(one, one)
    panel = of_valve("slew", limits, measured, 40.0).axes[0]
    known = {"file", "measured", "driven"}
    assert known | {"not measured"} == set(panel.get_legend_handles_labels()[1])
    assert "opens at 8.0 %" in [text.get_text() for text in panel.texts]
    whole = of_valve("slew", limits, measured, 100.0).axes[0]
    assert known == set(whole.get_legend_handles_labels()[1])


def test_picture_of_a_doctor_has_the_limit_in_its_place() -> None:
    """Between the bins that end before the tick and those after it."""
    late = [30_000] * 90 + [40_000_000] * 10
    run = Run(late, [], [], [], 10, [], [], {}, None, None)
    panel = of_runs({"idle": run}, 20).axes[0]
    bins = [label.get_text() for label in panel.get_xticklabels()]
    limit = panel.lines[0].get_xdata()[0]
    assert bins.index("20 ms") < limit < bins.index("50 ms")
    shares = {bins[round(bar.get_x() + 0.4)]: bar.get_height() for bar in panel.patches}
    assert shares["50 µs"] == pytest.approx(90.0)
    assert shares["50 ms"] == pytest.approx(10.0)


def test_check_as_json() -> None:
    done = CliRunner().invoke(app, ["check", str(FORWARDER), "--json"])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    deployment = load_deployment(FORWARDER)
    assert result["good"] is True
    assert result["digest"] == f"{deployment.identity.digest:#06x}"
    assert list(result["axes"]) == list(deployment.axes)
    assert result["axes"]["slew"]["stop_distance_m"] == 4.7
    assert result["buses"]["crane"]["load"] == pytest.approx(0.117, abs=0.001)


def test_check_as_json_of_a_file_that_is_wrong(tmp_path: Path) -> None:
    text = FORWARDER.read_text().replace("tick_ms: 20", "tick_ms: 21x")
    (tmp_path / "wrong.yaml").write_text(text)
    done = CliRunner().invoke(app, ["check", str(tmp_path / "wrong.yaml"), "--json"])
    assert done.exit_code == 2
    result = json.loads(done.stdout)
    assert result["good"] is False
    assert [p for p in result["problems"] if "tick_ms" in p["where"] and p["line"]]


def test_sim_and_operator_say_what_they_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("canshaper_sim.realtime.run_plant", lambda *_: None)
    monkeypatch.setattr("canshaper_sim.realtime.run_operator", lambda *_, bypass: True)
    done = CliRunner().invoke(app, ["sim", str(FORWARDER)])
    where = "crane (socketcan vcan0)"
    assert f"the crane of slew, near_far, lift is on {where}; Ctrl-C ends it" in done.output
    done = CliRunner().invoke(app, ["operator", str(FORWARDER), "--script", "loading", "--bypass"])
    assert done.output.startswith("script loading, ")
    assert f"with anti-sway off on {where}" in done.output
