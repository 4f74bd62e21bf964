"""A step of the procedure, and what comes out of one run of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canshaper.commissioning.procedure.bench import Bench
from canshaper.commissioning.procedure.sheet import Sheet
from canshaper.commissioning.procedure.state import State, Status
from canshaper.machine.deployment import Deployment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILE = "file"
"""Among what a step needs: the deployment file as it is, whichever program has changed it."""


@dataclass(frozen=True)
class Context:
    """What a step works with.

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
        """Of the steps that are done, by their names."""
        steps = self.state.steps.items()
        return {name: one.numbers for name, one in steps if one.status is Status.DONE}


@dataclass
class Outcome:
    """What came out of a run of a step.

    Attributes:
        sheet: its lines and tables.
        numbers: what it measured, of JSON types, by names with units.
        poor: what is missing, each with what to do; a step with one stays open.
        figures: draw its pictures, by the end of their names; empty for a single one.
        files: logs it has written.
        note: what is said of the step once it is done; empty for nothing.
        edit: writes what it proposes into the file of a deployment, and says what a person has to
            know of that; None for nothing.
    """

    sheet: Sheet = field(default_factory=Sheet)
    numbers: dict[str, Any] = field(default_factory=dict)
    poor: list[str] = field(default_factory=list)
    figures: "dict[str, Callable[[], Figure]]" = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    note: str = ""
    edit: Callable[[Deployment], Sequence[str]] | None = None


def _always(_deployment: Deployment) -> bool:
    return True


@dataclass(frozen=True)
class Step:
    """A step.

    Attributes:
        name: one word, as ``--step`` takes it.
        title: what it does, in a few words.
        does: the same in a sentence, for the table of docs/commission.md.
        writes: keys of the file that it may change.
        run: does it.
        needs: steps whose results it uses, or ``FILE``: it is open again when these change.
        applies: whether a deployment has what it is about.
    """

    name: str
    title: str
    does: str
    run: Callable[[Context], Outcome]
    writes: str = ""
    needs: tuple[str, ...] = ()
    applies: Callable[[Deployment], bool] = _always
