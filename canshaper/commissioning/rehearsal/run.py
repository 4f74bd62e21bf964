"""Rehearses faults at a running daemon, and keeps the table of what they did."""

import json
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canshaper.commissioning.control_client import Connection, person
from canshaper.commissioning.rehearsal.reactions import NEVER, ROWS
from canshaper.commissioning.rehearsal.verdict import Verdict, judged
from canshaper.daemon.rehearsal.fault import Fault
from canshaper.daemon.rehearsal.faults import rehearsed_faults
from canshaper.errors import ControlError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.report import html
from canshaper.report.console import new_table

if TYPE_CHECKING:
    from rich.table import Table

RESULTS = "faults.json"
ELSEWHERE = "no part of this machine can have it"
HEADS = ("row", "expected", "happened", "neutral after, ms", "verdict")


def refused(deployment: Deployment) -> dict[str, str]:
    """Rows of the table of reactions that cannot be rehearsed at a machine, with the reasons."""
    made = {one.claim for one in rehearsed_faults(deployment).values()}
    claims = [claim for row in ROWS for claim in row.ids.split(", ")]
    return {one: NEVER.get(one, ELSEWHERE) for one in claims if one not in made}


def chosen(deployment: Deployment, names: Iterable[str]) -> list[Fault]:
    """The faults with these names, kinds or rows; all without any.

    Raises:
        UsageError: there is none, or it cannot be rehearsed.
    """
    faults = rehearsed_faults(deployment)
    found: dict[str, Fault] = {} if names else faults
    for name in names:
        if why := refused(deployment).get(name):
            raise UsageError(f"{name} cannot be rehearsed: {why}")
        some = {k: v for k, v in faults.items() if name in (k, k.partition(":")[0], v.claim)}
        if not some:
            raise UsageError(f"--only: expected a name of --list, got {name!r}")
        found |= some
    return list(found.values())


def announced(fault: Fault, deployment: Deployment) -> str:
    """What a person has to do for a fault, after his yes."""
    if not fault.axes:
        return "let every joystick rest"
    several = " or ".join(fault.axes)
    return f"move the joystick of {several} to about half, and hold it until the fault is over"


def rehearse(
    connection: Connection, fault: Fault, deployment: Deployment, on_wait: Callable[[str], None]
) -> Verdict:
    """Let the daemon make a fault, and wait until it is over; however this ends, the fault does.

    Args:
        connection: to the daemon; the fault ends with it.
        fault: that fault.
        deployment: the machine.
        on_wait: called again and again with the phase; what it raises ends the fault, and trips
            what moves.

    Raises:
        ControlError: the daemon refuses, or is gone.
    """
    report = _ask(connection, fault.name)
    try:
        while report["phase"] != "done":
            on_wait(str(report["phase"]))
            report = _ask(connection, "report")
    except BaseException:
        _ask(connection, "end")
        raise
    return judged(fault, report, deployment)


def _ask(connection: Connection, what: str) -> Mapping[str, Any]:
    try:
        answer: Mapping[str, Any] = connection.ask({"fault": what, "by": person()})["fault"]
    except ControlError as error:
        if "got another object" in str(error):
            text = "the daemon is of an older version, which rehearses no faults: restart it"
            raise ControlError(text) from None
        raise
    return answer


def table(rows: Iterable[Mapping[str, Any]]) -> "Table":
    """Rows of ``Verdict.as_dict`` as a table."""
    shown = new_table("fault", *HEADS, title="Rehearsed faults")
    for row in rows:
        after = row["neutral_ms"]
        cells = (row["claim"], row["expected"], row["happened"], "" if after is None else after)
        shown.add_row(row["name"], *(f"{one:.0f}" if isinstance(one, float) else one for one in
                      cells), row["verdict"])  # fmt: skip
    return shown


def keep(folder: Path, deployment: Deployment, verdicts: Iterable[Verdict]) -> Path:
    """Write verdicts among those of before, as JSON and as a table to print; return the table."""
    folder.mkdir(exist_ok=True)
    rows = {row["name"]: row for row in kept(folder)}
    rows |= {one.name: one.as_dict() for one in verdicts}
    (folder / RESULTS).write_text(json.dumps([*rows.values()], indent=2), encoding="utf-8")
    path = folder / "faults.html"
    facts = html.facts(deployment, datetime.now().astimezone())
    title = f"Rehearsed faults of {deployment.path.name}"
    path.write_text(html.document(title, facts, [html.table(table(rows.values()))]), "utf-8")
    return path


def kept(folder: Path) -> list[dict[str, Any]]:
    """Verdicts that were kept; none where there are none yet."""
    path = folder / RESULTS
    rows: list[dict[str, Any]] = json.loads(path.read_text("utf-8")) if path.exists() else []
    return rows
