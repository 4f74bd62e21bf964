"""The step of the filter: the robust one and the paper's side by side, and what a person chose."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from canshaper.commissioning.procedure.state import Outcome, State
from canshaper.commissioning.procedure.steps.filter import FILTER
from canshaper.machine.binding import load_deployment
from tests.commissioning.procedure.rehearsal import COPY, FOLDER, commission, steps


def kinds() -> set[str]:
    axes = load_deployment(COPY).config.axes
    return {axes[name].filter.kind for name in ("slew", "near_far")}


class Person:
    """One who takes what is recommended, or says a word."""

    def __init__(self, word: str = "") -> None:
        self.word, self.asked = word, ""

    def answer(self, question: str, default: str, allowed: Any = ()) -> str:
        self.asked = question
        return self.word or default


def outcome(path: Path, person: Person | None = None) -> Outcome:
    bench = SimpleNamespace(person=person or Person())
    context = SimpleNamespace(deployment=load_deployment(path), bench=bench, state=State())
    return FILTER.run(context)  # type: ignore[arg-type]


def slow_valve(machine: Path) -> None:
    text = re.sub(r"rise_per_s: [\d.]+", "rise_per_s: 0.6", machine.read_text())
    machine.write_text(re.sub(r"fall_per_s: [\d.]+", "fall_per_s: 1", text))


@pytest.mark.slow
def test_what_a_person_chose_is_written_and_kept(machine: Path) -> None:
    shown = commission("--step", "filter", answers="gff\n\n")
    question, *figures = re.findall(r"^(?:filter: which|  \w+, (?:robust|gff):).*$", shown, re.M)
    assert question == "filter: which one, robust or gff; recommended is robust"
    assert len(figures) == 4
    assert all("run-on" in line and line.endswith("; good") for line in figures)
    assert kinds() == {"gff"}
    kept = steps()["filter"]["numbers"]
    assert (kept["chosen"], kept["recommended"]) == ("gff", "robust")
    assert kept["offered"] == ["robust", "gff"]
    for name in ("slew", "near_far"):
        robust, gff = kept[name]["robust"], kept[name]["gff"]
        assert robust["dip_pct"] < 1.0 < gff["dip_pct"]
        assert robust["peak_deg"] < 0.5 * robust["raw_peak_deg"]
        assert gff["raw_peak_deg"] == robust["raw_peak_deg"]
    again = commission("--step", "filter", "--yes")  # what was chosen before is the default
    assert "Recommended: robust. Chosen: gff" in again
    commission("--step", "report", "--yes")
    report = (FOLDER / "report.html").read_text("utf-8")
    assert "Recommended: robust. Chosen: gff" in report
    assert "gff, of the paper" in report


@pytest.mark.slow
def test_the_recommended_one_is_that_which_damps_this_machine(machine: Path) -> None:
    """A slow valve, which the default response of the robust one asks too much of."""
    slow_valve(machine)
    one = outcome(machine)
    assert (one.numbers["recommended"], one.numbers["chosen"]) == ("gff", "gff")
    assert one.numbers["slew"]["robust"]["verdict"] != "good"
    assert one.numbers["slew"]["gff"]["verdict"] == "good"
    assert one.problems == []


@pytest.mark.slow
def test_a_filter_that_does_not_damp_stays_open_whoever_chose_it(machine: Path) -> None:
    slow_valve(machine)
    machine.write_text(machine.read_text().replace("max_pct: 40", "max_pct: 100"))
    one = outcome(machine, Person("robust"))
    assert [fault.partition(":")[0] for fault in one.problems] == ["slew", "near_far"]
    assert "useless" in one.problems[0]
    assert "--duration" in one.problems[0]


def test_a_tool_that_comes_to_rest_by_itself_gets_none(machine: Path) -> None:
    text = machine.read_text()
    machine.write_text(re.sub(r"decay_per_swing: [\d.]+", "damping_ratio: 0.9", text))
    person = Person()
    one = outcome(machine, person)
    assert one.problems == ["no filter suits every axis; see above"]
    assert one.edit is None
    assert person.asked == ""
    said = "\n".join(part["text"] for part in one.sheet.parts)
    assert "slew: no filter robust: axis slew: damping ratio: expected 0 to 0.3, got 0.9" in said
    assert "slew: no filter gff: damping ratio: expected 0 to 0.3, got 0.9" in said
