"""Measured tables of the pages: what stands in them, what moved, what is written."""

import subprocess
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.docs.pages import ROOT
from tools import marks

MARK = "make bench"
HEADS = ["| figure | measured | peer | ratio | required |", "|---|---|---|---|---|"]


@pytest.fixture(name="figures")
def of_benchmarks(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    module = import_module("figures")
    monkeypatch.setattr(module, "TABLES", {**module.TABLES, MARK: {"tick": ()}})
    return module


def rows(us: float = 10.0) -> list[str]:
    return [one.line(us, 5.0) for one in import_module("tick").FIGURES]


def page(root: Path, lines: Sequence[str], command: str = MARK) -> Path:
    (root / "docs").mkdir()
    (root / "README.md").touch()
    text = f"a\n<!-- measured: {command} -->\n<!-- end: {command} -->\nb\n"
    (root / "docs/a.md").write_text(marks.with_sections(text, {command: lines}, "measured"))
    return root / "docs/a.md"


def test_the_tables_of_the_pages_are_as_the_benchmarks_write_them(figures: ModuleType) -> None:
    figures.TABLES[MARK] = figures.QUICK
    tables = figures.tables(ROOT)
    assert [fault for table in tables for fault in table.faults()] == []
    assert {table.command for table in tables} == {*figures.TABLES}


def test_every_command_and_benchmark_that_it_names_is_there(figures: ModuleType) -> None:
    targets = {line.partition(":")[0] for line in (ROOT / "Makefile").read_text().splitlines()}
    assert {one.removeprefix("make ") for one in figures.TABLES} <= targets
    programs = {path.stem for path in (ROOT / "benchmarks").glob("*.py")}
    assert {*figures.QUICK, *figures.SLOW, *figures.OTHERS} <= programs


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda lines: lines, None),
        (lambda lines: lines[:-1], "begins with Commit"),
        (lambda lines: [lines[0].replace("ratio", "times"), *lines[1:]], "columns figure"),
        (lambda lines: [*lines[:2], lines[2].replace("tick", "tack"), *lines[3:]], "the rows"),
        (lambda _: [], "columns figure"),
    ],
)
def test_a_table_that_no_benchmark_wrote_has_its_fault(
    figures: ModuleType, tmp_path: Path, change: object, fault: str | None
) -> None:
    lines = [*HEADS, *rows(), "", "Commit `1a2b3c4`; a PC."]
    page(tmp_path, change(lines))  # type: ignore[operator]
    (table,) = figures.tables(tmp_path)
    assert fault in "".join(table.faults()) if fault else table.faults() == []


def test_a_mark_names_a_command_that_exists(figures: ModuleType, tmp_path: Path) -> None:
    page(tmp_path, HEADS, "make tock")
    assert "make tock: expected a mark of make bench" in figures.tables(tmp_path)[0].faults()[0]


@pytest.mark.parametrize(
    ("then", "now", "by"),
    [
        ("100", "110", None),
        ("Notifier 100", "Notifier 89", "-11 %"),
        ("0", "0.1", "new"),
        ("at most 1.6: yes", "at most 1.6: no", "new"),
    ],
)
def test_a_figure_moved(figures: ModuleType, then: str, now: str, by: str | None) -> None:
    assert figures.change(then, now) == by


def test_a_requirement_is_judged_by_what_was_measured(figures: ModuleType) -> None:
    figure = import_module("measure").Figure
    assert figure("a", "b", most_ratio=0.5).line(121, 170).endswith("| ratio at most 0.5: no |")
    assert figure("a", "b", most=2).line(2, 0) == "| a | 2 | b 0 |  | at most 2: yes |"


def test_all_run_and_what_did_not_fail_is_shown_and_written(
    figures: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    file = page(tmp_path, [*HEADS, *rows(), "", "Commit `1a2b3c4`; a PC."])
    before = file.read_text()
    monkeypatch.setattr(figures, "ROOT", tmp_path)
    monkeypatch.setattr(figures, "stamped", lambda *_: "Commit `fffffff`")

    def measure(name: str) -> object:
        if name == "path":
            raise figures.BenchmarkError("exit 3")
        return figures.Measured(rows(20.0), "another PC")

    monkeypatch.setattr(figures, "measure", measure)
    assert figures.main(["path", "tick"]) == 1
    assert "FAILED: path: exit 3" in (text := capsys.readouterr().out)
    assert "+100 %" in text and "6 cells moved" in text
    assert file.read_text() == before
    assert figures.main(["tick", "--write"]) == 0
    assert file.read_text() == before.replace(" 10 ", " 20 ").replace(" 2.00 ", " 4.00 ").replace(
        "`1a2b3c4`; a PC", "`fffffff`; tick: another PC"
    )


def test_a_changed_tree_names_no_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    (tmp_path / "a").touch()
    monkeypatch.setattr(marks, "ROOT", tmp_path)
    with pytest.raises(SystemExit, match="commit these first"):
        marks.stamped("a")
