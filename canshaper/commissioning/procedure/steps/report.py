"""The report of the day, to sign."""

from datetime import datetime
from pathlib import Path

from canshaper.commissioning.assumed import MEASURE, origins
from canshaper.commissioning.procedure.files import shown
from canshaper.commissioning.procedure.rehearsed import WRONG, Row, kept, table
from canshaper.commissioning.procedure.state import (
    FILE,
    Context,
    Outcome,
    Record,
    State,
    Status,
    Step,
)
from canshaper.commissioning.procedure.steps.drive import DRIVE
from canshaper.machine.deployment import Deployment
from canshaper.report import html
from canshaper.report.console import new_table
from canshaper.report.style import embedded

NAME = "report"
# What no program sees: tried by a person at the machine, and what should happen.
HAND_TESTS = (
    ("emergency stop pressed in motion", "every valve neutral at once"),
    ("enable let go in motion", "neutral at once, TRIPPED"),
    ("joystick's plug pulled in motion", "a shaped stop within timeout_ms and stop_s"),
    ("daemon killed in motion", "the valves stop by their own timeout"),
    ("full deflection and let go, empty", "the grapple hangs still"),
    ("the same with a load", "the grapple hangs still"),
)


def run(context: Context) -> Outcome:
    """Write everything that was done into one file."""
    path = context.folder / "report.html"
    steps = {name: one for name, one in context.state.steps.items() if name != NAME}
    path.write_text(document(context.deployment, context.state, steps, context.folder), "utf-8")
    outcome = Outcome(files=[path])
    undone = [name for name, one in steps.items() if one.status is not Status.DONE]
    if undone:
        outcome.sheet.print(f"NOTE: not done: {', '.join(undone)}; the report says so")
    assumed = context.deployment.config.assumed
    if assumed:
        text = f"NOT FIT TO SIGN: a guess decides about movement: {', '.join(assumed)}; {MEASURE}"
        outcome.sheet.print(text)
    faults = kept(context.folder)
    wrong = [row["fault"] for row in faults if row["verdict"] == WRONG]
    none = f"No fault was rehearsed: canshaper fault {context.deployment.path.name}"
    outcome.sheet.print(table(faults) if faults else none)
    fit = "" if assumed or undone or wrong else ", fit to sign"
    outcome.sheet.print(f"Report: {path}, to print{fit}")
    return outcome


def document(deployment: Deployment, state: State, steps: dict[str, Record], folder: Path) -> str:
    """The whole report.

    Args:
        deployment: as it is now.
        state: of the procedure.
        steps: those that it is about, in order.
        folder: of their pictures.
    """
    title = f"Commissioning of {deployment.path.name}"
    crane = []
    if state.simulated:
        title += ": REHEARSAL, nothing in it is of a machine"
        crane.append(("simulated crane", " ".join(state.changes) or "the nominal one"))
    facts = [*crane, *html.facts(deployment, datetime.now().astimezone())]
    summary = new_table("step", "is", "at", "canshaper", title="Steps")
    for name, one in steps.items():
        done = one.status is Status.DONE
        summary.add_row(name, _standing(one) if done else one.status.value, one.at, one.version)
    if assumed := deployment.config.assumed:
        facts.append(("assumed, not measured", ", ".join(assumed)))
    by_hand = new_table("by hand", "expected", "seen", "by", title="Hand tests, to fill in")
    for test, expected in HAND_TESTS:
        by_hand.add_row(test, expected, "", "")
    numbers = new_table("number", "is", "by", title="Origins")
    for row in origins(deployment.config):
        numbers.add_row(*row)
    faults = kept(folder)
    tables = [by_hand, *([table(faults)] if faults else []), summary, numbers]
    parts = [html.table(one) for one in tables]
    for name, one in steps.items():
        parts += _step(name, one, folder)
    drive = steps.get(DRIVE.name)
    first = [
        html.verdict(_verdict(deployment, steps, faults)),
        *(_pictures(drive, folder) if drive else []),
    ]
    return html.document(title, facts, parts, first)


def _verdict(deployment: Deployment, steps: dict[str, Record], faults: list[Row]) -> str:
    """The result of the day in one sentence: the swing that is left, and what is missing."""
    drive = steps.get(DRIVE.name)
    done = drive if drive and drive.status is Status.DONE else None
    if done and (crane := done.numbers.get("crane")):
        before, after = (crane[f"residual_{when}_deg"] for when in ("before", "after"))
        swing = f"{crane['residual_left_pct']:g} % of the swing is left"
        swing += f": {before} degrees without the filters, {after} with them"
    else:
        swing = f"the swing that is left was not measured{f': {done.why}' if done else ''}"
    missing = []
    if assumed := deployment.config.assumed:
        missing.append(f"{len(assumed)} values are assumed, not measured")
    if undone := [name for name, one in steps.items() if one.status is not Status.DONE]:
        missing.append(f"not done: {', '.join(undone)}")
    if wrong := [row["fault"] for row in faults if row["verdict"] == WRONG]:
        missing.append(f"{WRONG}: {', '.join(wrong)}")
    if missing:
        return f"NOT FIT TO SIGN: {'; '.join(missing)}; {swing}."
    return f"Fit to sign after the hand tests: {swing}."


def _standing(one: Record) -> str:
    """Status of a step, and what is said of it."""
    return f"{one.status.value}, {one.why}" if one.why else one.status.value


def _step(name: str, one: Record, folder: Path) -> list[str]:
    """A step: what it has shown, its pictures, and what it has changed."""
    parts = [html.heading(f"{name}: {_standing(one)}")]
    for part in one.parts:
        again = shown(part)
        parts.append(html.text(again) if isinstance(again, str) else html.table(again))
    parts += [html.text(f"NOT ENOUGH DATA: {fault}") for fault in one.problems]
    if name != DRIVE.name:  # that one is on the first page
        parts += _pictures(one, folder)
    if one.diff:
        parts += [html.text("Written:"), html.listing(one.diff)]
    return parts


def _pictures(one: Record, folder: Path) -> list[str]:
    """Pictures of a step: drawings, and dots of what has no drawing."""
    paths = [folder / picture for picture in one.pictures]
    drawings = {path.stem for path in paths if path.suffix == ".svg"}
    return [embedded(one) for one in paths if one.suffix == ".svg" or one.stem not in drawings]


REPORT = Step(
    NAME,
    "Report, to sign",
    "everything into one HTML file, with hashes, version, date and a place to sign",
    run,
    needs=(FILE,),
)
