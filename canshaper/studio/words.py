"""Words for people: texts of states, reasons and faults by number, and messages of the studio."""

import json
import threading
import time
from collections import deque
from functools import cache
from pathlib import Path
from typing import NamedTuple

from canshaper.codec.frame import FrameFault
from canshaper.shaping.reasons import REASON_TEXTS, STATE_TEXTS
from canshaper.shaping.states import MOVING, Reason, State

FAULTS = {
    fault: "" if fault is FrameFault.NONE else fault.name.lower().replace("_", " ")
    for fault in FrameFault
}


LANGUAGES = Path(__file__).parent / "static" / "languages"


@cache
def _texts() -> dict[str, str]:
    table: dict[str, str] = json.loads((LANGUAGES / "en.json").read_text(encoding="utf-8"))
    return table


def said(what: str, **values: object) -> str:
    """Return the page's text "said.WHAT" in English, with values by name; pages translate it."""
    return _texts()[f"said.{what}"].format(**values)


def state_words(number: int) -> str:
    """Return the words for a state number; "state N" for one that does not exist."""
    return STATE_TEXTS[State(number)].words if number in _STATES else f"state {number}"


def state_level(state: int | None) -> str:
    """Return the page's level of a state: off (None), wait, ready, move, stop or bad."""
    if state == State.TRIPPED:
        return "bad"
    if state == State.STOPPING:
        return "stop"
    if state in MOVING:
        return "move"
    return "off" if state is None else ("ready" if state == State.READY else "wait")


def reason_words(number: int) -> str:
    """Return the words for a reason number; "reason N" for one that does not exist."""
    return REASON_TEXTS[Reason(number)].words if number in _REASONS else f"reason {number}"


def fault_words(number: int) -> str:
    """Return the words for a fault number: "" for no fault, "fault N" for an unknown one."""
    return FAULTS[FrameFault(number)] if number in _FAULTS else f"fault {number}"


_STATES, _REASONS, _FAULTS = frozenset(State), frozenset(Reason), frozenset(FrameFault)


MOST = 500
"""Events kept for a page that opens later; older ones are dropped."""


class Event(NamedTuple):
    """One line in the list of events.

    Attributes:
        number: number of the event, from 1.
        time_s: time of day, seconds of the epoch.
        source: name of a crane, or "page".
        text: description of the event.
        level: "info", "warn" or "bad".
        clock_s: monotonic time, as in the charts.
    """

    number: int
    time_s: float
    source: str
    text: str
    level: str
    clock_s: float


class Events:
    """The last ``MOST`` events; any thread may add and read."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._events: deque[Event] = deque(maxlen=MOST)
        self._count = 0

    def add(self, source: str, text: str, level: str = "info") -> None:
        """Add an event of now; for the arguments see ``Event``."""
        clock_s = time.monotonic()
        with self._lock:
            self._count += 1
            self._events.append(Event(self._count, time.time(), source, text, level, clock_s))

    def since(self, number: int) -> list[Event]:
        """Return the kept events with a higher number, oldest first."""
        with self._lock:
            return [event for event in self._events if event.number > number]
