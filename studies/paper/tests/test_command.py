"""``python -m studies.paper`` from the outside."""

import json
from pathlib import Path
from typing import NoReturn

import pytest
from typer.testing import CliRunner, Result

from studies.paper.__main__ import PAGE, app
from studies.paper.study import Study


def run(*options: str, columns: int = 80) -> Result:
    return CliRunner().invoke(app, list(options), env={"COLUMNS": str(columns)})


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    out = tmp_path_factory.mktemp("reproduce") / "new" / "paper"
    page = out.parents[1] / "README.md"
    page.write_text(PAGE.read_text("utf-8").replace("**95**", "95"), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("studies.paper.__main__.PAGE", page)
        return out, run("--out", str(out), "--write")


@pytest.mark.slow
def test_everything_is_written(done: tuple[Path, Result]) -> None:
    out, result = done
    assert result.exit_code == 0, result.output
    expected = {f"figure-{n}.{kind}" for n in (3, 4, 6, 7, 8) for kind in ("png", "json")}
    assert {path.name for path in out.iterdir()} == expected | {"paper.json"}
    assert (out.parents[1] / "README.md").read_text("utf-8") == PAGE.read_text("utf-8")
    for path in out.glob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG")


def no_constant(text: str) -> NoReturn:
    raise AssertionError(text)


@pytest.mark.slow
def test_json_is_strict_and_has_the_findings(done: tuple[Path, Result]) -> None:
    out, _ = done
    for path in out.glob("*.json"):
        data = json.loads(path.read_text(encoding="utf-8"), parse_constant=no_constant)
        assert path.name == "paper.json" or data["finding"]
    table = json.loads((out / "paper.json").read_text(encoding="utf-8"))
    assert table["reductions"][0]["ours_pct"]["linear"]["residual"] > 63.0
    assert table["reductions"][1]["ours_pct"]["linear"]["residual"] > 67.0


@pytest.mark.slow
def test_table_fits_80_columns_and_says_it_plainly(done: tuple[Path, Result]) -> None:
    _, result = done
    assert max(map(len, result.stdout.splitlines())) <= 80
    assert "…" not in result.stdout
    words = " ".join(result.stdout.split())
    for text in (
        "slew, perpendicular slew > 63 38 56 95+ 30 55 94+",
        "near-far, parallel near-far > 67 74+ 79+ 99+ 74+ 78+ 98+",
        "holds for residual only, on both valves",
        "-5.6307, -4.1253 -5.6550, -4.1124 yes",
        "0.42, 0.043 0.619, 0.0957 no",
        "the paper publishes no lengths, masses, damping",
    ):
        assert text in words


def test_one_figure_comes_without_the_table(tmp_path: Path) -> None:
    result = run("--out", str(tmp_path), "--figure", "6", "--figure", "6")
    assert result.exit_code == 0, result.output
    assert {path.name for path in tmp_path.iterdir()} == {"figure-6.png", "figure-6.json"}
    assert "7 % apart" in result.stdout
    assert "paper.json" not in result.stdout


def test_unknown_figure(tmp_path: Path) -> None:
    result = run("--out", str(tmp_path / "new"), "--figure", "3", "--figure", "5")
    assert result.exit_code == 2
    assert result.stderr == "--figure: expected one of 3, 4, 6, 7, 8, got 5\n"
    assert not (tmp_path / "new").exists()


def test_no_number(tmp_path: Path) -> None:
    assert run("--out", str(tmp_path), "--figure", "three").exit_code == 2


def test_directory_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = run("--out", str(tmp_path / "file" / "out"))
    assert result.exit_code == 2
    assert result.stderr.startswith("--out ")
    assert result.stderr.endswith("Not a directory\n")


def test_interruption_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_study: Study, _figure: int) -> NoReturn:
        raise KeyboardInterrupt

    monkeypatch.setattr(Study, "figure_numbers", interrupted)
    result = run("--out", str(tmp_path))
    assert result.exit_code == 130
    assert result.stderr == "interrupted\n"
    assert not list(tmp_path.iterdir())


def test_help_has_examples() -> None:
    result = run("--help")
    assert result.exit_code == 0
    assert "python -m studies.paper --figure 7 --figure 8" in result.stdout
