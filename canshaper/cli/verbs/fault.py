"""``canshaper fault``: faults rehearsed at the running machine."""

import json
import time
from pathlib import Path

import typer

from canshaper.cli.common import FILE, control_socket, echo, loader, os_errors, refuse_shipped
from canshaper.errors import UsageError

GROUP = "setup"

EXIT_WRONG_REACTION = 1
POLL_S = 0.1


def fault(
    file: str = FILE,
    only: list[str] | None = typer.Option(
        None, "--only", metavar="NAME", help="This one: a name, its part before ':', or a row."
    ),
    listed: bool = typer.Option(False, "--list", help="Show the faults and what to expect; exit."),
    control: Path | None = typer.Option(
        None, "--control", metavar="PATH", help="Control socket instead of the file's."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print JSON, behind the questions."),
) -> None:
    """Rehearse faults at the running machine: is each reaction the one of the safety concept?

    The daemon has to run with control.rehearse_faults in its file, which needs reduced speed. Each
    fault is announced and needs your yes. The daemon then makes it on its inputs: frames are lost,
    frozen or wrong for controller and gate alike, never with a larger demand than the joystick's.
    Whoever lets the joystick go ends the fault. It is over by itself after some seconds.

    Ctrl-C ends the fault, and what moves trips. Results and a table to print are in
    FILE.commission/; the report of canshaper commission has them too.

    Exit code 0 when each reaction was right, 1 when one was not or the daemon refuses, 2 when the
    file or the command line is wrong.

    Examples:

      canshaper fault machine.yaml --list

      canshaper fault machine.yaml

      canshaper fault machine.yaml --only JOYSTICK_TIMEOUT --only standstill:loop
    """
    from canshaper.commissioning.control_client import Connection
    from canshaper.commissioning.procedure.files import Files
    from canshaper.commissioning.rehearsal.reactions import row_of
    from canshaper.commissioning.rehearsal.run import (
        announced,
        chosen,
        keep,
        refused,
        rehearse,
        table,
    )
    from canshaper.commissioning.rehearsal.verdict import GOOD
    from canshaper.report.console import SafeConsole, new_table

    deployment = loader(file)()
    faults = chosen(deployment, only or [])
    if listed:
        shown = new_table("fault", "row", "reaction")
        for one in faults:
            shown.add_row(one.name, one.claim, row_of(one.claim).reaction)
        for claim, why in refused(deployment).items():
            shown.add_row("", claim, f"not rehearsed: {why}")
        SafeConsole().print(shown)
        return
    refuse_shipped(file)
    section = deployment.config.control
    if section is None or not section.rehearse_faults:
        text = "expected control.rehearse_faults: true, and reduced speed, got none"
        raise UsageError(f"{deployment.path}: {text}")
    verdicts = []
    with Connection(control or control_socket(deployment)) as connection:
        for number, one in enumerate(faults, 1):
            row = row_of(one.claim)
            echo(f"{number}/{len(faults)} {one.name}: {row.ids}: {row.what} -> {row.reaction}")
            if not typer.confirm(f"  Then {announced(one, deployment)}. Make it?", err=as_json):
                continue
            verdicts.append(rehearse(connection, one, deployment, lambda _: time.sleep(POLL_S)))
            echo(f"  {verdicts[-1].happened}: {verdicts[-1].verdict}")
    rows = [one.as_dict() for one in verdicts]
    if as_json:
        echo(json.dumps(rows, indent=2))
    elif rows:
        SafeConsole().print(table(rows))
    folder = Files(deployment.path).folder
    with os_errors(folder):
        echo(f"Written: {keep(folder, deployment, verdicts)}", err=as_json)
    if any(one.verdict != GOOD for one in verdicts):
        raise typer.Exit(EXIT_WRONG_REACTION)
