"""How far the procedure has come, in one JSON file next to the deployment."""

import json
from dataclasses import asdict, dataclass, field
from datetime import datetime
from enum import StrEnum
from hashlib import sha256
from pathlib import Path
from typing import Any

import canshaper
from canshaper.commissioning.procedure.sheet import Part
from canshaper.errors import UsageError

VERSION = 1


class Status(StrEnum):
    """Of a step."""

    OPEN = "open"
    DONE = "done"
    SKIPPED = "skipped"


@dataclass
class Record:
    """What is kept of a step.

    Attributes:
        status: of the step.
        at: when it was last run, accepted or skipped, in ISO 8601; empty before.
        why: what is said of it: why it is open again, how it was judged.
        parts: what it has shown.
        numbers: what it measured.
        poor: what was missing.
        pictures: files of its picture, in the folder.
        files: its logs, there too.
        diff: what it has written into the deployment file, as a unified diff.
        deployment: SHA-256 of the deployment file as it left it.
        version: of the program.
    """

    status: Status = Status.OPEN
    at: str = ""
    why: str = ""
    parts: list[Part] = field(default_factory=list)
    numbers: dict[str, Any] = field(default_factory=dict)
    poor: list[str] = field(default_factory=list)
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
        """The record of a step."""
        return self.steps.setdefault(name, Record())


def now() -> str:
    """The time as it stands in the file."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def stamped(record: Record) -> Record:
    """The same with time and program of now."""
    record.at, record.version = now(), canshaper.__version__
    return record


def hash_of(path: Path) -> str:
    """SHA-256 of a file."""
    return sha256(path.read_bytes()).hexdigest()


def read_state(path: Path) -> State | None:
    """The state out of its file; None where there is none yet.

    Raises:
        UsageError: it is no such file.
        OSError: it cannot be read.
    """
    if not path.exists():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data.pop("version") != VERSION:
            raise ValueError("another version")
        steps = {
            name: Record(**{**one, "status": Status(one["status"])})
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
