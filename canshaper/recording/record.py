"""Every frame of the buses into a log, and what the status messages reported meanwhile."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from canshaper.machine.deployment import Deployment
from canshaper.recording.export import exporting
from canshaper.recording.form import EXTRAS
from canshaper.recording.history import History
from canshaper.recording.listen import Listener, ReceivedFrame

# What a computer that is switched off may lose.
FLUSH_S = 1.0


class Recording:
    """A recording under way, or done.

    Attributes:
        frames: by kind, the empty one for data frames.
        lost: frames that the kernel could not keep for us.
        errors: of the interfaces, each in place of a frame.
        history: what the status messages reported.
        seconds: how long.
    """

    def __init__(self, deployment: Deployment) -> None:
        self.frames: Counter[str] = Counter()
        self.lost = self.errors = 0
        self._last_error = ""
        self.seconds = 0.0
        self.history = History(deployment)
        self._deployment = deployment

    def __str__(self) -> str:
        text = f"{self.seconds:.1f} s, {self.frames.total()} frames"
        others = ", ".join(f"{count} {kind}" for kind, count in self.frames.items() if kind)
        text += f" ({others})" if others else ""
        if self.errors:
            text += f", {self.errors} ERRORS of the interface, the last {self._last_error}"
        return f"{text}, {self.lost} LOST by the kernel" if self.lost else text

    def run(
        self,
        path: Path,
        seconds: float | None,
        on_progress: Callable[["Recording"], bool],
    ) -> None:
        """Record until the time is over, or ``on_progress`` says that it is enough.

        Args:
            path: the log, of candump or by its suffix one of ``EXTRAS``; one that is there is
                replaced.
            seconds: how long; None without end.
            on_progress: called some times a second; False ends the recording.

        Raises:
            BusError: a bus cannot be opened, or not be read any more.
            OSError: the log cannot be written; what was written stays.
            UsageError: what its format needs is not installed.
        """
        listener = Listener(self._deployment.config.buses.items())
        try:
            with _opened(path, self._deployment) as (write, flush):
                begin = flushed = time.monotonic()
                while on_progress(self) and (seconds is None or self.seconds < seconds):
                    for frame in listener.frames():
                        write(frame)
                        self.frames[frame.kind] += 1
                        if not frame.kind:
                            self.history.receive(frame)
                    now = time.monotonic()
                    self.seconds, self.lost = now - begin, listener.lost
                    self.errors, self._last_error = listener.errors.total(), listener.last_error
                    if now - flushed >= FLUSH_S:
                        flushed = now
                        flush()
        finally:
            listener.close()


@contextmanager
def _opened(
    path: Path, deployment: Deployment
) -> Iterator[tuple[Callable[[ReceivedFrame], object], Callable[[], object]]]:
    """A log: what writes a frame, and what puts all that was written onto the disk."""
    if path.suffix.lower() in EXTRAS:
        with exporting(path, deployment) as export:
            assert export is not None
            yield export.frame, lambda: None
        return
    with path.open("w", encoding="ascii", newline="\n") as log:
        yield lambda frame: log.write(frame.line()), log.flush
