"""Where the procedure keeps what it makes, and who may work on it."""

import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from canshaper.errors import UsageError


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
        """Logs, pictures and the report."""
        return self._next("")

    @property
    def state(self) -> Path:
        """How far it has come."""
        return self._next(".json")

    @property
    def proposal(self) -> Path:
        """A copy of the deployment file with what a step would write."""
        return self._next(".proposal.yaml")

    @contextmanager
    def locked(self) -> Iterator[None]:
        """No other process works on it meanwhile.

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
    """Name of the copy that a rehearsal works on."""
    return path.with_name(f"{path.stem}.rehearsal.yaml")


def copy_for_rehearsal(path: Path) -> Path:
    """The copy, which is made where it is not there yet."""
    copy = rehearsal_of(path)
    if not copy.exists():
        shutil.copyfile(path, copy)
    return copy
