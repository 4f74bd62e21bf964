"""Parts that verbs share: options, loading a deployment, exit codes, printing of errors."""

import shlex
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Literal

import typer

from canshaper.errors import (
    BusError,
    CalibrationError,
    ConfigError,
    ControlError,
    InternalError,
    NodeError,
    Problem,
    UsageError,
    printable,
)
from canshaper.shipped import deployment_path

if TYPE_CHECKING:
    from canshaper.campaign.engine import Engine
    from canshaper.machine.deployment import Deployment

MOST_WARNINGS = 10  # warnings of DBC files that are printed; the rest is only counted
EXIT_NOT_ENOUGH_DATA = 1  # a measurement of an axis has not enough data
EXIT_USELESS = 1  # the filter leaves more than half of the swing
EXIT_WRONG = 2  # a file or an option is wrong, or a package is not installed
EXIT_INTERRUPTED = 130  # SIGINT, as a shell reports it
# Exit code of each kind of error; of any other error it is EXIT_WRONG.
EXITS: dict[type[Exception], int] = {
    InternalError: 1,
    ControlError: 1,
    CalibrationError: 1,
    NodeError: 1,
    BusError: 3,  # the file is good; the service manager tries again until the interface is there
}
# Extra of canshaper that installs each optional package.
EXTRAS = {
    **dict.fromkeys(("canopen", "casadi", "matplotlib", "numpy", "scipy"), "tools"),
    **dict.fromkeys(("starlette", "uvicorn", "websockets"), "studio"),
    "pyarrow": "campaign",
    "fmpy": "fmi",
    "prometheus_client": "metrics",
    **dict.fromkeys(("dask_jobqueue", "distributed"), "cluster"),
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
    help="Name of the crane if the deployment has several: the first part of its axis names.",
)
DEFAULT, SENSED = "forwarder-robust.yaml", "forwarder-sensor.yaml"
SENSOR: bool = typer.Option(
    False, "--sensor", help=f"The shipped deployment with a sway sensor: {SENSED}."
)
SET = typer.Option(
    None, "--set", metavar="NAME=VALUE", help="Change a parameter, such as grapple.l2_m=1.5."
)
PLANT = typer.Option(
    None, "--plant", metavar="FMU", help="Your own crane model, instead of the simulated one."
)
PROCESSES = typer.Option(
    None, "--processes", min=1, help="Number of processes; by default one for each processor."
)
SCHEDULER = typer.Option(
    None, "--scheduler", metavar="ADDRESS", help="Dask cluster, such as tcp://10.0.0.1:8786."
)
NETWORK = typer.Option(
    False, "--network", help="Send a udp_multicast bus over the network too, not only locally."
)

EXPORT = typer.Option(
    None, "--export", metavar="FILE", help="Write the drive with anti-sway on as .mcap or .mf4."
)
REPORT = typer.Option(
    None,
    "--report",
    metavar="FILE.html",
    help="Write all results into one file, to print and sign.",
)
PICTURE = typer.Option(
    None, "--picture", metavar="FILE", help="Write the picture here: .png, .svg or .pdf."
)


class Stop:
    """Catches SIGTERM and SIGINT; one sets ``requested``, a second of the same ends the verb."""

    def __init__(self) -> None:
        self.requested = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self.requested = True
        again = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
        signal.signal(number, again)


def engine(
    processes: int | None, scheduler: str | None, cluster: Literal["slurm"] | None = None
) -> "Engine":
    """Return what runs parallel work: processes on this computer, a Dask cluster, or Slurm jobs.

    ``processes`` is also the number of Slurm jobs; None means one process for each processor.

    Raises:
        UsageError: ``cluster`` comes without ``processes`` or with ``scheduler``.
    """
    from canshaper.campaign.engine import Cluster, Slurm
    from canshaper.design.parallel import Processes

    def on_refusal(text: str) -> None:
        echo(f"refused: {text}", err=True)

    if cluster is not None:
        if scheduler is not None or processes is None:
            raise UsageError("--cluster: expected --processes, its jobs, and no --scheduler")
        return Slurm(processes, on_refusal)
    return Processes(processes) if scheduler is None else Cluster(scheduler, on_refusal)


def echo(text: str, *, err: bool = False) -> None:
    """Print lines; control characters from files or frames are shown as text, never executed."""
    typer.echo(printable(text), err=err)


def fail(error: Exception, code: int | None = None) -> typer.Exit:
    """Print an error and return the exit to raise; without ``code`` the error's kind chooses it."""
    echo(str(error), err=True)
    codes = (exit_code for kind, exit_code in EXITS.items() if isinstance(error, kind))
    return typer.Exit(next(codes, EXIT_WRONG) if code is None else code)


def end_interrupted(at: str) -> None:
    """End the verb with exit code 130 if Ctrl-C interrupted it; ``at`` says where, "" if not."""
    if at:
        echo(f"interrupted at {at}", err=True)
        raise typer.Exit(EXIT_INTERRUPTED)


@contextmanager
def os_errors(path: Path) -> Iterator[None]:
    """Turn an OSError in the block into a UsageError: its file, else ``path``, and its reason."""
    try:
        yield
    except OSError as error:
        raise UsageError(f"{error.filename or path}: {error.strerror or error}") from None


def install_line(package: str) -> str:
    """Return the pip command that installs an optional package and the others of its extra."""
    packages = [name for name, extra in EXTRAS.items() if extra == EXTRAS[package]]
    return f"{shlex.quote(sys.executable)} -m pip install {' '.join(packages)}"


def refuse_shipped(file: str, option: str = "--write") -> None:
    """Raise a ConfigError for ``option`` if the file to write into is shipped with the package."""
    if deployment_path(file) != Path(file):
        text = "shipped with the package; copy it, then write to the copy"
        raise ConfigError([Problem(file, None, option, text)])


def sensed(file: str, sensor: bool) -> str:
    """Return the file to load: the shipped one with a sway sensor if ``--sensor`` is given alone.

    Raises:
        UsageError: ``--sensor`` comes with another file than the default one.
    """
    if sensor and file != DEFAULT:
        raise UsageError(f"--sensor: expected without FILE, got {file}: it is {SENSED}")
    return SENSED if sensor else file


def loader(
    file: str,
    interface: str | None = None,
    channels: list[str] | None = None,
    *,
    network: bool = False,
    inside: Path | None = None,
) -> "Callable[[], Deployment]":
    """Return a function that loads the deployment and applies the bus options of the command line.

    A channel is CHANNEL, or NAME=CHANNEL with several buses; ``network`` needs udp_multicast. With
    ``inside`` no DBC file outside of that directory is read. The function raises a ConfigError.
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
        if interface:  # the file's ``network`` was meant for its own interface
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


def names_of(paths: Sequence[Path]) -> list[str]:
    """Return a name for each deployment: its stem, with a number where two files share it."""
    stems = [path.stem for path in paths]
    return [
        stem if stems.count(stem) == 1 else f"{stem}-{stems[: i + 1].count(stem)}"
        for i, stem in enumerate(stems)
    ]


def channels_of(given: Sequence[str]) -> dict[str, str]:
    """Parse BUS=CHANNEL options; return the channel of the log by bus, or raise BadParameter."""
    channels = {}
    for item in given:
        bus, mark, channel = item.partition("=")
        if not mark:
            raise typer.BadParameter(f"expected BUS=CHANNEL, got {item!r}", param_hint="--channel")
        channels[bus] = channel
    return channels


def buses_line(deployment: "Deployment") -> str:
    """Return name, interface and channel of each bus, as one line."""
    buses = deployment.config.buses.items()
    return ", ".join(f"{name} ({bus.interface} {bus.channel})" for name, bus in buses)


def control_socket(deployment: "Deployment") -> Path:
    """Return the path of the daemon's control socket; UsageError without a control section."""
    section = deployment.config.control
    if section is None:
        text = (
            "this file has no control section; it says which numbers may be changed, for example"
            " control: { adjustable: { axes.slew.sway.period_s: [1.8, 3.0] } }"
        )
        raise UsageError(f"{deployment.path}: {text}")
    return section.path(deployment.path)


def print_warnings(count: int, warnings: list[Problem], are: str) -> None:
    """Print how many warnings the DBC files gave, and the first ten; nothing where there is none.

    ``are`` says which messages and tables they are about, such as "not used".
    """
    if count:
        echo(f"  {count} WARNING{'S' if count > 1 else ''} in messages and tables that are {are}:")
    for warning in warnings[:MOST_WARNINGS]:
        echo(f"    {warning}")
    if (more := count - MOST_WARNINGS) > 0:
        echo(f"    and {more} more")
