"""The driver's seat: it decides which page drives and when its joysticks count. No clock or socket.

Nothing moves by accident: if a page falls silent, sends nonsense or is replaced by another page,
the seat sets its joysticks to neutral; they count again only after they were in neutral. The seat
releases enable when the run-on of the axes is over, so that they come to rest through the filter.
Only a page that was silent and comes back in time, with its joysticks in neutral, keeps enable.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeGuard

from canshaper.errors import PageMessageError
from canshaper.studio.words import said
from canshaper_sim.hand import Held

SILENT_S = 0.2
"""A driving page without positions for so long, s, is silent; it sends them every 20 ms."""
RELEASE_S = 3.0
"""From joysticks in neutral to enable released, s: meant to outlast the run-on of the axes."""
RESET_S = 0.3
"""How long the reset switch is held, s: some messages of a joystick."""
PRESS_S, PAUSE_S = 0.1, 0.1
"""Press of the button for the next profile, and the pause after it, s."""
MOST_PRESSES = 5
"""Presses of it that may wait for those before."""
NEUTRAL = 0.02
"""Up to this deflection (full: 1) a joystick of the page counts as neutral."""

Report = Callable[[str], None]


def is_number(value: object) -> TypeGuard[int | float]:
    """Return whether a value of a JSON message is a number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


class Cab:
    """The seat of one driver.

    Args:
        axes: names of the axes with a joystick.
        report: called with a text on each event of the seat: driver, silence, enable, anti-sway.
    """

    def __init__(self, axes: Iterable[str], report: Report) -> None:
        self._axes = frozenset(axes)
        self._report = report
        self.driver: int | None = None
        self.enable = False
        self.anti_sway = True
        self._joysticks: dict[str, float] = {}
        self._centred = False  # seen in neutral since they last stopped counting
        self._last_message_s = 0.0
        self._release_at_s: float | None = None
        self.silent = False  # why enable is about to be released
        self._reset_until_s = -math.inf
        self._presses_s = deque([-math.inf], maxlen=MOST_PRESSES)  # when each begins

    def take(self, page: int, now_s: float) -> None:
        """Let a page drive; another driver loses the joysticks, and enable ``RELEASE_S`` later."""
        if page == self.driver:
            return
        if self.driver is not None:
            self._report(said("takes", page=page, other=self.driver))
            self._let_go(now_s)
        self.driver = page
        self._last_message_s = now_s
        self._centred = False

    def leave(self, page: int, now_s: float) -> None:
        """Free the seat if this page drives: neutral now, enable released ``RELEASE_S`` later."""
        if page == self.driver:
            self._report(said("leaves", page=page))
            self._let_go(now_s)
            self.driver = None

    def joysticks(self, page: int, joysticks: Mapping[str, Any], now_s: float) -> None:
        """Take the position of each axis; it counts once the driver has had all in neutral.

        Positions of a page that does not drive are checked and ignored. Missing axes are neutral.

        Raises:
            PageMessageError: an axis is unknown, or its value is no number from -1 to 1.
        """
        for name, value in joysticks.items():
            if name not in self._axes:
                names = ", ".join(sorted(self._axes))
                raise PageMessageError(f"expected an axis, got {name[:20]!r}; there are {names}")
            if not (is_number(value) and -1.0 <= value <= 1.0):  # false of NaN, too
                raise PageMessageError(f"axis {name}: expected -1 to 1, got {repr(value)[:20]}")
        if page != self.driver:
            return
        self._watch(now_s)
        self._last_message_s = now_s
        if all(abs(value) <= NEUTRAL for value in joysticks.values()):
            self._centred = True
            if self.silent:
                self.silent, self._release_at_s = False, None
                self._report(said("back", page=page))
        self._joysticks = {n: float(v) for n, v in joysticks.items()} if self._centred else {}

    def nonsense(self, page: int, now_s: float) -> None:
        """Set the joysticks to neutral if this page drives; enable ends ``RELEASE_S`` later."""
        if page == self.driver:
            self._let_go(now_s)

    def press_enable(self, page: int, on: bool, now_s: float) -> None:
        """Press or release enable if this page drives.

        A release stops everything at once. A press has no effect while a release is due.
        """
        if page != self.driver:
            return
        if not on:
            self._joysticks, self._centred, self.silent = {}, False, False
            self.enable, self._release_at_s = False, None
        elif self._release_at_s is None or now_s >= self._release_at_s:
            self.enable, self._release_at_s = True, None

    def press_reset(self, page: int, now_s: float) -> None:
        """Press the reset switch for ``RESET_S`` if this page drives."""
        if page == self.driver:
            self._reset_until_s = now_s + RESET_S

    def press_next_profile(self, page: int, now_s: float) -> None:
        """Queue a press of next profile if this page drives; drop it if ``MOST_PRESSES`` wait."""
        if page == self.driver:
            begin_s = max(now_s, self._presses_s[-1] + PRESS_S + PAUSE_S)
            if begin_s < now_s + MOST_PRESSES * (PRESS_S + PAUSE_S):
                self._presses_s.append(begin_s)

    def switch_anti_sway(self, page: int, on: bool) -> None:
        """Switch anti-sway on or off if this page drives."""
        if page == self.driver and on is not self.anti_sway:
            self.anti_sway = on
            self._report(said("on" if on else "off"))

    def held(self, now_s: float) -> Held:
        """Let go if the driver is silent, release enable when due; return what the hand holds."""
        self._watch(now_s)
        reset = now_s < self._reset_until_s
        pressed = any(0.0 <= now_s - begin_s < PRESS_S for begin_s in self._presses_s)
        return Held(dict(self._joysticks), self.enable, reset, self.anti_sway, pressed)

    def _watch(self, now_s: float) -> None:
        """Let go if the driver is silent; release enable when its run-on time is over."""
        silent = self.driver is not None and now_s - self._last_message_s > SILENT_S
        if silent and self.enable and self._release_at_s is None:
            self._report(said("silent", page=self.driver))
            self._let_go(now_s)
            self.silent = True
        elif silent:
            self._joysticks, self._centred = {}, False
        if self._release_at_s is not None and now_s >= self._release_at_s:
            self._release_at_s, self.silent = None, False
            if self.enable:
                self.enable = False
                self._report(said("released"))

    def _let_go(self, now_s: float) -> None:
        self._joysticks, self._centred, self.silent = {}, False, False
        if self.enable and self._release_at_s is None:
            self._release_at_s = now_s + RELEASE_S
