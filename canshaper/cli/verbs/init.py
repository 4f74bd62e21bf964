"""``canshaper init``: write a first deployment file from the answers to a few questions."""

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
        None, "--dbc", help="DBC file of the machine; repeatable."
    ),
    eds: list[Path] | None = typer.Option(
        None, "--eds", help="EDS or DCF file of a CANopen node; once for each node."
    ),
    interface: str = typer.Option("socketcan", "--interface", help="python-can interface."),
    set_by_sdo: bool = typer.Option(
        False, "--set-by-sdo", help="Write the parameters into the nodes; asks first on a real bus."
    ),
    force: bool = typer.Option(False, "--force", help="Replace an existing file."),
    answers: Path | None = typer.Option(
        None, "--answers", metavar="FILE", help="Ask nothing: lines of QUESTION = ANSWER."
    ),
) -> None:
    """Ask a few questions about a machine and write its first deployment.

    It looks for joysticks, valves and switches in the DBC files and shows the whole machine as a
    proposal. If you do not accept it, or something is missing, it asks the questions one by one.
    Enter takes the answer in brackets; "-" leaves a thing out. It asks for facts that the DBC does
    not state: full deflection, value in the middle, direction by flags or by a second signal. A
    switch may be one bit of a signal, as SIGNAL/BIT.

    If a signal says that a log is gripped, the axes get a filter for the empty grapple and one for
    the log; without such a signal one response may hold for both.

    The file has reduced speed. Each axis that swings gets a robust shaper (without SciPy a G_FF for
    a start). Slew and near-far become one motion, which is off until the step motion of commission
    is done. Numbers that init has guessed are listed under assumed, but for those with a log.

    Ctrl-C writes nothing. If the check of the whole file finds a fault, such as a missing enable
    switch, the answers are kept in a draft next to it. For a J1939 machine begin with a copy of the
    shipped j1939-forwarder.yaml.

    With --eds it reads CANopen nodes from their makers' files: mapping of the PDOs, event timers,
    heartbeats. It writes them as a DBC file next to the deployment. It lists the parameters that
    have to be set in a node; with --set-by-sdo it writes them: it reads each object, sets it, and
    reads it again.

    With --answers it asks nothing. Each line of that file is QUESTION = ANSWER. A question is given
    by its first words, that of an axis with its name first, such as "slew: time of ten full swings
    = 24.1". A question of yes or no is answered by yes or no. "#" begins a comment. A question
    without a line is answered as by Enter.

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
    """Return whether to write the parameters, if any; on a real bus ask the person first."""
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
    """Design and write robust shapers for an axis; return whether it worked, else print why not."""
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
    """Write the text as a draft and load it; rename it to the file only if it is valid.

    A draft with a fault is kept and raises a UsageError.
    """
    from canshaper.machine.binding import load_deployment

    draft.write_text(text, encoding="utf-8")
    try:
        load_deployment(draft)
    except ConfigError as error:
        kept = f"{draft}: kept with all answers; fix it there and rename it to {file}"
        raise UsageError(f"{error}\n{kept}") from None
    draft.replace(file)
