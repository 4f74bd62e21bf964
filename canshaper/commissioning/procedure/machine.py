"""The machine itself: a person drives, the daemon runs as a process, its buses are recorded."""

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.commissioning.calibration.run import run_live
from canshaper.commissioning.procedure.bench import Mode, Person, Task
from canshaper.commissioning.procedure.files import write_without_filters
from canshaper.design.processes import canshaper_command, end
from canshaper.errors import BusError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.recording.record import Recording

START_LIMIT_S = 30.0
LOOK_S = 0.1
EXIT_BUS = 3  # of `canshaper run`, where a bus cannot be opened
OTHER, OURS = "other", "canshaper"


class Machine:
    """The buses of the deployment.

    Args:
        person: who drives, and gets the instructions.
        options: of ``canshaper run``: which buses, as the command line has them.
    """

    simulated = False

    def __init__(self, person: Person, options: list[str]) -> None:
        self.person = person
        self.changes: list[str] = []
        self._options = options

    def drive(self, deployment: Deployment, log: Path, task: Task) -> None:
        """Run the daemon where the mode has one; ask the person to drive, and record the buses."""
        with self._daemon(deployment, log, task.mode) as daemon:
            self.person.ready(task.words)
            seconds = task.script.duration_s
            recording = Recording(deployment)
            with self.person.progress("recording") as on_progress:

                def report(so_far: Recording) -> bool:
                    on_progress(so_far.seconds / seconds)
                    return daemon is None or daemon.poll() is None

                recording.run(log, seconds, report)
            if daemon and daemon.poll() is not None:
                raise _failed(daemon, log.with_suffix(".txt"))

    def raw_mode(self, step: str) -> Mode:
        """Ask the person whether the controller of before moves the valves, or we."""
        question = f"{step}: who moves the valves: {OTHER} (the controller of before) or {OURS}"
        answer = self.person.answer(question, OTHER, (OTHER, OURS))
        return Mode.RAW if answer == OURS else Mode.LISTEN

    def calibrate(self, deployment: Deployment, drive: CalibrationDrive, words: str) -> None:
        """Ask the person to be ready, then drive; raise KeyboardInterrupt after a Ctrl-C."""
        self.person.ready(words)
        with self.person.progress("driving") as on_progress:

            def show(one: CalibrationDrive) -> None:
                on_progress(one.progress, one.waiting_for and f"waits for {one.waiting_for}")

            run_live(drive, deployment, show)
        if drive.ended == "stopped: Ctrl-C":
            raise KeyboardInterrupt

    @contextmanager
    def _daemon(
        self, deployment: Deployment, log: Path, mode: Mode
    ) -> "Iterator[subprocess.Popen[bytes] | None]":
        """Run the daemon, where the mode has one; its valves are neutral however the block ends."""
        if mode is Mode.LISTEN:
            yield None
            return
        file = deployment.path
        raw = file.with_name(f"{file.stem}.commission.raw.yaml") if mode is Mode.RAW else None
        if raw:
            write_without_filters(deployment, raw)
            file = raw
        listen = ["--listen-only"] if mode is Mode.DRY else []
        words = [str(file), *self._options, *listen]
        said = log.with_suffix(".txt")
        try:
            with said.open("wb") as output:
                daemon = subprocess.Popen(
                    canshaper_command("run", *words),
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=output,
                    process_group=0,  # Ctrl-C is for us, who end it
                )
            try:
                _wait_for_start(daemon, said)
                yield daemon
            finally:
                end(daemon)
        finally:
            if raw:
                raw.unlink(missing_ok=True)


def _wait_for_start(daemon: "subprocess.Popen[bytes]", said: Path) -> None:
    """Wait until the daemon says that it has started.

    Raises:
        BusError: it cannot open a bus, or does not start.
        UsageError: the file is wrong.
    """
    limit = time.monotonic() + START_LIMIT_S
    while b"started file=" not in said.read_bytes():
        if daemon.poll() is not None:
            raise _failed(daemon, said)
        if time.monotonic() > limit:
            raise BusError(f"canshaper run: not started within {START_LIMIT_S:g} s; see {said}")
        time.sleep(LOOK_S)


def _failed(daemon: "subprocess.Popen[bytes]", said: Path) -> BusError | UsageError:
    """Return the error of a daemon that has ended, with what it said."""
    text = said.read_text(encoding="utf-8", errors="replace").strip()
    kind = BusError if daemon.returncode == EXIT_BUS else UsageError
    return kind(f"canshaper run ended with status {daemon.returncode}:\n{text}")
