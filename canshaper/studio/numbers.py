"""Numbers of the deployment that a page changes: live ones of a machine, and the slider's.

``LiveNumbers`` shows the present values of a running machine, who changed them, and undoes changes.
The slider sets the pendulum length that the filters assume: it is a factor on numbers of the file,
which change together, through the daemon's control socket. (Settings of filters: ``preference``.)
"""

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import unified_diff
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

from canshaper.commissioning import control_client as client
from canshaper.commissioning.origins import write_numbers
from canshaper.config.adjust import AxisKey, value
from canshaper.config.load import load_config
from canshaper.config.schema import DeploymentConfig
from canshaper.edit.edit import edited, sections_of
from canshaper.errors import CanshaperError, ControlError
from canshaper.studio.words import said

POLL_S = 1.0
MOST_CHANGES = 200
OTHERS = "another program, or the file was read again"


class Change(NamedTuple):
    """Numbers that were changed at once.

    Attributes:
        time_s: time of day, seconds of the epoch.
        who: name of the person or program that changed them.
        numbers: (value before, value after) by key in the file.
    """

    time_s: float
    who: str
    numbers: dict[str, tuple[float, float]]


class LiveNumbers:
    """The adjustable numbers of one daemon, read every ``POLL_S``. Any thread may call.

    Args:
        file: the deployment file.
        control: control socket of the daemon.
        report: called with a text on each change, also by others, and when the file is written.

    Attributes:
        version: grows whenever ``shown`` may be new.
    """

    def __init__(self, file: Path, control: Path, report: Callable[[str], None]) -> None:
        self.version = 0
        self._file, self._control, self._report = file, control, report
        self._lock = threading.RLock()
        self._table: dict[str, dict[str, float]] = {}
        self._fault = ""
        self._changes: list[Change] = []
        self._before: list[dict[str, float]] = []  # numbers before each change of ours, to undo
        self._other: dict[str, float] = {}  # the last numbers that were in force: B
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="numbers")

    def start(self) -> None:
        """Begin to read the daemon's numbers, in a thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the watch."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def shown(self) -> dict[str, Any]:
        """Return the table, fault, changes, numbers before the last, and how many can be undone."""
        with self._lock:
            return {
                "table": self._table,
                "fault": self._fault,
                "undo": len(self._before),
                "other": {k: v for k, v in self._other.items() if v != self._now().get(k)},
                "changes": [change._asdict() for change in self._changes[-MOST_CHANGES:]],
            }

    def in_force(self) -> dict[str, float]:
        """Return every number by key, as last read from the daemon; none before the first time."""
        with self._lock:
            return self._now()

    def change(self, values: Mapping[str, float], seen: Mapping[str, float], who: str) -> None:
        """Change numbers, all or none.

        Args:
            values: new values by key.
            seen: values that the page showed, by key; one that is not the present one refuses all.
            who: name for the list of changes.

        Raises:
            ControlError: the daemon refuses or does not answer, or someone else was first.
        """
        with self._lock:
            self._look()
            for key in values:
                now = self._now().get(key)
                if now is not None and seen.get(key) != now:
                    who = next((c.who for c in reversed(self._changes) if key in c.numbers), OTHERS)
                    raise ControlError(said("bynow", key=key, value=f"{now:g}", who=who))
            before = self._now()
            self._set(values, who)
            self._before.append({key: before[key] for key in values})

    def undo(self, who: str) -> None:
        """Undo the last change that was made here, unless others have changed numbers since.

        Raises:
            ControlError: there is none, or the daemon refuses or does not answer.
        """
        with self._lock:
            self._look()
            if not self._before:
                raise ControlError(said("noundo"))
            self._set(self._before[-1], f"{who}, undo")
            self._before.pop()

    def swap(self, who: str) -> None:
        """Swap the present numbers with those before the last change by anyone (A/B).

        Raises:
            ControlError: there are no earlier numbers, or the daemon refuses or does not answer.
        """
        with self._lock:
            self._look()
            now = self._now()
            values = {key: one for key, one in self._other.items() if one != now.get(key)}
            if not values:
                raise ControlError(said("noother"))
            self._set(values, f"{who}, A/B")
            self._before.append({key: now[key] for key in values})

    def difference(self) -> dict[str, str]:
        """Return what ``write`` would change, as ``text`` of a diff, and the file's ``hash``."""
        with self._lock:
            self._look()
            before = self._file.read_text(encoding="utf-8")
            after = before
            for place, numbers in sections_of(self._unwritten()).items():
                after = edited(after, place, numbers, str(self._file))
            name = self._file.name
            lines = unified_diff(
                before.splitlines(), after.splitlines(), name, name, n=1, lineterm=""
            )
            return {"text": "\n".join(lines), "hash": _hash(before)}

    def write(self, file_hash: str, who: str) -> None:
        """Write the daemon's numbers that differ from the file into the file.

        Args:
            file_hash: hash from ``difference``, whose text the person saw.
            who: name for the list of events.

        Raises:
            CanshaperError: no daemon answers; the file has changed since, or cannot be changed.
        """
        with self._lock:
            self._look()
            if _hash(self._file.read_text(encoding="utf-8")) != file_hash:
                raise ControlError(said("filechanged", file=self._file))
            values = self._unwritten()
            write_numbers(self._file, values)
            keys = ", ".join(values) or "-"
            self._report(said("wrote", who=who, keys=keys, file=self._file.name))
            self.version += 1

    def _unwritten(self) -> dict[str, float]:
        """Return the present numbers that differ from the file on the disk."""
        axes = load_config(self._file)[0].axes
        values = {}
        for text, now in self._now().items():
            key = AxisKey.parsed(text)
            assert key is not None  # the daemon has it
            if key.axis in axes and value(axes[key.axis], key) != now:
                values[text] = now
        return values

    def _now(self) -> dict[str, float]:
        return {key: one["now"] for key, one in self._table.items()}

    def _set(self, values: Mapping[str, float], who: str) -> None:
        client.change(self._control, values, who)
        self._look(who)

    def _look(self, who: str = OTHERS) -> None:
        """Read the daemon's table; keep and report changed numbers as a change by ``who``."""
        before = self._now()
        self._table = client.table(self._control)
        now = self._now()
        numbers = {k: (before[k], v) for k, v in now.items() if k in before and before[k] != v}
        if numbers:
            self._other = before
            self._changes.append(Change(time.time(), who, numbers))
            words = ", ".join(f"{k} {a:g} -> {b:g}" for k, (a, b) in numbers.items())
            self._report(f"{words} ({who})")
            if who == OTHERS:
                self._before.clear()  # the way back is no longer known
        if numbers or not before or self._fault:
            self._fault = ""
            self.version += 1

    def _watch(self) -> None:
        while True:
            with self._lock:
                try:
                    self._look()
                except CanshaperError as error:
                    if str(error) != self._fault:
                        self._fault = str(error)
                        self.version += 1
            if self._stop.wait(POLL_S):
                return


def _hash(text: str) -> str:
    return sha256(text.encode()).hexdigest()


LENGTH = "length"
RANGES = {LENGTH: (0.5, 2.0)}
"""Least and largest factor of each slider; 1 is the file."""


@dataclass(frozen=True)
class Number:
    """A number of the file that a slider scales.

    Attributes:
        key: dotted path in the deployment file.
        value: value in the file.
        power: the scaled number is value * factor ** power.
    """

    key: str
    value: float
    power: float

    def at(self, factor: float) -> float:
        """Return the number scaled by this factor of the slider."""
        return self.value * math.pow(factor, self.power)


def sliders(config: DeploymentConfig) -> dict[str, list[Number]]:
    """Return by slider the numbers that it scales: the pendulum's length or period of each axis.

    It leaves out axes with gain schedule, profiles or measured rope, whose numbers the machine
    changes, and with a second mode, which it cannot scale. Without any axis there is no slider.
    """
    numbers: list[Number] = []
    for name, axis in config.axes.items():
        design = axis.filter.design()
        several = axis.gain_schedule or axis.profiles or (design and design.second)
        if axis.sway and not several and not axis.sway.length:
            # The period grows with the root of the length.
            for key, power in (("length_m", 1.0), ("period_s", 0.5)):
                if (value := getattr(axis.sway, key)) is not None:
                    numbers.append(Number(f"axes.{name}.sway.{key}", float(value), power))
    return {LENGTH: numbers} if numbers else {}


def adjustable(by_slider: dict[str, list[Number]]) -> dict[str, list[float]]:
    """Return the section control's ``adjustable``: [least, most] by key of all sliders' numbers."""
    ranges = {}
    for name, numbers in by_slider.items():
        for number in numbers:
            ends = sorted(number.at(factor) for factor in RANGES[name])
            room = 1e-6 * abs(number.value)  # the ends are within, however they are rounded
            ranges[number.key] = [ends[0] - room, ends[1] + room]
    return ranges


def values(numbers: dict[str, list[Number]], name: str, factor: float) -> dict[str, float]:
    """Return the scaled numbers of a slider at this factor, by key.

    Raises:
        ValueError: there is no such slider, or the factor is not allowed.
    """
    if name not in numbers:
        there = ", ".join(numbers) or "none"
        raise ValueError(f"expected a slider, got {name[:20]!r}; there are {there}")
    low, high = RANGES[name]
    if not low <= factor <= high:
        raise ValueError(f"slider {name}: expected {low:g} to {high:g}, got {str(factor)[:20]}")
    return {number.key: number.at(factor) for number in numbers[name]}
