"""``canshaper fault``: faults rehearsed at the running machine."""

from pathlib import Path

import typer

from canshaper.cli.common import FILE, control_socket, echo, loader, os_errors, refuse_shipped
from canshaper.errors import UsageError

GROUP = "setup"

EXIT_WRONG_REACTION = 1


def fault(
    file: str = FILE,
    only: list[str] | None = typer.Option(
        None,
        "--only",
        metavar="NAME",
        help="Only this fault: its name, the part before ':', or a row.",
    ),
    listed: bool = typer.Option(
        False, "--list", help="List the faults and the expected reactions; exit."
    ),
    control: Path | None = typer.Option(
        None, "--control", metavar="PATH", help="Control socket instead of the file's."
    ),
) -> None:
    """Rehearse faults at the running machine: is each reaction the one of the safety concept?

    The daemon has to run with control.rehearse_faults in its file, which needs reduced speed. Each
    fault is announced and needs your yes. The daemon then simulates it on its inputs: it loses,
    freezes or falsifies frames, for controller and gate alike. The demand is never larger than that
    of the joystick. The fault ends when you release the joystick, or after some seconds.

    Ctrl-C ends the fault; axes that move trip. The report of canshaper commission has the table.

    Exit code 0 when each reaction was right, 1 when one was not or the daemon refuses, 2 when the
    file or the command line is wrong.

    Examples:

      canshaper fault machine.yaml --list

      canshaper fault machine.yaml

      canshaper fault machine.yaml --only JOYSTICK_TIMEOUT --only standstill:loop
    """
    from canshaper.commissioning.procedure import rehearsed
    from canshaper.commissioning.procedure.files import Files
    from canshaper.report.console import SafeConsole, new_table

    deployment = loader(file)()
    faults = rehearsed.chosen(deployment, only or [])
    if listed:
        shown = new_table("fault", "row", "expected")
        for one in faults:
            shown.add_row(one.name, one.claim, rehearsed.expected(one))
        for claim, why in rehearsed.refused(deployment).items():
            shown.add_row("", claim, f"not rehearsed: {why}")
        SafeConsole().print(shown)
        return
    refuse_shipped(file)
    section = deployment.config.control
    if section is None or not section.rehearse_faults:
        text = "expected control.rehearse_faults: true, and reduced speed, got none"
        raise UsageError(f"{deployment.path}: {text}")
    path, folder = control or control_socket(deployment), Files(deployment.path).folder
    rows = []
    for number, one in enumerate(faults, 1):
        act = f"move {' or '.join(one.axes)} to about half and hold it until the fault is over"
        echo(f"{number}/{len(faults)} {one.name}: {one.claim}: {rehearsed.expected(one)}")
        act = act if one.axes else "let every joystick rest"
        if not typer.confirm(f"  Then {act}. Make it?"):
            continue
        row = rehearsed.made(path, one, deployment)
        rows.append(row)
        with os_errors(folder):
            kept = rehearsed.keep(folder, row)
        echo(f"  {row['happened']}: {row['verdict']}")
    if rows:
        SafeConsole().print(rehearsed.table(rows))
        echo(f"Kept in {kept}, for the report of canshaper commission.")
    if any(row["verdict"] != rehearsed.GOOD for row in rows):
        raise typer.Exit(EXIT_WRONG_REACTION)
