"""``canshaper export``: the tuned axes of a machine as C99."""

from pathlib import Path

import typer

from canshaper.cli.common import FILE, echo, loader

GROUP = "design"


def export(
    file: str = FILE,
    out: Path = typer.Option(..., "--out", metavar="DIR", help="A new or empty folder."),
    single: bool = typer.Option(False, "--float", help="In float; it needs a C compiler here."),
) -> None:
    """Write the axes and their motion as C99, for a controller without Python.

    The C is the same for every machine; only its tables are made, and equal this program to the
    last bit. What it has no part for (sway sensors, gain schedules, E2E, J1939, CANopen and more)
    is refused by its key. The folder has a golden drive as self-test, for the target too:
    make -C axis && axis/selftest.

    Examples:

      canshaper export machine.yaml --out axis

      canshaper export machine.yaml --out axis --float
    """
    from canshaper.native.export import export as write

    for line in write(loader(file)(), out, single=single):
        echo(line)
