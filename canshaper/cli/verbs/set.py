"""``canshaper set``: numbers of a running daemon."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import FILE, control_socket, echo, loader, refuse_shipped
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from rich.table import Table

GROUP = "drive"


def set(
    file: str = FILE,
    changes: list[str] | None = typer.Argument(
        None,
        metavar="[KEY=VALUE]...",
        help="Numbers to change; without any, list those that may be.",
    ),
    control: Path | None = typer.Option(
        None, "--control", metavar="PATH", help="Control socket instead of the file's."
    ),
    write: bool = typer.Option(
        False,
        "--write",
        help="Write the numbers into the file too, after the daemon has accepted them.",
    ),
    as_json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Show or change numbers of a running daemon, without a jump of any valve.

    The file's section "control" says which numbers may change, and how far. All numbers of one call
    change together, or none does. Without --write they are lost when the daemon ends or reads its
    file again. Limits of an axis change only while it is in neutral.

    Exit code 0 when it is done, 1 when the daemon refuses or does not answer, 2 when the file or
    the command line is wrong.

    Examples:

      canshaper set machine.yaml

      canshaper set machine.yaml axes.slew.sway.period_s=2.45

      canshaper set machine.yaml axes.slew.filter.a1=0.6 axes.slew.filter.a2=0.09 --write
    """
    from canshaper.commissioning import control_client as client
    from canshaper.commissioning.origins import write_numbers
    from canshaper.report.console import SafeConsole

    deployment = loader(file)()
    if write:
        refuse_shipped(file)
    path = control or control_socket(deployment)
    values = dict(_parsed(change) for change in changes or [])
    before = client.table(path)
    if values:
        client.change(path, values)
    table = client.table(path)
    if values and write:
        write_numbers(deployment.path, values)
    if as_json:
        echo(json.dumps(table, indent=2))
        return
    if not values:
        SafeConsole().print(_table(table))
        return
    for key, number in values.items():
        echo(f"{key}: {before[key]['now']:g} -> {number:g}")
    lost = "lost when the daemon ends or reads its file again; --write keeps them"
    echo(f"Written to {deployment.path}." if write else f"Not written: {lost}.")


def _parsed(text: str) -> tuple[str, float]:
    key, _, number = text.partition("=")
    try:
        return key.strip(), float(number)
    except ValueError:
        text = f"expected KEY=NUMBER, as in axes.slew.sway.period_s=2.45, got {text!r}"
        raise UsageError(text) from None


def _table(adjustable: dict[str, dict[str, float]]) -> "Table":
    from canshaper.report.console import new_table

    table = new_table("number", "now", "in the file", "from", "to")
    for key, one in adjustable.items():
        numbers = (one["now"], one["file"], one["low"], one["high"])
        table.add_row(key, *(f"{number:g}" for number in numbers))
    return table
