"""``canshaper init``: a first deployment, by a few questions."""

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import EXTRAS, echo, install_line, loader, os_errors, print_warnings
from canshaper.cli.interview.answers import accepted, answered_by, confirmed
from canshaper.errors import CanshaperError, ConfigError, UsageError
from canshaper.shaping.sway import GRAVITY_M_S2
from canshaper.shipped import data_directory

if TYPE_CHECKING:
    from cantools.database.can import Message

    from canshaper.cli.interview.first import FirstAxis, FirstLoad, FirstMachine
    from canshaper.cli.interview.nodes import Nodes
    from canshaper.commissioning.nodes.parameters import Parameter
    from canshaper.config.bus import Bus

GROUP = "setup"


def init(
    file: Path = typer.Argument(Path("machine.yaml"), help="Deployment file to write."),
    dbc: list[Path] | None = typer.Option(
        None, "--dbc", help="DBC file of the machine; several with the option again."
    ),
    eds: list[Path] | None = typer.Option(
        None, "--eds", help="EDS or DCF file of a CANopen node; for each node once."
    ),
    interface: str = typer.Option("socketcan", "--interface", help="python-can interface."),
    set_by_sdo: bool = typer.Option(
        False, "--set-by-sdo", help="Set what has to be set in the nodes; a real bus is asked for."
    ),
    force: bool = typer.Option(False, "--force", help="Replace a file that is there."),
    answers: Path | None = typer.Option(
        None, "--answers", metavar="FILE", help="Ask nothing: lines of QUESTION = ANSWER."
    ),
) -> None:
    """Ask a few questions about a machine and write its first deployment.

    Looks through the DBC files for joysticks, valves and switches, and shows the whole machine as
    it would be; where that is not right, or something is missing, it asks. Enter then takes what
    stands in brackets, "-" leaves a thing out. What the DBC does not say is asked: full deflection,
    value in the middle, direction by flags or by a second signal. What says that a log is gripped
    gives filters for an empty grapple and for a log; where nothing does, one response may hold for
    both. Written with reduced
    speed, and as we recommend: a robust shaper for each axis that swings (without SciPy a G_FF to
    begin with), slew and near-far as one motion, which is off until the step motion of commission
    is done. What is a guess of its own stands under assumed. A switch may be one bit of a signal,
    as SIGNAL/BIT; without one a draft is kept. Ctrl-C writes nothing; should the check of the
    whole file find something after all, the answers stay in a draft next to it. Machines of J1939
    begin with a copy of the shipped j1939-forwarder.yaml.

    With --eds nodes of CANopen are taken from their makers' files: PDOs as they are mapped, event
    timers, heartbeats. They become a DBC file next to the deployment. What has to be set in a node
    is said, and with --set-by-sdo written: each object is read, set, and read again.

    With --answers nothing is asked. Each line of that file has a question by its first words, that
    of an axis after its name, such as "slew: time of ten full swings = 24.1"; yes or no; "#" begins
    a comment. What has no line is answered as by Enter.

    Examples:

      canshaper init machine.yaml --dbc machine.dbc

      canshaper init machine.yaml --dbc machine.dbc --answers machine.txt

      canshaper init machine.yaml --eds joystick.eds --eds valve.dcf

      canshaper init  # tries it with the shipped forwarder.dbc
    """
    from canshaper.cli.interview.first import FIRST_MAX_PCT
    from canshaper.cli.interview.first_file import first_deployment
    from canshaper.cli.interview.machine import machine_of
    from canshaper.cli.interview.nodes import Nodes, uses_of

    draft = file.with_name(f"{file.stem}.draft.yaml")
    own = file.with_name(f"{file.stem}-canopen.dbc")
    for path in (file, draft, *([own] if eds else [])):
        if path.exists() and not force:
            raise UsageError(f"{path}: is there already; --force replaces it")
    folder = file.resolve().parent
    if not (folder.is_dir() and os.access(folder, os.W_OK)):
        raise UsageError(f"{folder}: expected a folder that can be written to")
    with os_errors(file):
        files = dbc or ([] if eds else [data_directory() / "dbc" / "forwarder.dbc"])
        messages = _messages(files)
        with answered_by(answers):
            nodes = Nodes(eds or [])
            messages += nodes.messages
            of = ", ".join(map(str, (*files, *(eds or []))))
            echo(f"{len(messages)} messages in {of}.")
            used = (*files, *([own] if eds else []))
            names = [os.path.relpath(path.resolve(), folder) for path in used]
            ask = partial(machine_of, messages, names, interface, nodes)
            machine = (None if answers else accepted(ask)) or ask()
            uses = uses_of(machine, messages)
            parameters = nodes.parameters(uses)
            writes = set_by_sdo and _confirmed(machine, parameters)
        notes = [*nodes.missing(uses), *(f"To be set by SDO: {one}" for one in parameters)]
        if eds:
            _write_dbc(own, nodes)
        _write(file, draft, first_deployment(replace(machine, notes=notes)))
    reduced = f"at reduced speed (max_pct: {FIRST_MAX_PCT})"
    echo(f"\nWritten: {file}, with {len(machine.axes)} axes {reduced}.")
    if machine.motion:
        echo("Two-axis motion is off until the step motion of commission is done.")
    if assumed := [key for axis in machine.axes for key in axis.assumed()]:
        echo(f"Assumed until someone measures or types them: {', '.join(assumed)}.")
    for note in notes:
        echo(f"  {note}")
    if writes:
        _set_by_sdo(machine, nodes, parameters)
    left = [
        axis.name for axis in machine.axes if axis.swing and not _designed(file, axis, machine.load)
    ]
    echo("What comes next:")
    echo(f"  canshaper check {file}")
    for axis in left:
        echo(f"  canshaper robust {file} --axis {axis} --write")
    echo(f"  canshaper commission {file} --simulated  # at the desk")
    echo(f"  canshaper commission {file}  # on the machine")


def _confirmed(machine: "FirstMachine", parameters: "Sequence[Parameter]") -> bool:
    """Whether parameters are to be written; on a real bus the operator is asked."""
    if not parameters:
        return False
    where = f"{machine.interface} channel {machine.channel}"
    text = f"Write {len(parameters)} parameters into the nodes on {where}, now"
    return _bus(machine).is_virtual or confirmed(text, default=False)


def _bus(machine: "FirstMachine") -> "Bus":
    from canshaper.config.bus import Bus

    return Bus(interface=machine.interface, channel=machine.channel, bitrate=machine.bitrate)


def _set_by_sdo(machine: "FirstMachine", nodes: "Nodes", parameters: "Sequence[Parameter]") -> None:
    from canshaper.commissioning.nodes.parameters import write

    for line in write(_bus(machine), nodes.named, parameters):
        echo(f"  {line}")


def _write_dbc(path: Path, nodes: "Nodes") -> None:
    from canshaper.commissioning.nodes.messages import dbc

    path.write_text(dbc(nodes.messages), encoding="utf-8", newline="\n")


def _designed(file: Path, axis: "FirstAxis", load: "FirstLoad | None") -> bool:
    """Whether robust shapers were designed for an axis and written; otherwise says why not."""
    name, lengths_m = axis.name, None
    if load and axis.swing:
        times_s = axis.swing.ten_swings_s, load.ten_swings_s[name]
        low_m, high_m = (round(GRAVITY_M_S2 * (0.1 * t / math.tau) ** 2, 2) for t in times_s)
        lengths_m = low_m, high_m
    try:
        from canshaper.commissioning.robust import design_loads, design_robust
        from canshaper.commissioning.robust_report import summary_line, write_design

        deployment = loader(str(file))()
        if load and load.message:
            designs = design_loads(deployment, name, duration_s=None)
            write_design(deployment, *designs)
            deployment = loader(str(file))()
        one = design_robust(deployment, name, lengths_m=lengths_m)
        write_design(deployment, one)
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing not in EXTRAS:
            raise
        echo(f"axis {name}: no robust shaper yet, {missing} is missing: {install_line(missing)}")
    except CanshaperError as error:
        echo(f"axis {name}: no robust shaper yet: {error}")
    else:
        echo(summary_line(one))
        return True
    return False


def _messages(files: Sequence[Path]) -> "list[Message]":
    from canshaper.machine.database import load_dbc

    messages, problems = [], []
    for path in files:
        file, wrong = load_dbc(path)
        problems += wrong
        if file:
            messages += file.messages
            print_warnings(file.count, file.warnings, "left out")
    if problems:
        raise ConfigError(problems)
    return messages


def _write(file: Path, draft: Path, text: str) -> None:
    """Write it when it is a good deployment: read like every other first. Else it stays a draft."""
    from canshaper.machine.binding import load_deployment

    draft.write_text(text, encoding="utf-8")
    try:
        load_deployment(draft)
    except ConfigError as error:
        kept = f"{draft}: kept with all answers; fix it there and rename it to {file}"
        raise UsageError(f"{error}\n{kept}") from None
    draft.replace(file)
