"""``canshaper compare --work``: operators work with every filter."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from canshaper.campaign import work_results
from canshaper.cli.verbs import compare
from canshaper.config.filters import filter_of
from canshaper.design.comparison.manoeuvres import AXES, Candidate
from canshaper.machine.deployment import Deployment
from tests.cli.invocation import invoke
from tests.design.comparison.candidates import FILE, ROBUST
from tests.design.comparison.test_tables import made


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, deployment: Deployment, tmp_path: Path) -> Any:
    """Runs it with three filters, without the drives, limits and picture of the comparison."""
    kinds = {"off": filter_of("off"), "ZV": filter_of("zv")}
    robust = {axis: deployment.axes[axis].config.filter for axis in AXES}
    filters = [Candidate(name, dict.fromkeys(AXES, kind)) for name, kind in kinds.items()]
    filters.append(Candidate(ROBUST, robust, ours=True))
    outcomes = [one for each in filters for one in made(each.name, 2.0, 1.0)]
    comparison = "canshaper.design.comparison"
    monkeypatch.setattr(f"{comparison}.manoeuvres.candidates", lambda _: filters)
    monkeypatch.setattr(f"{comparison}.measure.measure_all", lambda *_, **_options: outcomes)
    monkeypatch.setattr(f"{comparison}.summary.least", lambda _: [])
    monkeypatch.setattr("canshaper.cli.results.Results.picture", lambda *_: None)
    monkeypatch.setattr(work_results, "_SPEEDS", (1.0,))
    monkeypatch.setattr(work_results, "_CATCHES", (0.0,))

    def run(*options: str) -> tuple[Result, dict[str, Any]]:
        words = ["compare", str(FILE), "--out", str(tmp_path), "--work", *options]
        done = invoke(*words, columns=120)
        return done, json.loads((tmp_path / "compare.json").read_text(encoding="utf-8"))["work"]

    return run


@pytest.mark.slow
def test_each_filter_has_its_seconds_a_move(run: Any) -> None:
    done, work = run("--seeds", "1", "--processes", "1")
    assert done.exit_code == 0, done.output
    assert {name: [*by_filter] for name, by_filter in work.items()} == {
        name: ["off", "ZV", ROBUST] for name in ("loading", "tip only")
    }
    empty = {name: {one: s["empty"] for one, s in each.items()} for name, each in work.items()}
    assert empty["loading"][ROBUST] < 0.9 * empty["loading"]["off"]
    assert empty["tip only"]["off"] < empty["tip only"]["ZV"] < empty["tip only"][ROBUST]
    first = done.output.partition("left, deg")[0]
    assert "seconds a move" in first
    off = next(row.split() for row in first.splitlines() if row.startswith(" off "))
    assert off[1::3] == [f"{work[name]['off']['empty']:.1f}" for name in work]


def test_ctrl_c_leaves_what_is_done_until_then(
    run: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Interrupted:
        """An engine that Ctrl-C interrupts in the second working cycle."""

        def run(self, _work: Any, jobs: Iterable[Any]) -> Iterator[Any]:
            for one in jobs:
                if one.seed == "1":
                    raise KeyboardInterrupt
                yield one, [work_results.Move(load, True, 7.0) for load in work_results.LOADS]

    monkeypatch.setattr(compare, "engine", lambda *_: Interrupted())
    monkeypatch.setattr(work_results, "learn", lambda *_: ())
    report = tmp_path / "report.html"
    done, work = run("--seeds", "2", "--report", str(report))
    assert done.exit_code == 130
    assert "7.0 / 7.0" in report.read_text(encoding="utf-8")
    assert work == {"loading": {n: {"empty": 7.0, "log": 7.0} for n in ("off", "ZV", ROBUST)}}
    assert "interrupted at 30 cm, 6 deg: 1 of 2 working cycles are done" in done.output
    assert "7.0 / 7.0" in done.output
    assert "left, deg" in done.output
