"""``canshaper run``: the daemon."""

import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import CHANNEL, FILE, INTERFACE, NETWORK, loader

if TYPE_CHECKING:
    from canshaper.machine.deployment import Deployment

GROUP = "drive"


def run(
    file: str = FILE,
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    listen_only: bool = typer.Option(
        False, "--listen-only", help="Compute, and send the status messages but no valve frame."
    ),
    simulated: bool = typer.Option(
        False, "--simulated", help="Accept valve curves of a simulated crane on a real bus."
    ),
    control: str | None = typer.Option(
        None, "--control", metavar="PATH", help="Control socket instead of the file's."
    ),
    priority: int = typer.Option(
        0, "--priority", min=0, max=49, help="Run with SCHED_FIFO at this priority once the buses"
        " are open; 0: keep the scheduler.",
    ),
    black_box: Path | None = typer.Option(
        None, "--black-box", metavar="FOLDER", help="Folder for black boxes; by default the log"
        " directory that systemd gives the service. Without one no black box is written."
    ),
) -> None:  # fmt: skip
    """Shape the joystick commands of a deployment until SIGTERM or Ctrl-C.

    SIGHUP reads the file again. The daemon applies it when it is valid and every axis is in
    neutral. An interface that goes away is used again when it is back.

    With --listen-only the daemon can run next to the controller that drives the machine now: it
    sends only the status messages, which say what the valves would get.

    If its limits let an axis travel on for more than 2 m after release, the file needs a
    stop_distance_m. Without it the daemon does not start, and refuses a reload.

    It does not start either with a valve curve that was measured on a simulated crane, if the bus
    may be that of a machine. --simulated accepts such a curve.

    After a trip, or a stop because of a fault, the daemon writes a black box: all that it received
    and sent, tick by tick, from one minute before to five seconds after. It keeps the newest 20.
    canshaper replay plays them.

    Exit code 0 after a stop, 2 when the file is wrong, 3 when a bus cannot be opened; as a service
    of systemd it waits for the bus instead.

    Examples:

      canshaper run config/forwarder-robust.yaml

      canshaper run config/forwarder-robust.yaml --interface socketcan --channel can0

      canshaper run machine.yaml --listen-only
    """
    _import_can()
    from canshaper.daemon import journal, realtime
    from canshaper.daemon.daemon import Daemon

    journal.set_up()
    realtime.drop_capabilities()
    load = loader(file, interface, channel, network=network)
    changed = _changed(load, listen_only=listen_only, simulated=simulated, control=control)
    daemon = Daemon(changed, black_box or _log_folder())
    if priority:
        realtime.take_priority(priority)
    daemon.run()


def _import_can() -> None:
    """Import python-can without asammdf, which it imports wherever that is installed.

    That brings NumPy and pandas: a start takes four times as long and 70 MB more.
    """
    if "asammdf" not in sys.modules:
        sys.modules["asammdf"] = None  # type: ignore[assignment]  # as if it were not installed
        try:
            import can  # noqa: F401
        finally:
            del sys.modules["asammdf"]


def _log_folder() -> Path | None:
    """Return the first log folder (LogsDirectory=) that systemd gives the service, if any."""
    first = os.environ.get("LOGS_DIRECTORY", "").split(":")[0]
    return Path(first) if first else None


def _changed(
    load: "Callable[[], Deployment]", *, listen_only: bool, simulated: bool, control: str | None
) -> "Callable[[], Deployment]":
    """Return a loader that applies these options, and refuses what may not run with a ConfigError.

    Refused are, without ``listen_only``, an axis with a long stop but no stop_distance_m and,
    without ``simulated``, the curve of a simulated crane for a valve on a real bus; and a
    ``control`` socket for a file without a section control.
    """
    from canshaper.config.source import Source
    from canshaper.errors import ConfigError, Problem
    from canshaper.machine.stop_distance import rehearsed_valves, unstated

    def changed() -> "Deployment":
        deployment = load()
        if listen_only:
            deployment = deployment.listening()
        else:
            faults = [*unstated(deployment)]
            faults += [] if simulated else rehearsed_valves(deployment.config)
            if faults:
                source = Source(deployment.path)
                raise ConfigError([source.problem(place, text) for place, text in faults])
        if control is None:
            return deployment
        section = deployment.config.control
        if section is None:
            text = "the deployment file has no control section, so nothing may be changed"
            raise ConfigError([Problem("command line", None, "--control", text)])
        section = section.model_copy(update={"socket": control})
        config = deployment.config.model_copy(update={"control": section})
        return replace(deployment, config=config)

    return changed
