"""``canshaper init``: a first deployment, by a few questions."""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.answers import MOST_OFFERED, NONE, asked, channel, name, one, several, whole
from canshaper.cli.common import EXTRAS, echo, install_line, os_errors, print_warnings
from canshaper.cli.swing_questions import motion_of, slewing_of, swing_of
from canshaper.errors import CanshaperError, ConfigError, UsageError
from canshaper.shipped import data_directory

if TYPE_CHECKING:
    from cantools.database.can import Message

    from canshaper.config.first import FirstAxis, FirstJoystick, FirstMachine

FEWEST_CYCLES = 5  # of a joystick's message in its timeout


def init(
    file: Path = typer.Argument(Path("machine.yaml"), help="Deployment file to write."),
    dbc: list[Path] | None = typer.Option(
        None, "--dbc", help="DBC file of the machine; several with the option again."
    ),
    force: bool = typer.Option(False, "--force", help="Replace a file that is there."),
) -> None:
    """Ask a few questions about a machine and write its first deployment.

    Looks through the DBC files for joysticks, valves and switches and offers what it finds; Enter
    takes what stands in brackets, "-" leaves a thing out. Written with reduced speed, and as we
    recommend: a robust shaper for each axis that swings (without SciPy a G_FF to begin with), slew
    and near-far as one motion. Ctrl-C writes nothing; should the check of the whole file find
    something after all, the answers stay in a draft next to it. Machines of J1939 and CANopen begin
    with a copy of the shipped j1939-forwarder.yaml or canopen-forwarder.yaml.

    Examples:

      canshaper init machine.yaml --dbc machine.dbc

      canshaper init     (tries it with the shipped forwarder.dbc)
    """
    from canshaper.config.first import first_deployment

    draft = file.with_name(f"{file.stem}.draft.yaml")
    for path in (file, draft):
        if path.exists() and not force:
            raise UsageError(f"{path}: is there already; --force replaces it")
    with os_errors(file):
        messages = _messages(files := dbc or [data_directory() / "dbc" / "forwarder.dbc"])
        machine = _machine(messages, files, file.resolve().parent)
        _write(file, draft, first_deployment(machine))
    echo(f"\nWritten: {file}, with {len(machine.axes)} axes at reduced speed.")
    left = [axis.name for axis in machine.axes if axis.swing and not _designed(file, axis.name)]
    echo("What comes next:")
    echo(f"  canshaper check {file}")
    for axis in left:
        echo(f"  canshaper robust {file} --axis {axis} --write")
    echo(f"  canshaper run {file} --listen-only")


def _designed(file: Path, axis: str) -> bool:
    """Whether a robust shaper was designed for an axis and written; otherwise says why not."""
    from canshaper.cli.verbs.robust import design

    try:
        design(str(file), axis, write=True)
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing not in EXTRAS:
            raise
        echo(f"axis {axis}: no robust shaper yet, {missing} is missing: {install_line(missing)}")
    except CanshaperError as error:
        echo(f"axis {axis}: no robust shaper yet: {error}")
    else:
        return True
    return False


def _messages(files: Sequence[Path]) -> "list[Message]":
    from canshaper.machine.database import load_dbc

    found, problems = [], []
    for path in files:
        file, wrong = load_dbc(path)
        problems += wrong
        if file:
            found += file.messages
            print_warnings(file.count, file.warnings, "left out")
    if problems:
        raise ConfigError(problems)
    return found


def _machine(messages: "list[Message]", files: Sequence[Path], folder: Path) -> "FirstMachine":
    from canshaper.config.bus import Bus
    from canshaper.config.first import FirstMachine
    from canshaper.config.load import limits
    from canshaper.machine import suggest

    echo(f"{len(messages)} messages in {', '.join(str(path) for path in files)}.")
    possible = suggest.joysticks(messages)
    if not possible:
        raise UsageError(
            "no message has a GenMsgCycleTime, a signal with a symmetrical range (a joystick) and"
            " one of one or two bits (its enable switch); see docs/deployment.md, and"
            " j1939-forwarder.yaml for joysticks with direction flags"
        )
    interface = asked("CAN interface", channel, "can0")
    bitrate = asked("Bit rate, bit/s", whole(*limits(Bus, "bitrate")), "250000")
    names = [message.name for message in possible]
    text = f"Messages of the joysticks, of {', '.join(names)}"
    likely = [m.name for m in possible if suggest.named(suggest.switches(m), suggest.ENABLE)]
    chosen = asked(text, several(names), " ".join(likely or names[:1]))
    joysticks = [_joystick(message) for message in possible if message.name in chosen]
    others = [message for message in messages if message.name not in chosen]
    axes: list[FirstAxis] = []
    for joystick, message in zip(joysticks, (m for m in possible if m.name in chosen), strict=True):
        axes += _axes(joystick, message, others, [axis.name for axis in axes])
    if not axes:
        raise UsageError("no axis was named; nothing is written")
    motion = motion_of(axes, others)
    status, identity = suggest.service_status(messages), suggest.identity(messages)
    return FirstMachine(
        interface,
        bitrate,
        [_relative(path, folder) for path in files],
        joysticks,
        axes,
        status.name if status else None,
        identity.name if identity else None,
        motion,
    )


def _joystick(message: "Message") -> "FirstJoystick":
    from canshaper.config.first import FirstJoystick
    from canshaper.config.load import limits
    from canshaper.config.schema import Joystick
    from canshaper.machine import suggest

    left = suggest.switches(message)  # a switch has one meaning

    def switch(text: str, looks: re.Pattern[str], *, needed: bool = False) -> str | None:
        allowed = [signal.name for signal in left] + ([] if needed else [NONE])
        default = suggest.named(left, looks) or (allowed[0] if needed else NONE)
        answer = asked(f"{message.name}: {text}, of {', '.join(allowed)}", one(allowed), default)
        left[:] = [signal for signal in left if signal.name != answer]
        return None if answer == NONE else answer

    enable = switch("enable switch", suggest.ENABLE, needed=True)
    assert enable is not None
    least, most = limits(Joystick, "timeout_ms")
    reset = switch("switch that resets a trip", suggest.RESET)
    off = switch("switch for anti-sway off", suggest.ANTI_SWAY_OFF)
    counter = suggest.counter(message)
    return FirstJoystick(
        suggest.axis_name(message.name),
        message.name,
        int(min(max(FEWEST_CYCLES * (message.cycle_time or 0), least), most)),
        enable,
        reset,
        off,
        None if counter in (enable, reset, off) else counter,
    )


def _axes(
    joystick: "FirstJoystick", message: "Message", others: "list[Message]", taken: list[str]
) -> "list[FirstAxis]":
    """Axes of a joystick; ``others`` are messages that are left, ``taken`` names that are not."""
    from canshaper.config.first import FirstAxis
    from canshaper.config.load import limits
    from canshaper.config.schema import Valve
    from canshaper.machine import suggest
    from canshaper.machine.valves import FRAMES_PER_TIMEOUT

    least, most = (int(ms) for ms in limits(Valve, "timeout_ms"))
    found: list[FirstAxis] = []
    for command_signal in suggest.axes(message):
        where = f"{message.name}.{command_signal.name}"
        names = [*taken, *(axis.name for axis in found)]
        likely = suggest.axis_name(command_signal.name)
        default = f"{joystick.name}_{likely}" if likely in names else likely
        axis = asked(f"Axis of {where}, - for none", name(names), default)
        if axis == NONE:
            continue
        possible = [
            m
            for m in suggest.valves(others, command_signal.name)
            if FRAMES_PER_TIMEOUT * (m.cycle_time or 0) <= most
        ]
        commands = [f"{m.name}.{s.name}" for m in possible for s in suggest.commands(m)]
        if not commands:
            echo("  no message is left that can command its valve; axis left out")
            continue
        offered = ", ".join(commands[:MOST_OFFERED])
        alike = suggest.likeness(possible[0].name, command_signal.name) >= suggest.LIKELY
        text = f"  {axis}: valve command, such as {offered}, - for none"
        valve = asked(text, one([*commands, NONE]), commands[0] if alike else NONE)
        if valve == NONE:
            continue
        command, _, signal = valve.partition(".")
        sender = next(m for m in possible if m.name == command)
        others.remove(sender)
        cycle = sender.cycle_time or 0
        shortest = max(least, FRAMES_PER_TIMEOUT * cycle)
        text = f"  {axis}: silence after which the valve closes by itself, ms (its manual)"
        timeout = asked(text, whole(shortest, most), str(max(200, shortest)))
        status = suggest.status_of(others, axis)
        swing = swing_of(axis, cycle / 1000.0)
        found.append(
            FirstAxis(
                axis,
                joystick.name,
                command_signal.name,
                command,
                signal,
                timeout,
                suggest.counter(sender),
                status.name if status else None,
                swing,
                slewing_of(axis) if swing else None,
            )
        )
    return found


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


def _relative(path: Path, folder: Path) -> str:
    return os.path.relpath(path.resolve(), folder)
