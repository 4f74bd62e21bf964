"""What several verbs share: deployments by name, bus options, pictures, errors for people."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.config.printable import printable
from canshaper.errors import (
    BusError,
    CalibrationError,
    ConfigError,
    ControlError,
    Problem,
    UsageError,
)
from canshaper.shipped import deployment_path

if TYPE_CHECKING:
    from canshaper.machine.deployment import Deployment

MOST_WARNINGS = 10  # of DBC files; the others are counted
EXIT_WRONG = 2  # of a file, an option, or what is not installed
# What ends a command with another code.
EXITS: dict[type[Exception], int] = {
    ControlError: 1,
    CalibrationError: 1,
    BusError: 3,  # the file is good; the service manager tries again until the interface is there
}
# The extra that installs a package.
EXTRAS = {
    **dict.fromkeys(("casadi", "matplotlib", "numpy", "scipy"), "tools"),
    **dict.fromkeys(("starlette", "uvicorn", "websockets"), "studio"),
}

FILE = typer.Argument(..., help="Deployment file (YAML), or the name of a shipped one.")
INTERFACE = typer.Option(None, "--interface", help="python-can interface instead of the file's.")
CHANNEL = typer.Option(
    None,
    "--channel",
    help="Channel instead of the file's; with several buses NAME=CHANNEL, once for each.",
)
CRANE = typer.Option(
    None,
    "--crane",
    help="Which one, where the deployment has several: the first part of axis names.",
)
SET = typer.Option(
    None, "--set", metavar="NAME=VALUE", help="Change a parameter, such as grapple.l2_m=1.5."
)
NETWORK = typer.Option(
    False, "--network", help="Share a bus of udp_multicast over the network; else it stays local."
)


def echo(text: str, *, err: bool = False) -> None:
    """Print lines; control characters of what others wrote are shown, and do nothing."""
    typer.echo(printable(text), err=err)


def fail(error: Exception, code: int | None = None) -> typer.Exit:
    """Print an error as it is; its exit, which is that of its kind where ``code`` is None."""
    echo(str(error), err=True)
    codes = (exit_code for kind, exit_code in EXITS.items() if isinstance(error, kind))
    return typer.Exit(next(codes, EXIT_WRONG) if code is None else code)


@contextmanager
def os_errors(path: Path) -> Iterator[None]:
    """What the system refuses in the block is an error for the person: which file, and why."""
    try:
        yield
    except OSError as error:
        raise UsageError(f"{error.filename or path}: {error.strerror or error}") from None


def install_line(package: str) -> str:
    """How to get what an extra installs."""
    return f"pip install 'canshaper[{EXTRAS[package]}]'"


def picture(path: Path, draw: Callable[[Path], None]) -> Path | None:
    """Let a picture be drawn, in a folder that is made; None where matplotlib is missing."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        return None
    path.parent.mkdir(parents=True, exist_ok=True)
    draw(path)
    return path


def picture_line(path: Path | None) -> str:
    """Where it is, or why there is none."""
    none = f"none, matplotlib is missing: {install_line('matplotlib')}"
    return f"Picture: {path or none}"


def refuse_shipped(file: str) -> None:
    """Refuse to write into a deployment that is only found among the shipped ones.

    Raises:
        ConfigError: it is one of them.
    """
    if deployment_path(file) != Path(file):
        text = "shipped with the package; copy it, then write to the copy"
        raise ConfigError([Problem(file, None, "--write", text)])


def loader(
    file: str,
    interface: str | None = None,
    channels: list[str] | None = None,
    *,
    network: bool = False,
    inside: Path | None = None,
) -> "Callable[[], Deployment]":
    """A function that loads the deployment with the bus options of the command line put in.

    With ``inside`` it reads no DBC file outside of that directory.
    """
    from canshaper.machine.binding import load_deployment

    path = deployment_path(file)

    def load() -> "Deployment":
        deployment = load_deployment(path, inside)
        if not interface and not channels and not network:
            return deployment
        buses = dict(deployment.config.buses)
        for item in channels or []:
            name, _, channel = item.rpartition("=")
            if not name and len(buses) == 1:
                name = next(iter(buses))
            if name not in buses:
                text = f"expected NAME=CHANNEL with one of {', '.join(buses)}, got {item!r}"
                raise ConfigError([Problem("command line", None, "--channel", text)])
            buses[name] = buses[name].model_copy(update={"channel": channel})
        if interface:  # what the file says of sharing was said of its own interface
            update = {"interface": interface, "network": False}
            buses = {n: b.model_copy(update=update) for n, b in buses.items()}
        if network:
            if others := {b.interface for b in buses.values()} - {"udp_multicast"}:
                text = f"expected udp_multicast only, got the interface {', '.join(others)}"
                raise ConfigError([Problem("command line", None, "--network", text)])
            buses = {n: b.model_copy(update={"network": True}) for n, b in buses.items()}
        if len({(b.interface, b.channel) for b in buses.values()}) < len(buses):
            text = f"expected a channel for each of {', '.join(buses)}, got one for two of them"
            raise ConfigError([Problem("command line", None, "--channel", text)])
        return replace(deployment, config=deployment.config.model_copy(update={"buses": buses}))

    return load


def control_socket(deployment: "Deployment") -> Path:
    """Path of the control socket of its daemon.

    Raises:
        UsageError: the file has none.
    """
    section = deployment.config.control
    if section is None:
        text = (
            "this file has no control section; it says which numbers may be changed, for example"
            " control: { adjustable: { axes.slew.sway.period_s: [1.8, 3.0] } }"
        )
        raise UsageError(f"{deployment.path}: {text}")
    return section.path(deployment.path)


def print_warnings(count: int, warnings: list[Problem], are: str) -> None:
    """Show the first faults of DBC files in messages that ``are`` in this way, and how many."""
    if count:
        echo(f"  {count} WARNING{'S' if count > 1 else ''} in messages that are {are}:")
    for warning in warnings[:MOST_WARNINGS]:
        echo(f"    {warning}")
    if (more := count - MOST_WARNINGS) > 0:
        echo(f"    and {more} more")
