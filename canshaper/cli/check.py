"""``canshaper check``: is a deployment fit to start?"""

import typer

from canshaper.cli.common import EXIT_BAD_DEPLOYMENT, FILE, loader


def check(file: str = FILE) -> None:
    """Load a deployment against its DBC files and report every problem at once.

    Exit code 0 when it is good, 2 when it is not.

    Examples:

      canshaper check config/forwarder.yaml
    """
    from canshaper.config.source import DeploymentError

    try:
        deployment = loader(file)()
    except DeploymentError as error:
        for problem in error.problems:
            typer.echo(str(problem), err=True)
        count = len(error.problems)
        typer.echo(f"{count} problem{'s' if count > 1 else ''}", err=True)
        raise typer.Exit(EXIT_BAD_DEPLOYMENT) from None
    config = deployment.config
    typer.echo(f"{deployment.path}: good")
    for name, bus in config.buses.items():
        typer.echo(f"  bus {name}: {bus.interface} {bus.channel}")
    for name, axis in deployment.axes.items():
        valve, stick = axis.config.valve, axis.config.stick
        period_ms = axis.period_ticks * config.tick_ms
        typer.echo(
            f"  axis {name}: {config.levers[stick.lever].message}.{stick.signal}"
            f" -> {axis.config.filter.kind} -> {valve.message}.{valve.signal} every {period_ms} ms"
        )
