"""``canshaper init``: a first deployment, by a few questions."""

import json
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import typer

from canshaper.cli.common import data_directory, fail

if TYPE_CHECKING:
    from cantools.database.can import Message

    from canshaper.config.first import FirstAxis, FirstLever, FirstMachine, Stopwatch

_T = TypeVar("_T")
NONE = "-"
MOST_OFFERED = 6
# Axes that make nothing swing, by their names.
CALM = re.compile(r"lift|rotat|turn|grip|open|close", re.IGNORECASE)
FEWEST_CYCLES = 5  # of a lever's message in its timeout


def init(
    file: Path = typer.Argument(Path("machine.yaml"), help="Deployment file to write."),
    dbc: list[Path] | None = typer.Option(
        None, "--dbc", help="DBC file of the machine; several with the option again."
    ),
    force: bool = typer.Option(False, "--force", help="Replace a file that is there."),
) -> None:
    """Ask a few questions about a machine and write its first deployment.

    Looks through the DBC files for levers, valves and switches and offers what it finds; Enter
    takes what stands in brackets, "-" leaves a thing out. Written with reduced speed and with a
    filter to begin with. Ctrl-C writes nothing. Machines of J1939 and CANopen begin with a copy of
    the shipped j1939-forwarder.yaml or canopen-forwarder.yaml.

    Examples:

      canshaper init machine.yaml --dbc machine.dbc

      canshaper init     (tries it with the shipped forwarder.dbc)
    """
    from canshaper.config.first import first_deployment
    from canshaper.config.source import DeploymentError

    if file.exists() and not force:
        raise fail(ValueError(f"{file}: is there already; --force replaces it"))
    try:
        messages = _messages(files := dbc or [data_directory() / "dbc" / "forwarder.dbc"])
        machine = _machine(messages, files, file.resolve().parent)
        text = first_deployment(machine)
        _write(file, text)
    except DeploymentError as error:
        raise fail(error) from None
    except OSError as error:
        raise fail(ValueError(f"{error.filename or file}: {error.strerror}")) from None
    typer.echo(
        f"\nWritten: {file}, with {len(machine.axes)} axes at reduced speed. What comes next:"
    )
    swinging = next((axis.name for axis in machine.axes if axis.swing), machine.axes[0].name)
    typer.echo(f"  canshaper check {file}")
    if any(axis.swing for axis in machine.axes):
        typer.echo(f"  canshaper robust {file} --axis {swinging} --write   (each axis that swings)")
    typer.echo(f"  canshaper run {file} --listen-only")


def _messages(files: Sequence[Path]) -> "list[Message]":
    from canshaper.can.database import load_dbc
    from canshaper.config.source import DeploymentError

    found, problems = [], []
    for path in files:
        file, wrong = load_dbc(path)
        problems += wrong
        found += file.database.messages if file else []
    if problems:
        raise DeploymentError(problems)
    return found


def _machine(messages: "list[Message]", files: Sequence[Path], folder: Path) -> "FirstMachine":
    from canshaper.can import suggest
    from canshaper.config.first import FirstMachine

    typer.echo(f"{len(messages)} messages in {', '.join(str(path) for path in files)}.")
    possible = suggest.levers(messages)
    if not possible:
        raise fail(
            ValueError(
                "no message has a GenMsgCycleTime, a signal with a symmetrical range (a stick) and"
                " one of one or two bits (its enable switch); see docs/deployment.md, and"
                " j1939-forwarder.yaml for joysticks with direction flags"
            )
        )
    channel = typer.prompt("CAN interface", default="can0")
    bitrate = _asked("Bit rate, bit/s", _whole(10_000, 1_000_000), "250000")
    names = [message.name for message in possible]
    text = f"Messages of the levers, of {', '.join(names)}"
    likely = [m.name for m in possible if suggest.named(suggest.switches(m), suggest.ENABLE)]
    chosen = _asked(text, _several(names), " ".join(likely or names[:1]))
    levers = [_lever(message) for message in possible if message.name in chosen]
    others = [message for message in messages if message.name not in chosen]
    axes = [
        axis
        for lever, message in zip(levers, (m for m in possible if m.name in chosen), strict=True)
        for axis in _axes(lever, message, others)
    ]
    if not axes:
        raise fail(ValueError("no axis was named; nothing is written"))
    status = suggest.service_status(messages)
    return FirstMachine(
        channel,
        bitrate,
        [_relative(path, folder) for path in files],
        levers,
        axes,
        status.name if status else None,
    )


def _lever(message: "Message") -> "FirstLever":
    from canshaper.can import suggest
    from canshaper.config.first import FirstLever

    switches = [signal.name for signal in suggest.switches(message)]

    def switch(text: str, found: str | None, *, needed: bool = False) -> str | None:
        allowed = switches if needed else [*switches, NONE]
        default = found or (switches[0] if needed else NONE)
        answer = _asked(f"{message.name}: {text}, of {', '.join(allowed)}", _one(allowed), default)
        return None if answer == NONE else answer

    of = suggest.switches(message)
    enable = switch("enable switch", suggest.named(of, suggest.ENABLE), needed=True)
    assert enable is not None
    return FirstLever(
        suggest.axis_name(message.name),
        message.name,
        FEWEST_CYCLES * (message.cycle_time or 0),
        enable,
        switch("switch that resets a trip", suggest.named(of, suggest.RESET)),
        switch("switch for anti-sway off", suggest.named(of, suggest.ANTI_SWAY_OFF)),
        suggest.counter(message),
    )


def _axes(lever: "FirstLever", message: "Message", others: "list[Message]") -> "list[FirstAxis]":
    from canshaper.can import suggest
    from canshaper.config.first import FirstAxis

    found = []
    for stick in suggest.sticks(message):
        where = f"{message.name}.{stick.name}"
        name = _asked(f"Axis of {where}, - for none", _word, suggest.axis_name(stick.name))
        if name == NONE:
            continue
        possible = suggest.valves(others, stick.name)
        commands = [f"{m.name}.{s.name}" for m in possible for s in suggest.commands(m)]
        if not commands:
            typer.echo("  no message is left that can command its valve; axis left out")
            continue
        offered = ", ".join(commands[:MOST_OFFERED])
        likely = suggest.likeness(possible[0].name, stick.name) >= suggest.LIKELY
        text = f"  {name}: valve command, such as {offered}, - for none"
        valve = _asked(text, _one([*commands, NONE]), commands[0] if likely else NONE)
        if valve == NONE:
            continue
        command, _, signal = valve.partition(".")
        sender = next(m for m in possible if m.name == command)
        others.remove(sender)
        cycle = sender.cycle_time or 0
        text = f"  {name}: silence after which the valve closes by itself, ms (its manual)"
        timeout = _asked(text, _whole(max(10, 3 * cycle), 5000), str(max(200, 3 * cycle)))
        status = suggest.status_of(others, name)
        found.append(
            FirstAxis(
                name,
                lever.name,
                stick.name,
                command,
                signal,
                timeout,
                suggest.counter(sender),
                status.name if status else None,
                _swing(name),
            )
        )
    return found


def _swing(name: str) -> "Stopwatch | None":
    from canshaper.config.first import Stopwatch

    if not typer.confirm(
        f"  {name}: does it make the grapple swing", default=not CALM.search(name)
    ):
        return None
    seconds = _asked("    time of ten full swings, s", _number(1.5, 120.0), "23.6")
    first = _asked("    how far the first of them goes (any unit)", _number(1e-3, 1e6), "20")
    last = _asked(
        "    and the one after the tenth", _number(1e-3 * first, first), f"{first / 3:.3g}"
    )
    speed = _asked("    speed of the tip at full stick, m/s", _number(0.05, 20.0), "1")
    return Stopwatch(seconds, first, last, speed)


def _write(file: Path, text: str) -> None:
    """Write it when it is a good deployment: read like every other first."""
    from canshaper.can.binding import load_deployment

    draft = file.with_name(f".{file.name}.draft")
    draft.write_text(text, encoding="utf-8")
    try:
        load_deployment(draft)
        draft.replace(file)
    finally:
        draft.unlink(missing_ok=True)


def _relative(path: Path, folder: Path) -> str:
    name = os.path.relpath(path.resolve(), folder)
    return name if re.fullmatch(r"[\w./-]+", name) else json.dumps(name)  # JSON is YAML too


def _asked(text: str, parse: Callable[[str], _T], default: str) -> _T:
    """Ask until the answer is one."""
    while True:
        try:
            return parse(str(typer.prompt(text, default=default)).strip())
        except ValueError as error:
            typer.echo(f"  {error}", err=True)


def _word(text: str) -> str:
    if text != NONE and not text.isidentifier():
        raise ValueError(f"found {text!r}, allowed is a word of letters, digits and _")
    return text


def _one(allowed: Sequence[str]) -> Callable[[str], str]:
    def parse(text: str) -> str:
        if text not in allowed:
            raise ValueError(f"found {text!r}, allowed is one of {', '.join(allowed)}")
        return text

    return parse


def _several(allowed: Sequence[str]) -> Callable[[str], list[str]]:
    def parse(text: str) -> list[str]:
        names = text.replace(",", " ").split()
        if not names or not {*names} <= {*allowed}:
            raise ValueError(f"found {text!r}, allowed are some of {', '.join(allowed)}")
        return names

    return parse


def _number(low: float, high: float) -> Callable[[str], float]:
    def parse(text: str) -> float:
        fault = f"found {text!r}, allowed is a number, {low:g} to {high:g}"
        try:
            value = float(text)
        except ValueError:
            raise ValueError(fault) from None
        if not low <= value <= high:
            raise ValueError(fault)
        return value

    return parse


def _whole(low: int, high: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise ValueError(f"found {text!r}, allowed is a whole number, {low} to {high}")
        return int(text)

    return parse
