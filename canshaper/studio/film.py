"""One crane of a drive that is over: frames in, pictures out, as a live page shows them."""

from typing import Any

from canshaper.codec.frame import Frame
from canshaper.machine.deployment import Deployment
from canshaper.studio.view import CraneView

PICTURE_S = 0.04
MOST_PICTURES = 15_000
"""Ten minutes: as much as the charts of the page keep."""
LIVE_ONLY = frozenset(("sources", "late_us"))
"""What is known of a crane while it is listened to only."""


class CraneFilm:
    """Pictures of a crane, one for each ``PICTURE_S`` of the drive.

    Args:
        name: of the crane, for the page.
        deployment: names the messages.
        begin_s: from where pictures are kept.
        end_s: up to where; None for the end.

    Attributes:
        view: what is known of the crane now.
        numbers: of each picture: its time is ``number * PICTURE_S``.
        pictures: what a live page would have shown.
        events: (time in s, name, text, level) of what happened.
        full: whether there was more than is kept.
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
        """Take a frame of its buses."""
        self._now_s = now_s
        self.view.receive(frame, now_s)

    def advance(self, now_s: float) -> None:
        """Take the pictures that are due up to a time."""
        last = int(now_s / PICTURE_S + 1e-6)
        while self._next <= last:
            self._now_s = self._next * PICTURE_S
            self.view.check(self._now_s)
            if self._within():
                self._keep()
            self._next += 1

    def leap(self, now_s: float) -> None:
        """Take no pictures up to a time: nothing happened until then."""
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
