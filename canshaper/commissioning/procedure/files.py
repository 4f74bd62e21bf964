"""Files of the procedure: paths, lock, copies of the deployment; the sheet of a step."""

import fcntl
import io
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.table import Table

from canshaper.edit.edit import Change, change
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.report.console import SafeConsole, new_table

REHEARSAL = ".rehearsal"


@dataclass(frozen=True)
class Files:
    """The files of one procedure, all next to the deployment.

    Attributes:
        deployment: the deployment file that it works on.
    """

    deployment: Path

    def _next(self, ending: str) -> Path:
        return self.deployment.with_name(f"{self.deployment.stem}.commission{ending}")

    @property
    def folder(self) -> Path:
        """Folder of logs, pictures and the report."""
        return self._next("")

    @property
    def state(self) -> Path:
        """File of the state of the procedure."""
        return self._next(".json")

    @property
    def proposal(self) -> Path:
        """Copy of the deployment file with the change that a step proposes."""
        return self._next(".proposal.yaml")

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from working on the same deployment meanwhile.

        Raises:
            UsageError: one does.
        """
        path = self._next(".lock")
        with path.open("a+", encoding="ascii") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                lock.seek(0)
                who = lock.read().strip() or "another one"
                text = f"another commissioning of it is under way, process {who}"
                raise UsageError(f"{self.deployment}: {text}; end it first") from None
            lock.truncate(0)
            lock.write(f"{os.getpid()}\n")
            lock.flush()
            try:
                yield
            finally:
                lock.truncate(0)


def rehearsal_of(path: Path) -> Path:
    """Return the path of the copy that a rehearsal works on; that of a copy is its own."""
    if path.stem.endswith(REHEARSAL):
        return path
    return path.with_name(f"{path.stem}{REHEARSAL}.yaml")


def copy_for_rehearsal(path: Path) -> Path:
    """Return the copy for a rehearsal; make it where there is none yet."""
    copy = rehearsal_of(path)
    if not copy.exists():
        shutil.copyfile(path, copy)
    return copy


def write_without_filters(deployment: Deployment, path: Path) -> None:
    """Write a copy of the deployment file whose joysticks go to the valves through limits alone.

    Args:
        deployment: the machine.
        path: the copy, in the same folder.

    Raises:
        ConfigError: it is no good deployment without them.
    """
    changes: list[Change] = []
    if deployment.config.motion:
        changes.append(((), {"motion": None}, ""))
    for name, joystick in deployment.config.joysticks.items():
        if joystick.next_profile:
            changes.append((("joysticks", name), {"next_profile": None}, ""))
    for name, axis in deployment.config.axes.items():
        if axis.sway_sensor and axis.sway_sensor.use != "watch":
            changes.append((("axes", name, "sway_sensor"), {"use": "watch"}, ""))
        added = [key for key in ("profiles", "gain_schedule") if getattr(axis, key)]
        if added:
            changes.append((("axes", name), dict.fromkeys(added), ""))
        if axis.filter.kind != "off":
            gone: dict[str, Any] = dict.fromkeys(axis.filter.model_dump(exclude_none=True))
            changes.append((("axes", name, "filter"), gone | {"kind": "off"}, ""))
    shutil.copyfile(deployment.path, path)
    change(path, changes)


Part = dict[str, Any]
"""``{"text": lines}``, or ``{"title": words, "columns": heads, "rows": cells}``."""


class Sheet(SafeConsole):
    """A console that shows nothing and keeps what is printed.

    Attributes:
        parts: what was printed, in order.
    """

    def __init__(self) -> None:
        super().__init__(file=io.StringIO(), width=100)
        self.parts: list[Part] = []

    def print(self, *objects: Any, **_options: Any) -> None:
        """Keep lines and tables."""
        for one in objects:
            if isinstance(one, Group):
                self.print(*one.renderables)
            elif isinstance(one, Table):
                rows = zip(*(column.cells for column in one.columns), strict=True)
                self.parts.append(
                    {
                        "title": str(one.title) if one.title else "",
                        "columns": [str(column.header) for column in one.columns],
                        "rows": [[str(cell) for cell in row] for row in rows],
                    }
                )
            else:
                self.parts.append({"text": str(one)})


def shown(part: Part) -> str | Table:
    """Return a part of a sheet, to print it again."""
    if "text" in part:
        return str(part["text"])
    table = new_table(*part["columns"], title=part["title"] or None)
    for row in part["rows"]:
        table.add_row(*row)
    return table
