"""Faults rehearsed at the machine: what is expected, what happened, and the table to sign."""

import json
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canshaper.commissioning.control_client import rehearse
from canshaper.daemon.rehearsal.fault import MS, Fault
from canshaper.daemon.rehearsal.faults import rehearsed_faults
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.report.console import new_table
from canshaper.shaping.states import REACTION_OF, Reaction, Reason, State

if TYPE_CHECKING:
    from rich.table import Table

POLL_S = 0.1
RESULTS = "faults.json"
HEADS = ("fault", "row", "expected", "happened", "neutral after, ms", "verdict")
GOOD, WRONG, UNDONE = "as expected", "NOT as expected", "not done"
STOP, TRIP, NONE = "shaped stop", "trip", "no stop"
WORDS = {Reaction.SHAPED_STOP: STOP, Reaction.NEUTRAL: TRIP}
WORDS_OF = {State.STOPPING.name: STOP, State.TRIPPED.name: TRIP}
SAID = {"R1": STOP, "R2": TRIP, "BUS_OFF": TRIP}
"""Reactions to claims that stop an axis but have no reason of their own; see docs/safety.md."""

_INTERFACE = "it is seen at the interface: pull its cable, or `ip link set can0 down`"
_PROGRAM = "an error of the program, which no input makes"
_PROCESS = "end the daemon with `kill -9`, or stop it with SIGSTOP"
NEVER = {
    **dict.fromkeys(("NOT_CONFIRMED", "BUS_DOWN", "BUS_GONE", "BUS_WRONG_DEVICE"), _INTERFACE),
    **dict.fromkeys(("OUTPUT_REFUSED", "DECODERS_DISAGREE", "OUTPUT_INVALID"), _PROGRAM),
    **dict.fromkeys(("R3", "R4", "R6"), _PROCESS),
    "R5": "start the daemon without its bus",
    "JOYSTICK_NOT_NEUTRAL": "no fault: hold the joystick after a shaped stop, nothing moves",
    "R11": "remove the rules with `cangw -F`",
    "R12": "flooding frames never reach the daemon: `cangen can0 -g 0`",
    "R13": "no fault of an input: `canshaper set` with a number out of range",
    "R14": "no fault of an input: SIGHUP with a broken file",
    "R15": "fill the disk",
    "LENGTH_LOST": "unplug the sensor of the rope's length",
}
"""Claims that no input can cause: why they are not rehearsed, or how else they are tried."""

Row = dict[str, str]
"""A fault that was rehearsed, by ``HEADS``."""


def reaction_of(claim: str) -> str:
    """Return the reaction to a claim: that of its reason, where it has one."""
    reason = Reason.__members__.get(claim)
    return SAID.get(claim) or WORDS.get(REACTION_OF[reason] if reason else Reaction.NONE, NONE)


def expected(fault: Fault) -> str:
    """Return the reaction to a fault by the page on safety, and within which time."""
    if (reaction := reaction_of(fault.claim)) == NONE:
        return NONE
    within = f"{reaction} within {fault.within_ns / MS:g} ms"
    return within if fault.axes else "no axis is ready"  # at rest nothing stops


def judged(fault: Fault, report: Mapping[str, Any], deployment: Deployment) -> Row:
    """Return the row of a fault, judged by what the daemon reports of it (``Rehearsal``)."""
    claim, reaction, within_ms = fault.claim, reaction_of(fault.claim), fault.within_ns / MS
    events, neutral_ms = report["events"], report["neutral_ms"]
    stops = [event for event in events if event[2] in WORDS_OF]
    said: dict[str, str] = {}  # the first of each, and when
    for ms, _, state, reason in stops:
        of = "" if reason == claim else f" {reason}"
        said.setdefault(f"{WORDS_OF[state]}{of}", f" after {ms:.0f} ms")
    texts = [word + when for word, when in said.items()] or [e[3] for e in events if not e[2]]
    happened, verdict = ", ".join(dict.fromkeys(texts)) or NONE, WRONG
    if reaction == NONE or not fault.axes:
        verdict = WRONG if stops else GOOD
    elif stops and neutral_ms is not None:
        stop_s = max(axis.config.limits.stop_s for axis in deployment.axes.values())
        most_ms = within_ms + (1000 * stop_s + 100 if reaction == STOP else 0)
        begun_ms, _, state, reason = stops[0]
        right = WORDS_OF[state] == reaction and claim in (reason, *SAID)
        verdict = GOOD if right and begun_ms <= within_ms and neutral_ms <= most_ms else WRONG
    if not report["made"] or (verdict == WRONG and report["why"] != "its time is over"):
        verdict, happened = UNDONE, report["why"] or "the daemon has begun again"
    after = f"{neutral_ms:.0f}" if stops and neutral_ms is not None else ""
    row = (fault.name, claim, expected(fault), happened, after, verdict)
    return dict(zip(HEADS, row, strict=True))


def refused(deployment: Deployment) -> dict[str, str]:
    """Return the claims that no input can cause, here or at any machine, with the reasons."""
    made = {one.claim for one in rehearsed_faults(deployment).values()}
    stops = [one.name for one in Reason if REACTION_OF[one] is not Reaction.NONE]
    here = [one for one in stops if one not in made]
    return dict.fromkeys(here, "no part of this machine can have it") | NEVER


def chosen(deployment: Deployment, names: Iterable[str]) -> list[Fault]:
    """Return the faults with these names, kinds or claims; all of them without any.

    Raises:
        UsageError: there is none, or it cannot be rehearsed.
    """
    faults = rehearsed_faults(deployment)
    found: dict[str, Fault] = {} if names else faults
    for name in names:
        some = {k: v for k, v in faults.items() if name in (k, k.partition(":")[0], v.claim)}
        if not some and (why := refused(deployment).get(name)):
            raise UsageError(f"{name} cannot be rehearsed: {why}")
        if not some:
            raise UsageError(f"--only: expected a name of --list, got {name!r}")
        found |= some
    return list(found.values())


def made(control: Path, fault: Fault, deployment: Deployment) -> Row:
    """Let the daemon make a fault, wait until it is over, and judge it; it ends in any case.

    Raises:
        ControlError: the daemon refuses, or is gone.
    """
    report = rehearse(control, fault.name)
    try:
        while report["phase"] != "done":
            time.sleep(POLL_S)
            report = rehearse(control, "report")
    except BaseException:
        rehearse(control, "end")
        raise
    return judged(fault, report, deployment)


def table(rows: Iterable[Row]) -> "Table":
    """Return the rehearsed faults as a table; without the column of claims it fits on A4."""
    heads = [one for one in HEADS if one != "row"]
    shown = new_table(*heads, title="Rehearsed faults")
    for row in rows:
        shown.add_row(*(row[one] for one in heads))
    return shown


def kept(folder: Path) -> list[Row]:
    """Return the rows that were kept for the report; none before the first."""
    path = folder / RESULTS
    rows: list[Row] = json.loads(path.read_text("utf-8")) if path.exists() else []
    return rows


def keep(folder: Path, row: Row) -> Path:
    """Keep a row in place of the one of the same fault; return where."""
    folder.mkdir(exist_ok=True)
    rows = [one for one in kept(folder) if one["fault"] != row["fault"]]
    (folder / RESULTS).write_text(json.dumps([*rows, row], indent=2), "utf-8")
    return folder / RESULTS
