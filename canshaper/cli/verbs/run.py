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
        False, "--listen-only", help="Compute and send the status; send no valve frame."
    ),
    simulated: bool = typer.Option(
        False, "--simulated", help="Take valve curves of a simulated crane on a real bus too."
    ),
    control: str | None = typer.Option(
        None, "--control", metavar="PATH", help="Control socket instead of the file's."
    ),
    priority: int = typer.Option(
        0, "--priority", min=0, max=49, help="SCHED_FIFO with this priority, once the buses are"
        " open; 0: as it was started.",
    ),
    black_box: Path | None = typer.Option(
        None, "--black-box", metavar="FOLDER", help="Where black boxes are written; by default the"
        " log directory that systemd gives the service, else nowhere."
    ),
) -> None:  # fmt: skip
    """Shape the joystick commands of a deployment until SIGTERM or Ctrl-C.

    SIGHUP reads the file again; it is applied when it is valid and every axis is in neutral. An
    interface that goes away is used again when it is back.

    With --listen-only it can run next to the controller that drives the machine now: nothing is
    sent but the status messages, which say what the valves would get.

    Limits that let an axis travel on for more than 2 m after release have to be meant: without a
    stop_distance_m in the file it does not start, and a reload is refused.

    Nor does it with a valve curve that was measured on a simulated crane, on a bus that can be of
    a machine: --simulated takes it as it is.

    A trip or a stop for a fault leaves a black box behind, with the last minute before it and five
    seconds after it: what was received and sent, tick by tick. The newest 20 are kept; canshaper
    replay plays them.

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
    """Where systemd lets the service write its logs (systemd.exec(5), LogsDirectory=)."""
    first = os.environ.get("LOGS_DIRECTORY", "").split(":")[0]
    return Path(first) if first else None


def _changed(
    load: "Callable[[], Deployment]", *, listen_only: bool, simulated: bool, control: str | None
) -> "Callable[[], Deployment]":
    """Return a loader of the deployment with these options put in."""
    from canshaper.config.source import Source
    from canshaper.errors import ConfigError, Problem
    from canshaper.machine.stopping import rehearsed_valves, unstated

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
