"""Steps: is the file fit to start, and slow enough for the first motion; the report, to sign."""

from datetime import datetime
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from canshaper.commissioning.likely_mistakes import warnings_of
from canshaper.commissioning.origins import MEASURE, confirmed, origins
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
from canshaper.commissioning.procedure.steps.motion import MOTION
from canshaper.commissioning.stopping import Stopping, print_stopping, stopping
from canshaper.config.bus import REDUCED_PCT
from canshaper.config.source import Source
from canshaper.edit.edit import change, of_limits
from canshaper.machine.deployment import Deployment
from canshaper.machine.stop_distance import rehearsed_valves, unstated
from canshaper.report import html, style
from canshaper.report.console import axis_title, new_table
from canshaper.report.style import embedded

EVENTS = ("joystick released", "joystick reversed", "joystick lost", "enable lost", "limits allow")


def check_file(context: Context) -> Outcome:
    """Check the whole file; propose reduced speed before the first motion, and guesses to allow."""
    deployment = context.deployment
    outcome = Outcome()
    for name, bus in deployment.config.buses.items():
        if load := deployment.load(name):
            outcome.numbers[f"{name}_load_pct"] = round(100.0 * load.share, 1)
            outcome.sheet.print(
                f"bus {name}: {load.messages} messages load {load.share:.0%} of {bus.bitrate} bit/s"
            )
    print_stopping(deployment, outcome.sheet)
    outcome.sheet.print(*deployment.identity.lines())
    outcome.numbers["digest"] = f"{deployment.identity.digest:#06x}"
    for doubt in warnings_of(deployment):
        outcome.sheet.print(f"WARNING: {doubt}")
    source = Source(deployment.path)
    faults = [*unstated(deployment)]
    faults += [] if context.bench.simulated else rehearsed_valves(deployment.config)
    outcome.problems += [str(source.problem(place, text)) for place, text in faults]
    axes = stopping(deployment)
    outcome.figures[""] = lambda: stopping_figure(axes)
    limits = {name: axis.limits for name, axis in deployment.config.axes.items()}
    first = MOTION not in context.numbers
    fast = [name for name, one in limits.items() if first and one.max_pct > REDUCED_PCT]
    if fast:
        outcome.sheet.print(f"The first motion is at reduced speed: {', '.join(fast)}")
    allowed = []
    for name, one in limits.items():
        key = f"axes.{name}.limits.stop_distance_m"
        if key in deployment.config.assumed:
            allowed.append(key)
            outcome.sheet.print(
                f"{key}: {one.stop_distance_m:g} m is a guess: to write this step is to allow the"
                f" tip of {name} to travel so far when it stops; type less where there is less room"
            )
    if fast or allowed:
        outcome.edit = partial(_write, fast=fast, allowed=allowed)
    return outcome


def _write(deployment: Deployment, fast: list[str], allowed: list[str]) -> None:
    sections, slow = deployment.config.axes, {"max_pct": REDUCED_PCT}
    slower = [of_limits(name, sections[name], slow) for name in fast]
    change(deployment.path, [*slower, *confirmed(deployment.path, allowed)])


def stopping_figure(axes: list[Stopping]) -> Figure:
    """Draw how far each axis travels after each event, and how far its limits allow."""
    height = 170 + 330 * len(axes)
    fig = style.print_figure(height)
    for number, axis in enumerate(axes):
        bottom = (height - 110 - 330 * (number + 1) + 75) / height
        panel = fig.add_axes((0.2, bottom, 0.76, 215 / height))
        style.plain(panel, size=style.TEXT_PT)
        unit, scale = ("s of full speed", 1.0) if axis.speed.m_s is None else ("m", axis.speed.m_s)
        style.titled(panel, f"{axis_title(axis.name)}, {unit}", style.TITLE_PT)
        ways = axis.travel
        events = (ways.release, ways.reversal, ways.lost, ways.enable, axis.allowed_s)
        colours = [style.SHAPED_COLOUR] * (len(events) - 1) + [style.RAW_COLOUR]
        panel.barh(EVENTS, [scale * way_s for way_s in events], color=colours, height=0.6)
        panel.invert_yaxis()
        if axis.stated_m is not None and axis.speed.m_s is not None:
            panel.axvline(axis.stated_m, color=style.TEXT_COLOUR, linewidth=1.2)
    style.headline(fig, "Travel from full speed; the line is stop_distance_m")
    return fig


CHECK = Step(
    "check",
    "Check",
    "as `canshaper check`: stopping distances, bus load, what does not fit, oil not yet measured",
    check_file,
    writes="`max_pct: 40`, for the first motion; `stop_distance_m` as allowed by you",
    needs=(FILE,),
)


NAME = "report"
# Tests by a person at the machine, which no program sees, and what should happen.
HAND_TESTS = (
    ("emergency stop pressed in motion", "every valve neutral at once"),
    ("enable let go in motion", "neutral at once, TRIPPED"),
    ("joystick's plug pulled in motion", "a shaped stop within timeout_ms and stop_s"),
    ("daemon killed in motion", "the valves stop by their own timeout"),
    ("full deflection and let go, empty", "the grapple hangs still"),
    ("the same with a load", "the grapple hangs still"),
)


def write_report(context: Context) -> Outcome:
    """Write what all steps have shown into report.html; print what keeps it from being signed."""
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
    """Return the whole report as HTML.

    Args:
        deployment: as it is now.
        state: of the procedure.
        steps: the steps that it reports, in order.
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
    """Return the result of the day in a sentence: the swing that is left, what is missing."""
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
    """Return the status of a step, and why."""
    return f"{one.status.value}, {one.why}" if one.why else one.status.value


def _step(name: str, one: Record, folder: Path) -> list[str]:
    """Return the HTML of a step: what it has shown, its pictures, and its change of the file."""
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
    """Return the pictures of a step as HTML: drawings, and bitmaps of what has no drawing."""
    paths = [folder / picture for picture in one.pictures]
    drawings = {path.stem for path in paths if path.suffix == ".svg"}
    return [embedded(one) for one in paths if one.suffix == ".svg" or one.stem not in drawings]


REPORT = Step(
    NAME,
    "Report, to sign",
    "everything into one HTML file, with hashes, version, date and a place to sign",
    write_report,
    needs=(FILE,),
)
