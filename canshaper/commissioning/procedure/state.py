"""How far the procedure has come, in one JSON file; the interface of its steps."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime
from enum import StrEnum
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import canshaper
from canshaper.commissioning.procedure.bench import Bench
from canshaper.commissioning.procedure.files import Part, Sheet
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment

if TYPE_CHECKING:
    from matplotlib.figure import Figure


VERSION = 1


class Status(StrEnum):
    """Status of a step."""

    OPEN = "open"
    DONE = "done"
    SKIPPED = "skipped"


@dataclass
class Record:
    """Record of a step in the state file.

    Attributes:
        at: time of the last run, acceptance or skip, ISO 8601; empty before.
        why: why it is open again, or how it was judged.
        parts: lines and tables that it has shown.
        numbers: what it measured.
        problems: what is missing, each with what to do.
        pictures: files of its picture, in the folder.
        files: its logs, there too.
        diff: its change of the deployment file, as a unified diff.
        deployment: SHA-256 of the deployment file as it left it.
        version: of the program.
    """

    status: Status = Status.OPEN
    at: str = ""
    why: str = ""
    parts: list[Part] = field(default_factory=list)
    numbers: dict[str, Any] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    diff: str = ""
    deployment: str = ""
    version: str = ""


@dataclass
class State:
    """All steps of one deployment file.

    Attributes:
        simulated: whether it is a rehearsal.
        changes: parameters of the simulated crane, NAME=VALUE.
        origin: SHA-256 of the file that a rehearsal is a copy of; empty for a machine.
        left: SHA-256 of the deployment file as the last step left it; empty before the first.
        steps: by name.
    """

    simulated: bool = False
    changes: list[str] = field(default_factory=list)
    origin: str = ""
    left: str = ""
    steps: dict[str, Record] = field(default_factory=dict)

    def of(self, name: str) -> Record:
        """Return the record of a step; an empty one before it ran."""
        return self.steps.setdefault(name, Record())


def now() -> str:
    """Return the time now, as the state file has it."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def stamped(record: Record) -> Record:
    """Give the record the time and the program version of now; return it."""
    record.at, record.version = now(), canshaper.__version__
    return record


def hash_of(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return sha256(path.read_bytes()).hexdigest()


def read_state(path: Path) -> State | None:
    """Read the state from its file; None where there is none yet.

    Raises:
        UsageError: the file is no state of a commissioning.
        OSError: it cannot be read.
    """
    if not path.exists():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data.pop("version") != VERSION:
            raise ValueError("another version")
        steps = {
            # An older program has called the problems poor.
            name: Record(
                **{"problems": one.pop("poor", []), **one, "status": Status(one["status"])}
            )
            for name, one in data.pop("steps").items()
        }
        return State(**data, steps=steps)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        text = "expected the state of a commissioning, got something else"
        raise UsageError(f"{path}: {text} ({error}); move it away to begin again") from None


def write_state(path: Path, state: State) -> None:
    """Write the state, all or nothing."""
    draft = path.with_name(f".{path.name}.new")
    draft.write_text(
        json.dumps({"version": VERSION, **asdict(state)}, indent=2) + "\n", encoding="utf-8"
    )
    draft.replace(path)


FILE = "file"
"""In ``Step.needs``: the deployment file, whichever program changes it."""


@dataclass(frozen=True)
class Context:
    """Surroundings of a step: machine, bench, folder, state.

    Attributes:
        deployment: the machine, as its file is now; the bus options of the command are in it.
        bench: where it is measured.
        folder: for logs and pictures.
        state: of all steps.
    """

    deployment: Deployment
    bench: Bench
    folder: Path
    state: State

    @property
    def numbers(self) -> dict[str, Mapping[str, Any]]:
        """Numbers of the steps that are done, by name of the step."""
        steps = self.state.steps.items()
        return {name: one.numbers for name, one in steps if one.status is Status.DONE}


@dataclass
class Outcome:
    """Result of a run of a step.

    Attributes:
        sheet: its lines and tables.
        numbers: what it measured, of JSON types, by names with units.
        problems: what is missing, each with what to do; a step with one stays open.
        figures: functions that draw its pictures, by the end of their names; "" for a single one.
        files: logs it has written.
        note: remark on the step once it is done; empty for none.
        edit: function that writes its proposal into the file of a deployment, and returns notes on
            that for the person; None for no proposal.

    The procedure adds:

    Attributes:
        step: name of the step.
        pictures: files of its pictures.
        before: SHA-256 of the deployment file that it was computed from.
        diff: what would be written into that file; empty for nothing.
        text: that file with what it would write.
    """

    sheet: Sheet = field(default_factory=Sheet)
    numbers: dict[str, Any] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    figures: "dict[str, Callable[[], Figure]]" = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    note: str = ""
    edit: Callable[[Deployment], Sequence[str] | None] | None = None
    step: str = ""
    pictures: list[Path] = field(default_factory=list)
    before: str = ""
    diff: str = ""
    text: bytes = b""


@dataclass(frozen=True)
class Step:
    """A step.

    Attributes:
        name: one word, as ``--step`` takes it.
        title: what it does, in a few words.
        does: the same in a sentence, for the table of docs/commission.md.
        writes: keys of the file that it may change.
        run: does it.
        needs: steps whose results it uses, or ``FILE``; when one changes, it is open again.
        applies: whether a deployment has this step.
    """

    name: str
    title: str
    does: str
    run: Callable[[Context], Outcome]
    writes: str = ""
    needs: tuple[str, ...] = ()
    applies: Callable[[Deployment], object] = lambda _deployment: True
