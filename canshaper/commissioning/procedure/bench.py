"""The place where a step drives and measures; the simulated one, and the logs of its drives."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Protocol

from canshaper.codec.frame import Frame
from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.commissioning.calibration.run import run_simulated
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.design.lockstep import LockStep
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.recording.listen import ReceivedFrame
from canshaper.report.console import OnProgress
from canshaper_sim.crane import CraneParameters
from canshaper_sim.cranes import cranes
from canshaper_sim.hand import Hand, Held
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script


class _Releasing(JoystickNode):
    """An operator who follows the script, but lets go of the enable switch for a while.

    Meanwhile anti-sway is on, even with ``bypass``.
    """

    def __init__(
        self, deployment: Deployment, script: Script, bypass: bool, released: tuple[float, float]
    ) -> None:
        super().__init__(deployment, script, bypass=bypass)
        self._without = Hand(deployment)
        self._deployed = list(deployment.axes)
        self._released_ms = [1000.0 * time_s for time_s in released]

    def frames(self, time_ms: int) -> list[Frame]:
        """Return the frames that are due now; both hands are asked, as both count their frames."""
        joysticks = {a: self.script.command(a, time_ms / 1000.0) for a in self._deployed}
        begin_ms, end_ms = self._released_ms
        without = self._without.frames(time_ms, Held(joysticks, enable=False))
        held = super().frames(time_ms)
        return without if begin_ms <= time_ms < end_ms else held


def log_simulated(
    path: Path,
    deployment: Deployment,
    parameters: CraneParameters,
    script: Script,
    on_progress: Callable[[float], None] = lambda _done: None,
    *,
    bypass: bool = False,
    released: tuple[float, float] | None = None,
) -> None:
    """Drive a script in lock-step and write every frame, as ``candump -L`` does.

    Args:
        path: the log; one that is there is replaced.
        deployment: the machine; one that only listens leaves its valves neutral.
        parameters: the crane.
        script: what the operator does.
        on_progress: called with the part that is driven, 0 to 1.
        bypass: the operator has switched anti-sway off.
        released: when the enable switch is let go and held again, s; None for always held.

    Raises:
        ConfigError: the deployment does not fit the machine.
        DesignError: the script does not fit the machine.
        OSError: the log cannot be written.
    """
    plant = PlantNode(deployment, parameters)
    hand = (
        _Releasing(deployment, script, bypass, released)
        if released
        else JoystickNode(deployment, script, bypass=bypass)
    )
    with path.open("w", encoding="ascii", newline="\n") as log:
        buses = deployment.config.buses

        def write(frame: Frame, time_s: float) -> None:
            time_ns, channel = round(1e9 * time_s), buses[frame.bus].channel
            log.write(ReceivedFrame(time_ns, frame.bus, channel, *frame[1:], "").line())

        lock_step = LockStep(
            deployment, GatedController(Controller(deployment)), plant, [hand], write
        )
        while lock_step.time_ms < 1000.0 * script.duration_s:
            lock_step.step()
            if lock_step.time_ms % 1000 == 0:
                on_progress(lock_step.time_ms / 1000.0 / script.duration_s)


STILL_MOVES = (
    "WARNING: we send nothing to the valves, but the controller of before moves the crane wherever"
    " it is connected. Everybody away, a hand on the emergency stop."
)
"""Warning to the person who moves joysticks in ``Mode.LISTEN`` or ``Mode.DRY``."""


class Mode(Enum):
    """Who moves the valves while a step listens."""

    LISTEN = "listen"
    """The person, without us."""
    DRY = "dry"
    """The person moves them without us; the daemon computes, and sends no valve frame."""
    RAW = "raw"
    """We, without filters."""
    SHAPED = "shaped"
    """We, as the file says."""


@dataclass(frozen=True)
class Task:
    """Task of a person while a step listens.

    Attributes:
        words: what to do, for the person.
        script: the same for the simulated operator, and how long it takes.
        mode: who moves the valves.
        released: when the simulated operator lets the enable switch go and holds it again, s.
    """

    words: str
    script: Script
    mode: Mode = Mode.LISTEN
    released: tuple[float, float] | None = None


class Person(Protocol):
    """The person who is led through the steps."""

    def ready(self, words: str) -> None:
        """Ask them to do a task, and wait until they are about to begin."""

    def answer(self, question: str, default: str, allowed: Sequence[str] = ()) -> str:
        """Ask for a word, one of ``allowed`` where there are any; return it, or the default."""

    def progress(self, what: str) -> AbstractContextManager[OnProgress]:
        """Show a bar of progress, from 0 to 1."""


class Bench(Protocol):
    """Place where a step drives and measures.

    Attributes:
        simulated: whether a simulated crane stands for the machine.
        person: who drives it.
        changes: parameters of the simulated crane, NAME=VALUE.
    """

    simulated: bool
    person: Person
    changes: list[str]

    def drive(self, deployment: Deployment, log: Path, task: Task) -> None:
        """Let the task be done, and write every frame of the buses into a log.

        Raises:
            BusError: a bus cannot be opened.
            OSError: the log cannot be written.
            UsageError: the daemon ended by itself.
        """

    def raw_mode(self, step: str) -> Mode:
        """Return who moves the valves, without filters, in a step; at a machine ask the person."""

    def calibrate(self, deployment: Deployment, drive: CalibrationDrive, words: str) -> None:
        """Drive axes through their ramp until ``drive.ended``; every valve is neutral afterwards.

        Args:
            deployment: the machine.
            drive: the measurement.
            words: what the person has to know, and which switch to hold.

        Raises:
            BusError: a bus cannot be opened.
        """


def check_rehearsal(deployment: Deployment) -> None:
    """Refuse a deployment that the simulated crane cannot stand for.

    Raises:
        UsageError: several cranes.
        ConfigError: an axis that it does not have, or no messages for what it measures.
    """
    if names := cranes(deployment):
        text = f"expected one crane to rehearse with, got {len(names)}: {', '.join(names)}"
        raise UsageError(f"{deployment.path}: {text}; take a file with the axes of one of them")
    PlantNode(deployment)


class Simulated:
    """The simulated crane, in lock-step: no bus is opened.

    Args:
        person: who is shown the progress.
        changes: parameters of the crane, NAME=VALUE, as for ``canshaper sim --set``.
    """

    simulated = True

    def __init__(self, person: Person, changes: list[str]) -> None:
        self.person = person
        self.changes = changes

    def parameters(self, deployment: Deployment) -> CraneParameters:
        """Return the parameters of the simulated crane for this file, with ``changes``."""
        return changed_parameters(self.changes, deployment)

    def drive(self, deployment: Deployment, log: Path, task: Task) -> None:
        """Drive the script of the task; valves stay neutral where its mode is not to move them."""
        with self.person.progress("driving") as on_progress:
            log_simulated(
                log,
                deployment if task.mode in (Mode.RAW, Mode.SHAPED) else deployment.listening(),
                self.parameters(deployment),
                task.script,
                on_progress,
                bypass=task.mode is Mode.RAW,
                released=task.released,
            )

    def raw_mode(self, _step: str) -> Mode:
        """Return that we move the valves; nobody is asked."""
        return Mode.RAW

    def calibrate(self, deployment: Deployment, drive: CalibrationDrive, _words: str) -> None:
        """Drive axes through the ramp as ``run_simulated`` does; nobody is asked."""
        with self.person.progress("driving") as on_progress:
            parameters = self.parameters(deployment)
            run_simulated(drive, deployment, parameters, lambda one: on_progress(one.progress))
