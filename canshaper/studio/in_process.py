"""A simulated crane with its controller in this process: where processes share no bus.

As on systems other than Linux, and for deployments with several buses. The frames are those of a
bus; the controller is the daemon's, behind its gate and in its I/O cycle.
"""

from collections.abc import Mapping, Sequence

from canshaper.codec.frame import Frame
from canshaper.controller.adjust import Adjuster
from canshaper.controller.controller import Controller
from canshaper.controller.events import StateEvent
from canshaper.controller.guarded import Guarded
from canshaper.design.lockstep import LockStep, driven_part
from canshaper.errors import DriveError
from canshaper.machine.deployment import Deployment
from canshaper.studio.view import Report
from canshaper_sim.cranes import cranes, one_crane
from canshaper_sim.hand import Hand, Held
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode

MOST_MS = 500
"""Longest time that is caught up with; a computer that was asleep goes on where it was."""


class InProcessCrane:
    """Joysticks, controller and crane, in step.

    Args:
        deployment: the machine; its buses are not opened.
        changes: parameters of the crane, NAME=VALUE.
        crane: which one it is, where the deployment has several; the others' joysticks stand still.
        report: called with the error of a filter: a status frame carries only its reason.

    Attributes:
        cycle_ms: of the joysticks.

    Raises:
        DriveError: no simulated crane fits the deployment.
    """

    def __init__(
        self,
        deployment: Deployment,
        changes: Sequence[str] = (),
        crane: str | None = None,
        report: Report = lambda _text, _level: None,
    ) -> None:
        driven = driven_part(deployment, crane)
        self._hand = _HeldHand(driven)
        others = [_HeldHand(one_crane(deployment, n)) for n in cranes(deployment) if n != crane]
        self.cycle_ms = self._hand.hand.cycle_ms
        self._controller = Controller(deployment)
        self._adjuster = Adjuster(self._controller)
        self._report = report
        self._frames: list[Frame] = []
        try:
            plant = PlantNode(driven, changed_parameters([*changes]))
        except ValueError as error:
            raise DriveError(str(error)) from None
        self._lock_step = LockStep(
            deployment,
            Guarded(self._controller),
            plant,
            [self._hand, *others],
            lambda frame, _time_s: self._frames.append(frame),
            received=deployment.routing.received,
        )
        self._due_ms = 0

    def frames(self, held: Held, passed_ms: int) -> list[Frame]:
        """Let time pass with the joysticks held so; every frame that was on a bus in it."""
        self._hand.held = held
        self._due_ms += min(passed_ms, MOST_MS)
        while self._lock_step.time_ms < self._due_ms:
            self._lock_step.step()
        for event in self._controller.events:
            if isinstance(event, StateEvent) and event.transition.error:
                self._report(event.text, "bad")
        self._controller.events.clear()
        frames, self._frames = self._frames, []
        return frames

    def change(self, values: Mapping[str, float]) -> None:
        """Change numbers of the controller.

        Raises:
            ValueError: it does not allow that.
        """
        self._adjuster.change(values)


class _HeldHand:
    """Joysticks as the page holds them."""

    def __init__(self, deployment: Deployment) -> None:
        self.hand, self.held = Hand(deployment), Held()

    def frames_of_tick(self, time_ms: int, tick_ms: int) -> list[Frame]:
        """Frames that came since the last tick."""
        due = self.hand.due(time_ms, tick_ms)
        return [frame for ms in due for frame in self.hand.frames(ms, self.held)]
