"""A simulated crane with its controller in this process, for systems without a shared bus.

These are systems other than Linux, and deployments with several buses. The frames are those of a
bus; the controller is that of the daemon, behind its gate and in its I/O cycle.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from canshaper.codec.frame import Frame
from canshaper.controller.adjust import Adjuster
from canshaper.controller.controller import Controller
from canshaper.controller.events import StateEvent
from canshaper.controller.gated import GatedController
from canshaper.design.lockstep import LockStep, driven_part
from canshaper.errors import DriveError
from canshaper.machine.deployment import Deployment
from canshaper.studio.view import CraneView, Report
from canshaper_sim.cranes import cranes, one_crane
from canshaper_sim.hand import Hand, Held
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode

MOST_MS = 500
"""Longest time that is caught up with, ms; after sleep a computer goes on where it was."""


class InProcessCrane:
    """Joysticks, controller and crane, tick by tick.

    Args:
        deployment: the machine; its buses are not opened.
        changes: parameters of the crane, NAME=VALUE.
        crane: name of the crane to drive, other cranes' joysticks stand still; None for all.
        report: called with the text of a filter error; a status frame carries only its reason.
        joysticks: source of joystick frames; by default a hand that ``frames`` moves.

    Attributes:
        cycle_ms: cycle of the joysticks, ms.

    Raises:
        DriveError: no simulated crane fits the deployment, or a change or the name is wrong.
    """

    def __init__(
        self,
        deployment: Deployment,
        changes: Sequence[str] = (),
        crane: str | None = None,
        report: Report = lambda _text, _level: None,
        joysticks: "HeldHand | None" = None,
    ) -> None:
        driven = driven_part(deployment, crane)
        self._hand = joysticks or HeldHand(driven)
        others = [HeldHand(one_crane(deployment, n)) for n in cranes(deployment) if n != crane]
        self.cycle_ms = self._hand.hand.cycle_ms
        self._controller = Controller(deployment)
        self._adjuster = Adjuster(self._controller)
        self._gated = GatedController(self._controller)
        self._next: Deployment | None = None
        self._report = report
        self._frames: list[Frame] = []
        try:
            plant = PlantNode(driven, changed_parameters([*changes], deployment))
        except ValueError as error:
            raise DriveError(str(error)) from None
        self._lock_step = LockStep(
            deployment,
            self._gated,
            plant,
            [self._hand, *others],
            lambda frame, _time_s: self._frames.append(frame),
            received=deployment.routing.received,
        )
        self._due_ms = 0

    def frames(self, held: Held, passed_ms: int) -> list[Frame]:
        """Let passed_ms (``MOST_MS`` at most) pass with these joysticks; return its frames."""
        self._hand.held = held
        self._due_ms += min(passed_ms, MOST_MS)
        while self._lock_step.time_ms < self._due_ms:
            if self._next and self._controller.neutral:
                self._use(self._next)
            self._lock_step.step()
        for event in self._controller.events:
            if isinstance(event, StateEvent) and event.transition.error:
                self._report(event.text, "bad")
        self._controller.events.clear()
        frames, self._frames = self._frames, []
        return frames

    def change(self, values: Mapping[str, float]) -> None:
        """Change numbers of the controller, by key as in the file, all or none.

        Raises:
            ValueError: the controller does not allow the change.
        """
        self._adjuster.change(values)

    def reload(self, deployment: Deployment) -> None:
        """Go on with this deployment, as after a reload, once every axis is neutral."""
        self._next = deployment

    def _use(self, deployment: Deployment) -> None:
        before, gated, self._next = self._controller, self._gated, None
        self._controller = Controller(deployment)
        self._gated = GatedController(self._controller)
        self._controller.carry_over(before)
        self._gated.carry_over(gated)
        self._adjuster = Adjuster(self._controller)
        self._lock_step.processor = self._gated


class HeldHand:
    """A source of joystick frames; its owner writes the hand's state to ``held``."""

    def __init__(self, deployment: Deployment) -> None:
        self.hand, self.held = Hand(deployment), Held()

    def frames_of_tick(self, time_ms: int, tick_ms: int) -> list[Frame]:
        """Return the frames with ``held`` that are due in the last tick_ms up to time_ms."""
        due = self.hand.due(time_ms, tick_ms)
        return [frame for ms in due for frame in self.hand.frames(ms, self.held)]


PICTURE_S = 0.04
MOST_PICTURES = 15_000
"""Pictures of a film: ten minutes, as much as the charts of the page keep."""
LIVE_ONLY = frozenset(("sources", "late_us"))
"""Values of ``CraneView.values`` that a film leaves out: known only on a live bus."""


class CraneFilm:
    """Pictures of a crane, one every ``PICTURE_S`` seconds of the drive.

    Args:
        name: name of the crane on the page.
        deployment: names the messages.
        begin_s: time of the first picture to keep, s.
        end_s: time of the last picture to keep, s; None for the end of the drive.

    Attributes:
        view: present state of the crane.
        numbers: number of each picture; its time is ``number * PICTURE_S``.
        pictures: values that a live page would have shown, but for ``LIVE_ONLY``.
        events: (time in s, name, text, level) of each event from begin to end.
        full: the drive had more than ``MOST_PICTURES``; later pictures and events were dropped.
    """

    def __init__(
        self, name: str, deployment: Deployment, begin_s: float = 0.0, end_s: float | None = None
    ) -> None:
        self.name = name
        self.view = CraneView(deployment, self._on_event)
        self.numbers: list[int] = []
        self.pictures: list[dict[str, Any]] = []
        self.events: list[tuple[float, str, str, str]] = []
        self.full = False
        self._begin_s, self._end_s = begin_s, end_s
        self._now_s = 0.0
        self._next = 0

    def receive(self, frame: Frame, now_s: float) -> None:
        """Give a frame from the buses of the crane to the view, at now_s of the drive."""
        self._now_s = now_s
        self.view.receive(frame, now_s)

    def advance(self, now_s: float) -> None:
        """Keep the pictures from begin to end that are due up to now_s; report silent nodes."""
        last = int(now_s / PICTURE_S + 1e-6)
        while self._next <= last:
            self._now_s = self._next * PICTURE_S
            self.view.check(self._now_s)
            if self._within():
                self._keep()
            self._next += 1

    def leap(self, now_s: float) -> None:
        """Skip the pictures before now_s: nothing happened until then."""
        self._next = max(self._next, int(now_s / PICTURE_S))

    def _within(self) -> bool:
        return self._begin_s <= self._now_s and (self._end_s is None or self._now_s <= self._end_s)

    def _keep(self) -> None:
        if len(self.pictures) >= MOST_PICTURES:
            self.full = True
            return
        values = self.view.values(self._now_s)
        self.numbers.append(self._next)
        self.pictures.append({key: v for key, v in values.items() if key not in LIVE_ONLY})

    def _on_event(self, text: str, level: str) -> None:
        if self._within() and not self.full:
            self.events.append((round(self._now_s, 3), self.name, text, level))
