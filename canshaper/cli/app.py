"""The ``canshaper`` command. Each verb imports what it needs when it is called."""

import sys

import typer

from canshaper import __version__
from canshaper.cli import (
    calibrate,
    check,
    compare,
    config_schema,
    demo,
    doctor,
    gateway,
    identify,
    init,
    monitor,
    record,
    replay,
    robust,
    run,
    set,
    sim,
    studio,
    tune,
)
from canshaper.cli.common import EXIT_WITHOUT_TOOLS, INSTALL_TOOLS, TOOLS

app = typer.Typer(
    help="Sensor-less anti-sway for hydraulic cranes, between joystick and valves on CAN.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,
)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"canshaper {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Show the version and exit."
    ),
) -> None:
    """Sensor-less anti-sway for hydraulic cranes, between joystick and valves on CAN."""


app.command("init")(init.init)
app.command("run")(run.run)
app.command("set")(set.set_)
app.command("check")(check.check)
app.command("calibrate")(calibrate.calibrate)
app.command("doctor")(doctor.doctor)
app.command("gateway")(gateway.gateway)
app.command("demo")(demo.demo)
app.command("identify")(identify.identify)
app.command("replay")(replay.replay)
app.command("record")(record.record)
app.command("monitor")(monitor.monitor)
app.command("sim")(sim.sim)
app.command("operator")(sim.operator)
app.command("studio")(studio.studio)
app.command("compare")(compare.compare)
app.command("tune")(tune.tune)
app.command("robust")(robust.robust)
app.command("config-schema")(config_schema.config_schema)


def main() -> None:
    """Entry point of the command."""
    try:
        app(prog_name="canshaper")
    except ModuleNotFoundError as error:
        name = (error.name or "").partition(".")[0]
        install = INSTALL_TOOLS if name in TOOLS else studio.INSTALL
        if name not in (*TOOLS, *studio.NEEDS):
            raise
        typer.echo(f"this command needs {name}, which is missing: {install}", err=True)
        sys.exit(EXIT_WITHOUT_TOOLS)
