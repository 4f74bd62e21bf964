"""Numbers that are guesses: shown until someone has measured or typed them."""

from pathlib import Path

import pytest

from canshaper.commissioning.likely_mistakes import warnings_of
from canshaper.commissioning.origins import confirmed, origins, write_numbers
from canshaper.commissioning.procedure.bench import Simulated
from canshaper.commissioning.procedure.state import Context, Record, State, Status
from canshaper.commissioning.procedure.steps.check import check_file, write_report
from canshaper.edit.edit import change
from canshaper.machine.binding import load_deployment
from tests.controller.adjustable import CONTROL
from tests.rigs.files import Machine

PERIOD, TIMEOUT = "axes.slew.sway.period_s", "axes.slew.valve.timeout_ms"


@pytest.fixture
def guessed(machine: Machine) -> Machine:
    machine.yaml += f"{CONTROL}assumed:\n  - {PERIOD}\n  - {TIMEOUT}\n  - axes.lift.speed\n"
    return machine


def test_a_check_shows_them_by_axis_and_what_is_no_number(guessed: Machine) -> None:
    every = [str(one).partition("assumed")[2] for one in warnings_of(guessed.load())]
    warnings = [*filter(None, every)]
    assert warnings[0] == ".2: expected a key of this file with a number, got 'axes.lift.speed'"
    assert warnings[1].startswith(
        ".0: slew moves by sway.period_s 2.356, valve.timeout_ms 200: a guess; measure it"
    )


def test_what_is_written_is_assumed_no_more(guessed: Machine) -> None:
    path = guessed.load().path
    write_numbers(path, {PERIOD: 2.4})
    assert "assumed: [axes.slew.valve.timeout_ms, axes.lift.speed]" in path.read_text()
    change(path, confirmed(path, [TIMEOUT, "axes.lift.speed"]))
    assert "assumed" not in path.read_text()
    assert confirmed(path, [PERIOD]) == [], "nothing to take out, nothing is written"


def test_each_number_has_an_origin(guessed: Machine) -> None:
    made = "origin: { date: 2026-11-23, log: a.log, by: canshaper identify 1.0, source: machine }"
    guessed.in_yaml("full_speed_m_s: 1.0 }", f"full_speed_m_s: 1.0, {made} }}")
    rows = {key: text for key, _, text in origins(guessed.load().config)}
    assert rows[PERIOD] == rows[TIMEOUT] == "ASSUMED"
    measured = "machine: canshaper identify 1.0, 2026-11-23 from a.log"
    assert rows["axes.near_far.sway.length_m"] == measured
    assert rows["axes.near_far.sway.full_speed_m_s"] == "typed", "a log of a swing has none"
    assert rows["axes.slew.slewing.full_speed_rad_s"] == rows["axes.slew.filter.a1"] == "typed"
    assert rows["axes.slew.limits.max_pct"] == "default"


@pytest.mark.parametrize(("taken", "fit"), [((), False), ((PERIOD, TIMEOUT), True)])
def test_a_report_is_fit_to_sign_without_any(
    guessed: Machine, tmp_path: Path, taken: tuple[str, ...], fit: bool
) -> None:
    path = guessed.load().path
    change(path, confirmed(path, ("axes.lift.speed", *taken)))
    state = State(steps={"drive": Record(Status.DONE)})
    context = Context(load_deployment(path), Simulated(None, []), tmp_path, state)  # type: ignore[arg-type]
    said = " ".join(str(part["text"]) for part in write_report(context).sheet.parts)
    assert (", fit to sign" in said) is fit
    assert ("NOT FIT TO SIGN" in said) is not fit
    text = (tmp_path / "report.html").read_text()
    assert ("NOT FIT TO SIGN" in text) is not fit
    assert "<caption>Origins" in text
    skipped = State(steps={"drive": Record(Status.SKIPPED)})
    again = Context(context.deployment, context.bench, tmp_path, skipped)
    assert "fit to sign" not in str(write_report(again).sheet.parts)


@pytest.mark.slow
def test_to_go_on_after_the_check_is_to_allow_the_stop_distance(
    guessed: Machine, tmp_path: Path
) -> None:
    guessed.in_yaml(f"  - {PERIOD}\n", f"  - {PERIOD}\n  - axes.slew.limits.stop_distance_m\n")
    deployment = guessed.load()
    context = Context(deployment, Simulated(None, []), tmp_path, State())  # type: ignore[arg-type]
    outcome = check_file(context)
    assert "axes.slew.limits.stop_distance_m" in str(outcome.sheet.parts)
    assert outcome.edit
    outcome.edit(deployment)
    assert f"assumed: [{PERIOD}, {TIMEOUT}, axes.lift.speed]" in deployment.path.read_text()
