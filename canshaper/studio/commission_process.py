"""The steps of the commissioning for the page, in a process of its own.

A line of JSON on stdin is a request with the arguments of ``work``; a line on stdout answers.
"""

import json
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from canshaper.commissioning.procedure.bench import Simulated, check_rehearsal
from canshaper.commissioning.procedure.files import Files, copy_for_rehearsal, rehearsal_of
from canshaper.commissioning.procedure.procedure import STEPS, Procedure
from canshaper.commissioning.procedure.state import Outcome, State, read_state
from canshaper.commissioning.procedure.steps.check import NAME as REPORT
from canshaper.errors import CanshaperError, UsageError
from canshaper.machine.binding import load_deployment
from canshaper.report.console import OnProgress

NICE = 10  # the cranes of the live page go first
# The last results, not accepted yet.
_proposals: dict[Path, Outcome] = {}
_CHOICE = ("offered", "recommended", "chosen")  # numbers of a step that asks for one


class Reader:
    """The person in front of the page, who answers ``word`` and sees no progress bar."""

    def __init__(self, word: str = "") -> None:
        self._word = word

    def ready(self, words: str) -> None:
        """Return at once: at the desk nobody has to get ready."""

    def answer(self, _question: str, default: str, allowed: Sequence[str] = ()) -> str:
        """Return the person's answer if the question allows it, else the default."""
        return self._word if self._word in allowed else default

    @contextmanager
    def progress(self, _what: str) -> Iterator[OnProgress]:
        """Give a function that shows no progress."""

        def unseen(done: float, what: str | None = None) -> None:
            pass

        yield unseen


def work(
    what: str, path: Path, changes: list[str], step: str, *, machine: bool, answer: str = ""
) -> dict[str, Any]:
    """Do a request of the page; return the state, also after an error.

    Args:
        what: ``show``, ``run``, ``accept`` or ``skip``.
        path: the deployment file; a rehearsal works on a copy in its directory.
        changes: parameters of the simulated crane, NAME=VALUE; none: those of the last rehearsal.
        step: name of the step; empty to show.
        machine: show the commissioning of the machine; else its rehearsal.
        answer: answer to a question of the step.

    Returns:
        The state for the page; ``error`` says why the request was not done, "" if it was.
    """
    error, news = "", ""
    try:
        if what != "show":
            with _procedure(path, changes, answer) as procedure:
                _do(procedure, path, what, step)
                news = "; ".join(procedure.news)
        return {**_shown(path, changes, machine=machine), "error": "", "news": news}
    except (CanshaperError, OSError) as fault:
        error = str(fault)
    try:
        return {**_shown(path, changes, machine=machine), "error": error, "news": news}
    except (CanshaperError, OSError):
        return {"file": path.name, "steps": [], "error": error, "news": news}


@contextmanager
def _procedure(path: Path, changes: list[str], answer: str) -> Iterator[Procedure]:
    """Open the rehearsal of a file, on a copy made if missing; lock it for other processes."""
    check_rehearsal(load_deployment(path))  # messages name this file, not the copy
    files = Files(copy_for_rehearsal(path))
    with files.locked():
        state = read_state(files.state)
        bench = Simulated(Reader(answer), changes or (state.changes if state else []))
        yield Procedure(files, bench, load_deployment, origin=path)


def _do(procedure: Procedure, path: Path, what: str, name: str) -> None:
    proposal = _proposals.pop(path, None)
    step = procedure.step(name)
    if what == "run":
        _proposals[path] = procedure.run(step)
    elif what == "skip":
        procedure.skip(step)
    elif proposal and proposal.step == name:
        procedure.accept(proposal)
    else:
        raise UsageError(f"{name}: nothing to accept; run it first")


def _shown(path: Path, changes: list[str], *, machine: bool) -> dict[str, Any]:
    """Return progress of the steps that apply, and the proposal of the last run if still open."""
    files = Files(path if machine else rehearsal_of(path))
    state = read_state(files.state) or State(changes=changes)
    deployment = load_deployment(path)
    proposal = _proposals.get(path)
    steps = []
    for step in STEPS:
        if not step.applies(deployment):
            continue
        record = state.of(step.name)
        proposed = proposal if proposal and proposal.step == step.name else None
        steps.append(
            {
                "name": step.name,
                "title": step.title,
                "status": record.status.value,
                "at": record.at,
                "why": record.why,
                "parts": record.parts,
                "problems": record.problems,
                "pictures": [name for name in record.pictures if name.endswith(".png")],
                "choice": {key: record.numbers.get(key) for key in _CHOICE},
                "diff": proposed.diff if proposed else record.diff,
                "proposed": bool(proposed) and not record.problems,
            }
        )
    report = f"{REPORT}.html"
    return {
        "file": files.deployment.name,
        "folder": str(files.folder),
        "crane": " ".join(state.changes),
        "report": report if (files.folder / report).is_file() else "",
        "steps": steps,
    }


def main() -> None:
    """Answer requests until stdin ends; ignore Ctrl-C, on which the server ends this process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICE)
    answers, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        about = json.loads(line)
        print(json.dumps(work(**{**about, "path": Path(about["path"])})), file=answers, flush=True)


if __name__ == "__main__":
    main()
