"""The procedure: it runs steps, keeps their state, and writes what a person has accepted."""

from collections.abc import Callable
from contextlib import suppress
from difflib import unified_diff
from pathlib import Path

from canshaper.commissioning.procedure.bench import Bench
from canshaper.commissioning.procedure.files import Files
from canshaper.commissioning.procedure.state import (
    FILE,
    Context,
    Outcome,
    Record,
    State,
    Status,
    Step,
    hash_of,
    read_state,
    stamped,
    write_state,
)
from canshaper.commissioning.procedure.steps.check import CHECK, REPORT
from canshaper.commissioning.procedure.steps.drive import DRIVE
from canshaper.commissioning.procedure.steps.filter import FILTER
from canshaper.commissioning.procedure.steps.joysticks import BUSES, JOYSTICKS
from canshaper.commissioning.procedure.steps.motion import DRY, FIRST_MOTION
from canshaper.commissioning.procedure.steps.swing import SWING
from canshaper.commissioning.procedure.steps.valve import SENSOR, VALVE
from canshaper.edit.edit import replace_text
from canshaper.errors import BusError, CanshaperError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.report.style import draw

STEPS: tuple[Step, ...] = (
    BUSES,
    JOYSTICKS,
    SWING,
    VALVE,
    FILTER,
    SENSOR,
    CHECK,
    DRY,
    FIRST_MOTION,
    DRIVE,
    REPORT,
)
"""The steps of a day of commissioning, in order."""


class Procedure:
    """The steps of one deployment, under its lock (``Files.locked``).

    Args:
        files: of the deployment.
        bench: where it is measured.
        load: reads the deployment of a path, with the bus options of the command.
        origin: the file that a rehearsal's is a copy of.

    Attributes:
        state: how far it has come.
        news: what a person has to know before the next step.

    Raises:
        ConfigError: the deployment file is no good one.
        UsageError: the state file is damaged, or of another machine or simulated crane.
    """

    def __init__(
        self,
        files: Files,
        bench: Bench,
        load: Callable[[Path], Deployment],
        origin: Path | None = None,
    ) -> None:
        self.files, self._bench, self._load = files, bench, load
        self.news: list[str] = []
        deployment = load(files.deployment)
        self.steps = [step for step in STEPS if step.applies(deployment)]
        new = State(bench.simulated, bench.changes, hash_of(origin) if origin else "")
        self.state = read_state(files.state) or new
        self._check_bench()
        if origin not in (None, files.deployment) and hash_of(origin) != self.state.origin:
            remedy = f"to rehearse it as it is now, move {files.deployment} and {files.state} away"
            self.news.append(f"{origin} was changed since the copy was made; {remedy}")
        files.folder.mkdir(parents=True, exist_ok=True)
        self._notice_changes()

    def _check_bench(self) -> None:
        """Check that the state is of the same machine, or of the same simulated crane."""
        state, bench, path = self.state, self._bench, self.files.state
        remedy = "move it away to begin again"
        if state.simulated != bench.simulated:
            kinds = {True: "a rehearsal", False: "a machine"}
            text = f"expected the state of {kinds[bench.simulated]}"
            raise UsageError(f"{path}: {text}, got that of {kinds[state.simulated]}; {remedy}")
        if state.changes != bench.changes:
            was, now = (
                " ".join(one) or "the nominal one" for one in (state.changes, bench.changes)
            )
            raise UsageError(f"{path}: --set: expected the crane {was}, got {now}; {remedy}")

    # -- what is there -------------------------------------------------------------------------

    def step(self, name: str) -> Step:
        """Return the step with this name.

        Raises:
            UsageError: there is none, or this deployment has none.
        """
        for one in self.steps:
            if one.name == name:
                return one
        names = ", ".join(one.name for one in self.steps)
        raise UsageError(f"--step: expected one of {names}, got {name!r}")

    def next_open(self) -> Step | None:
        """Return the first step that is open; None where all are done or skipped."""
        return next((s for s in self.steps if self.state.of(s.name).status is Status.OPEN), None)

    # -- one step ------------------------------------------------------------------------------

    def run(self, step: Step) -> Outcome:
        """Run a step; return its results and what it would write into the deployment file.

        Only logs, pictures and the state are written yet; the step is open. Missing data is no
        error but a problem of the outcome.

        Raises:
            ConfigError: the deployment file is no good one.
            BusError: a bus cannot be opened.
            OSError: a file cannot be written.
        """
        self._notice_changes()
        outcome, before = Outcome(), hash_of(self.files.deployment)
        deployment = self._load(self.files.deployment)
        context = Context(deployment, self._bench, self.files.folder, self.state)
        try:
            outcome = step.run(context)
            for part, figure in outcome.figures.items():
                name = f"{step.name}-{part}" if part else step.name
                outcome.pictures += draw(figure, self.files.folder / name, deployment)
            if outcome.edit and not outcome.problems:
                self._propose(outcome)
        except BusError:
            raise
        except CanshaperError as error:
            outcome.problems.append(
                str(error).replace(str(self.files.proposal), str(deployment.path))
            )
        outcome.step, outcome.before = step.name, before
        self._keep(outcome, Status.OPEN, why="; ".join(outcome.problems) or "not accepted yet")
        return outcome

    def accept(self, outcome: Outcome) -> None:
        """Write what a step proposes; it is done. A change of the file opens the steps that use it.

        Raises:
            UsageError: the outcome has problems, or the file was changed meanwhile; the step stays
                open.
            OSError: a file cannot be written.
        """
        if outcome.problems:
            raise UsageError(f"{outcome.step}: {'; '.join(outcome.problems)}")
        path = self.files.deployment
        if hash_of(path) != outcome.before:
            self._notice_changes()
            text = "was changed by someone else meanwhile; nothing was written, do the step again"
            raise UsageError(f"{path}: {text}")
        if outcome.diff:
            replace_text(path, outcome.text.decode())
            self.state.left = hash_of(path)
        self._keep(outcome, Status.DONE, why=outcome.note)
        if outcome.diff:
            name = outcome.step
            self._reopen({name, FILE}, f"{name} has changed the file")
        self._save()

    def skip(self, step: Step) -> None:
        """Leave a step out; what it has shown stays in the state."""
        record = stamped(self.state.of(step.name))
        record.status, record.why = Status.SKIPPED, "left out"
        self._save()

    # -- parts ---------------------------------------------------------------------------------

    def _propose(self, outcome: Outcome) -> None:
        """Let the step write into a copy of the file, and note what that changes."""
        assert outcome.edit
        path, copy = self.files.deployment, self.files.proposal
        before = path.read_bytes()
        copy.write_bytes(before)
        copy.chmod(path.stat().st_mode)
        try:
            notes = outcome.edit(self._load(copy)) or ()
            outcome.sheet.parts += [{"text": note} for note in notes]
            outcome.text = copy.read_bytes()
        finally:
            with suppress(OSError):
                copy.unlink()
        names = f"{path.name} (now)", f"{path.name} (then)"
        lines = unified_diff(
            before.decode().splitlines(), outcome.text.decode().splitlines(), *names, lineterm=""
        )
        outcome.diff = "\n".join(lines)

    def _keep(self, outcome: Outcome, status: Status, why: str = "") -> None:
        done = status is Status.DONE
        record = Record(
            status,
            why=why,
            parts=outcome.sheet.parts,
            numbers=outcome.numbers,
            problems=outcome.problems,
            pictures=[path.name for path in outcome.pictures],
            files=[path.name for path in outcome.files],
            diff=outcome.diff if done else "",
            deployment=hash_of(self.files.deployment),
        )
        self.state.steps[outcome.step] = stamped(record)
        self._save()

    def _save(self) -> None:
        write_state(self.files.state, self.state)

    def _reopen(self, changed: set[str], why: str) -> None:
        """Open the steps again that need something that has changed: steps, or the file."""
        for step in self.steps:
            record = self.state.of(step.name)
            if step.name not in changed and changed & {*step.needs}:
                changed.add(step.name)
                if record.status is Status.DONE:
                    record.status, record.why = Status.OPEN, why

    def _notice_changes(self) -> None:
        """Note that another program has changed the file: the steps that need it are open again."""
        now = hash_of(self.files.deployment)
        if self.state.left and self.state.left != now:
            why = f"{self.files.deployment.name} was changed by another program"
            self._reopen({FILE}, why)
            self.news.append(f"{why} since the last step; it is checked again, nothing is lost")
        self.state.left = now
        write_state(self.files.state, self.state)
