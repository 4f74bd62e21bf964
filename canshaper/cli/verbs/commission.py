"""``canshaper commission``: the steps of commissioning, in order."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import (
    CHANNEL,
    FILE,
    INTERFACE,
    NETWORK,
    SET,
    echo,
    loader,
    os_errors,
    refuse_shipped,
)
from canshaper.cli.interview.answers import answered_by, ask, one
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from canshaper.commissioning.procedure.bench import Bench
    from canshaper.commissioning.procedure.files import Files
    from canshaper.commissioning.procedure.procedure import Procedure
    from canshaper.commissioning.procedure.state import Outcome, Step
    from canshaper.machine.deployment import Deployment
    from canshaper.report.console import OnProgress

GROUP = "setup"

EXIT_OPEN = 1
YES, AGAIN, SKIP, STOP = "yes", "again", "skip", "stop"


def commission(
    file: str = FILE,
    step: str | None = typer.Option(None, "--step", metavar="NAME", help="Repeat this step."),
    listed: bool = typer.Option(False, "--list", help="Show the status of each step, and exit."),
    simulated: bool = typer.Option(
        False,
        "--simulated",
        help="Rehearse at the desk, on a simulated crane, with a copy of FILE.",
    ),
    yes: bool = typer.Option(False, "--yes", help="Accept every step that has enough data."),
    answers: Path | None = typer.Option(
        None, "--answers", metavar="FILE", help="Ask nothing: lines of QUESTION = ANSWER."
    ),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    network: bool = NETWORK,
    changes: list[str] | None = SET,
) -> None:
    """Lead through the commissioning of a machine, step by step, to a report that is signed.

    Each step says what to do, and shows its numbers, its picture and what it would write into FILE.
    It writes nothing before you answer yes. The progress is kept in FILE.commission.json: the same
    command continues at the first open step. Logs, pictures and the report are in FILE.commission/.

    With --simulated it simulates a crane, which --set may change, and opens no bus. It works on
    FILE.rehearsal.yaml, a copy that it makes the first time: no measurement at the desk gets into
    FILE.

    Ctrl-C ends it at any time, with neutral valves; finished steps stay finished. Exit code 1 when
    a step stays open, 2 when a file or an option is wrong, 3 when a bus cannot be opened.

    Examples:

      canshaper commission machine.yaml

      canshaper commission machine.yaml --simulated --set grapple.l2_m=1.55

      canshaper commission machine.yaml --step swing

      canshaper commission machine.yaml --list
    """
    from canshaper.commissioning.procedure.bench import check_rehearsal
    from canshaper.commissioning.procedure.files import Files, copy_for_rehearsal, rehearsal_of
    from canshaper_sim.parameters import changed_parameters

    refuse_shipped(file)
    path = Path(file)
    if changes and not simulated:
        raise UsageError("--set: expected --simulated too, got none")
    work = path
    if simulated:
        origin = loader(file)()
        check_rehearsal(origin)  # its faults name FILE, not the copy
        changed_parameters(changes or [], origin)
        work = rehearsal_of(path) if listed else copy_for_rehearsal(path)
    files = Files(work)

    def load(one: Path) -> "Deployment":
        return loader(str(one), interface, channel, network=network)()

    if listed:
        _list(files, load)
        return
    with os_errors(files.state), files.locked():
        words = _words(interface, channel, network=network)
        bench = _bench(files, words, changes or [], simulated=simulated)
        with answered_by(answers, yes=yes):
            _lead(_procedure(files, bench, load, path), step)


def _words(interface: str | None, channels: list[str] | None, *, network: bool) -> list[str]:
    """Return the bus options as words of a command line of ``canshaper run``."""
    words = ["--interface", interface] if interface else []
    words += [word for channel in channels or [] for word in ("--channel", channel)]
    return [*words, *(["--network"] if network else [])]


def _bench(files: "Files", words: list[str], changes: list[str], *, simulated: bool) -> "Bench":
    """Return the bench: the machine, or a simulated crane.

    Args:
        files: files of the procedure.
        words: bus options with which the daemon of the machine is started.
        changes: how the simulated crane differs; empty: as when the rehearsal began.
        simulated: whether this is a rehearsal.
    """
    from canshaper.commissioning.procedure.bench import Simulated
    from canshaper.commissioning.procedure.machine import Machine
    from canshaper.commissioning.procedure.state import read_state

    if not simulated:
        return Machine(Prompts(), words)
    state = read_state(files.state)
    return Simulated(Prompts(), changes or (state.changes if state else []))


def _procedure(
    files: "Files", bench: "Bench", load: Callable[[Path], "Deployment"], path: Path
) -> "Procedure":
    """Return the procedure; for a rehearsal, print that it is one."""
    from canshaper.commissioning.procedure.procedure import Procedure

    procedure = Procedure(files, bench, load, origin=path if bench.simulated else None)
    if bench.simulated:
        echo(f"REHEARSAL on a simulated crane, with {files.deployment}, a copy of {path}")
    return procedure


def _list(files: "Files", load: Callable[[Path], "Deployment"]) -> None:
    """Print the status of every step that this machine has."""
    from canshaper.commissioning.procedure.procedure import STEPS
    from canshaper.commissioning.procedure.state import State, read_state
    from canshaper.report.console import SafeConsole, new_table

    state = read_state(files.state) or State()
    deployment = load(files.deployment)
    table = new_table("step", "is", "at")
    for step in STEPS:
        if step.applies(deployment):
            record = state.of(step.name)
            table.add_row(f"{step.name}: {step.title}", record.status.value, record.at or "-")
    SafeConsole().print(table)


def _lead(procedure: "Procedure", name: str | None) -> None:
    """Lead through the step of that name, or through every open step; say if all are done."""
    step = procedure.step(name) if name else procedure.next_open()
    while step:
        _one(procedure, step)
        step = None if name else procedure.next_open()
    if procedure.next_open() is None:
        echo(f"All steps are done: {procedure.files.state}")


def _one(procedure: "Procedure", step: "Step") -> None:
    """Run one step, again on demand, until the person accepts or skips it.

    Raises:
        typer.Exit: the person stops; the step stays open.
    """
    number = procedure.steps.index(step) + 1
    while True:
        echo(f"\n[{number}/{len(procedure.steps)}] {step.name}: {step.title}")
        outcome = procedure.run(step)
        while procedure.news:
            echo(f"NOTE: {procedure.news.pop(0)}")
        _show(procedure, outcome)
        choices = (AGAIN, SKIP, STOP) if outcome.problems else (YES, AGAIN, SKIP, STOP)
        what = "accept" if not outcome.problems else "not enough data"
        default = STOP if outcome.problems else YES
        answer = ask(f"{step.name}: {what} ({', '.join(choices)})", one(choices), default)
        if answer == YES:
            procedure.accept(outcome)
        elif answer == SKIP:
            procedure.skip(step)
        elif answer == AGAIN:
            continue
        else:
            echo(f"{step.name} stays open; the same command goes on with it")
            raise typer.Exit(EXIT_OPEN)
        return


def _show(procedure: "Procedure", outcome: "Outcome") -> None:
    """Print the results of a step, and the change that it would make to the file."""
    from canshaper.commissioning.procedure.files import shown
    from canshaper.report.console import SafeConsole

    console = SafeConsole(soft_wrap=True)
    for part in outcome.sheet.parts:
        console.print(shown(part))
    for picture in outcome.pictures:
        if picture.suffix == ".png":
            echo(f"Picture: {picture}")
    for fault in outcome.problems:
        echo(f"NOT ENOUGH DATA: {fault}")
    if outcome.diff:
        echo(f"It would write into {procedure.files.deployment}:\n{outcome.diff}")
    elif not outcome.problems:
        echo(f"{procedure.files.deployment} stays as it is.")


class Prompts:
    """Prompts of the steps; with ``--yes`` or ``--answers`` they do not wait."""

    def ready(self, words: str) -> None:
        """Print an instruction, and wait for Enter."""
        echo(f"\n  {words}")
        ask("Enter begins", str, "")

    def answer(self, question: str, default: str, allowed: Sequence[str] = ()) -> str:
        """Ask until the answer is one of the allowed words; without any, every word is."""
        return ask(question, one(allowed) if allowed else str, default)

    @contextmanager
    def progress(self, what: str) -> Iterator["OnProgress"]:
        """Show a bar on the terminal; yield the function that moves it."""
        from canshaper.report.console import progress_bar

        with progress_bar(what) as on_progress:
            yield on_progress
