"""``canshaper init``: a first deployment, by a few questions."""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.answers import NONE, asked, channel, name, number, one, several, whole
from canshaper.cli.common import (
    echo,
    os_errors,
    print_warnings,
)
from canshaper.errors import ConfigError, UsageError
from canshaper.shipped import data_directory

if TYPE_CHECKING:
    from cantools.database.can import Message

    from canshaper.config.first import FirstAxis, FirstJoystick, FirstMachine, Stopwatch

MOST_OFFERED = 6
# Axes that make nothing swing, by their names.
CALM = re.compile(r"lift|rotat|turn|grip|open|close", re.IGNORECASE)
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
    takes what stands in brackets, "-" leaves a thing out. Written with reduced speed and with a
    filter to begin with. Ctrl-C writes nothing; should the check of the whole file find something
    after all, the answers stay in a draft next to it. Machines of J1939 and CANopen begin with a
    copy of the shipped j1939-forwarder.yaml or canopen-forwarder.yaml.

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
    echo(f"\nWritten: {file}, with {len(machine.axes)} axes at reduced speed. What comes next:")
    swinging = next((axis.name for axis in machine.axes if axis.swing), machine.axes[0].name)
    echo(f"  canshaper check {file}")
    if any(axis.swing for axis in machine.axes):
        echo(f"  canshaper robust {file} --axis {swinging} --write   (each axis that swings)")
    echo(f"  canshaper run {file} --listen-only")


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
            "no message has a GenMsgCycleTime, a signal with a symmetrical range (a stick) and"
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
    status, identity = suggest.service_status(messages), suggest.identity(messages)
    return FirstMachine(
        interface,
        bitrate,
        [_relative(path, folder) for path in files],
        joysticks,
        axes,
        status.name if status else None,
        identity.name if identity else None,
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
    for stick in suggest.sticks(message):
        where = f"{message.name}.{stick.name}"
        names = [*taken, *(axis.name for axis in found)]
        likely = suggest.axis_name(stick.name)
        default = f"{joystick.name}_{likely}" if likely in names else likely
        axis = asked(f"Axis of {where}, - for none", name(names), default)
        if axis == NONE:
            continue
        possible = [
            m
            for m in suggest.valves(others, stick.name)
            if FRAMES_PER_TIMEOUT * (m.cycle_time or 0) <= most
        ]
        commands = [f"{m.name}.{s.name}" for m in possible for s in suggest.commands(m)]
        if not commands:
            echo("  no message is left that can command its valve; axis left out")
            continue
        offered = ", ".join(commands[:MOST_OFFERED])
        alike = suggest.likeness(possible[0].name, stick.name) >= suggest.LIKELY
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
        found.append(
            FirstAxis(
                axis,
                joystick.name,
                stick.name,
                command,
                signal,
                timeout,
                suggest.counter(sender),
                status.name if status else None,
                _swing(axis, cycle / 1000.0),
            )
        )
    return found


def _swing(axis: str, period_s: float) -> "Stopwatch | None":
    """Swing of an axis whose valve is commanded every ``period_s``; None where it has none."""
    from canshaper.config.first import Stopwatch
    from canshaper.config.load import limits
    from canshaper.config.sway import Sway

    question = f"  {axis}: does it make the grapple swing"
    if not typer.confirm(question, default=not CALM.search(axis)):
        return None
    seconds = asked("    time of ten full swings, s", number(*_ten_swings_s(period_s)), "23.6")
    first = asked("    how far the first of them goes (any unit)", number(1e-3, 1e6), "20")
    last = asked("    and the one after the tenth", number(1e-3 * first, first), f"{first / 3:.3g}")
    allowed = number(*limits(Sway, "full_speed_m_s"))
    speed = asked("    speed of the tip at full stick, m/s", allowed, "1")
    return Stopwatch(seconds, first, last, speed)


def _ten_swings_s(period_s: float) -> tuple[float, float]:
    """Shortest and longest time of ten swings with which the filter can run at a valve's period."""
    from canshaper.config.first import Stopwatch, ten_swings_s
    from canshaper.config.schema import Limits
    from canshaper.machine.filters import filter_fault

    low, high = ten_swings_s()
    rate = Limits().slowest_per_s
    for tenth in range(round(10.0 * low), round(10.0 * high)):
        watch = Stopwatch(tenth / 10.0, 1.0, 1.0, 1.0)
        if filter_fault(watch.filter, watch.sway, period_s, rate) is None:
            return watch.ten_swings_s, high
    return low, high  # with none at all: the check of the whole file tells why


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
