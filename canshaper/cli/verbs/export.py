"""``canshaper export``: the axes of a machine as C99, or as a unit for co-simulation."""

from pathlib import Path

import typer

from canshaper.cli.common import FILE, echo, loader
from canshaper.errors import UsageError

GROUP = "design"


def export(
    file: str = FILE,
    out: Path = typer.Option(..., "--out", metavar="DIR", help="Folder to write, new or empty."),
    single: bool = typer.Option(
        False, "--float", help="Compute in float; this computer needs a C compiler."
    ),
    fmu: str | None = typer.Option(
        None, "--fmu", help="controller or plant: write one FMI 3.0 co-simulation unit, in double."
    ),
) -> None:
    """Write the axes and their motion as C99, for a controller without Python.

    The C code is the same for every machine; export writes its tables. Without --float its valve
    frames equal those of this program to the last bit. A key that the C code does not support (sway
    sensors, gain schedules, E2E, J1939, CANopen and more) is refused by name. The folder has a
    self-test with a golden drive, which also runs on the target: make -C axis && axis/selftest.

    --fmu writes a unit for other simulators: the same C code, or the simulated crane.

    Examples:

      canshaper export machine.yaml --out axis

      canshaper export machine.yaml --out axis --float

      canshaper export machine.yaml --out unit --fmu controller
    """
    if fmu is None:
        from canshaper.native.export import export as write

        lines = write(loader(file)(), out, single=single)
    elif single or fmu not in ("controller", "plant"):
        raise UsageError(f"--fmu: expected controller or plant, without --float, got {fmu}")
    else:
        from canshaper.campaign.fmu import plant_unit
        from canshaper.native.fmu import controller_unit, write_fmu

        unit_of = plant_unit if fmu == "plant" else controller_unit
        deployment = loader(file)()
        lines = [write_fmu(unit_of(deployment), deployment, out)]
    for line in lines:
        echo(line)
