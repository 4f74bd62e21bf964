"""A study with people: its key and its tables, and the placements in their order. No clock.

A placement begins with the first motion of the crane and ends with the driver's grip, hit or miss,
as in ISO 9241-411. An aborted placement is not done; it comes again at the end of its part, or in
its planned place if the study was interrupted.
"""

import csv
import json
import math
import os
import random
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

from canshaper.errors import UsageError

LETTERS = "ABC"
KEY = "study.key"
HIT, MISS, BROKEN = "hit", "miss", "broken"
HEAD = (
    "study,person,input,order,part,setting,number,practice,distance_m,width_m,reaction_s,seconds,"
    "error_m,swing_deg,outcome,why"
)
COLUMNS = HEAD.split(",")


class Key:
    """The setting of each letter, in base64 so that nobody reads it by chance.

    Args:
        path: the key file; it is made if it does not exist.
        settings: hash of each setting's file, by name of the setting: one for each of ``LETTERS``.
        task: parameters of the task that everyone does.

    Attributes:
        letters: name of the setting, by letter.
        seed: seed of the order of placements.
        mark: first 8 digits of the hash of the key file, repeated in each row of a table.

    Raises:
        UsageError: the file is no key, or that of other settings or another task.
    """

    def __init__(self, path: Path, settings: Mapping[str, str], task: Mapping[str, Any]) -> None:
        own = {"settings": dict(settings), "task": dict(task)}
        if not path.exists():
            source = random.SystemRandom()
            names = source.sample(sorted(settings), len(settings))
            made = {"letters": dict(zip(LETTERS, names, strict=True)), "seed": source.random()}
            path.write_bytes(b64encode(json.dumps(own | made).encode()))
        found = read_key(path)
        for what, value in own.items():
            if found[what] != value:
                text = f"expected the {what} that the study began with, {found[what]}"
                raise UsageError(f"{path}: {text}; got {value}")
        self.letters: dict[str, str] = found["letters"]
        self.seed: float = found["seed"]
        self.mark = mark_of(path)


def read_key(path: Path) -> dict[str, Any]:
    """Return ``settings``, ``task``, ``letters`` and ``seed`` of a study from its key.

    Raises:
        UsageError: the file cannot be read, or has not these in JSON in base64.
    """
    try:
        key = json.loads(b64decode(path.read_bytes()))
        return {name: key[name] for name in ("settings", "task", "letters", "seed")}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{path}: expected the key of a study: {error}") from None


def mark_of(path: Path) -> str:
    """Return the first 8 hex digits of the SHA-256 of a key file."""
    return sha256(path.read_bytes()).hexdigest()[:8]


class Table:
    """Rows of a person, one per placement, done or aborted; each is at once on the disk.

    Args:
        path: the file, made if missing; a last row that was cut off is removed.
        common: values by column that are equal in all rows; ``study`` is needed.

    Attributes:
        rows: all rows of the file, as text by column.

    Raises:
        UsageError: the file is no such table, or belongs to another study.
    """

    def __init__(self, path: Path, common: dict[str, str]) -> None:
        self.path, self.common = path, common
        whole, end, _cut_off = (path.read_text("utf-8") if path.exists() else "").rpartition("\n")
        path.write_text(whole + end or f"{HEAD}\n", encoding="utf-8")
        self.rows = rows_of(path, common["study"])

    def add(self, **values: object) -> None:
        """Write a row, values by column, to the disk and wait for it; other columns are empty."""
        row = {**dict.fromkeys(COLUMNS, ""), **self.common}
        row |= {k: f"{v:.3f}" if isinstance(v, float) else str(v) for k, v in values.items()}
        self.rows.append(row)
        with self.path.open("a", encoding="utf-8", newline="") as file:
            csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(row)
            file.flush()
            os.fsync(file.fileno())


def rows_of(path: Path, study: str) -> list[dict[str, str]]:
    """Return the rows of a table, as text by column; ``study`` is the mark of the key.

    Raises:
        UsageError: the file is no table of this study.
    """
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        rows = [*reader]
    if reader.fieldnames != COLUMNS or {row["study"] for row in rows} - {study}:
        raise UsageError(f"{path}: expected placements of the study {study}")
    return rows


# Ways of the grapple to the target, and diameters of the target: .9 to 3.8 bits.
TARGETS_M = [(distance, width) for distance in (1.0, 2.0, 4.0) for width in (0.3, 0.6, 1.2)]
# Two Latin squares: each setting follows each other one as often (Williams 1949).
ORDERS = ("ABC", "BCA", "CAB", "CBA", "ACB", "BAC")
REACH_M, AHEAD = (2.5, 7.5), 0.3  # where a target may be, from the pillar; part of it straight on
SHOWN_S = 1.5  # time for which the page shows hit or miss
LIMIT_S, HELD_UP_S = 60.0, 0.3  # longest placement, and standstill of this program in it


class Placement(NamedTuple):
    """A target to reach; part, and number in it, count from 1; ``practice``: 1 if not counted."""

    part: int
    setting: str
    number: int
    practice: int
    distance_m: float
    width_m: float


def plan(
    counts: tuple[int, int], start_m: float, order: str, seed: str
) -> dict[Placement, tuple[float, float]]:
    """Return the place of every placement of a person: m ahead of the pillar and to its left.

    Args:
        counts: numbers of practice and then of counted placements in each part, drawn in rounds of
            all nine targets in random order.
        start_m: start of the grapple, m straight ahead of the pillar.
        order: letters of the settings, in the order of the parts.
        seed: seed of the random order.
    """
    planned = {}
    for part, letter in enumerate(order, 1):
        source, number = random.Random(f"{seed} {part}"), 0
        for practice, count in zip((1, 0), counts, strict=True):
            drawn: list[tuple[float, float]] = []
            while len(drawn) < count:
                drawn += source.sample(TARGETS_M, len(TARGETS_M))
            for distance_m, width_m in drawn[:count]:
                number += 1
                one = Placement(part, letter, number, practice, distance_m, width_m)
                planned[one] = _place(source, start_m, distance_m)
    return planned


def _place(source: random.Random, start_m: float, distance_m: float) -> tuple[float, float]:
    """Return a random place in reach and in the picture, at this distance from the start."""
    while True:
        angle = source.uniform(-math.pi, math.pi)
        x, y = start_m + distance_m * math.cos(angle), distance_m * math.sin(angle)
        if REACH_M[0] <= math.hypot(x, y) <= REACH_M[1] and x > AHEAD * math.hypot(x, y):
            return x, y


class Session:
    """A person at work, from one placement to the next.

    Args:
        planned: every placement with its place, see ``plan``.
        break_s: least break between two parts, s.
        table: the table that takes each placement; those in it are done unless aborted.
        fresh: called with the letter of a setting; puts a crane with it at the start.

    Attributes:
        phase: present phase: pause, ready, moving, shown or done.
    """

    def __init__(
        self,
        planned: dict[Placement, tuple[float, float]],
        break_s: float,
        table: Table,
        fresh: Callable[[str], None],
    ) -> None:
        done = {(r["part"], r["number"]) for r in table.rows if r["outcome"] != BROKEN}
        self._todo = [one for one in planned if (str(one.part), str(one.number)) not in done]
        self._planned, self._break_s, self._table, self._fresh = planned, break_s, table, fresh
        self.phase = "pause" if self._todo else "done"
        self._why = ""  # reason of a pause; empty before a part
        self._result: tuple[str, float] | None = None
        self._last = [*planned][-1]
        self._since_s = self._until_s = self._reaction_s = self._seen_s = 0.0
        self._place: tuple[float, float] | None = None
        self._swing_deg = 0.0

    def begin(self, now_s: float) -> None:
        """End a pause if it has lasted long enough: put a crane at the start and show a target."""
        if self.phase == "pause" and now_s >= self._until_s:
            self._next(now_s)

    def _next(self, now_s: float) -> None:
        self.phase, self._why, self._result, self._since_s = "ready", "", None, now_s
        self._fresh(self._todo[0].setting)

    def see(
        self, level: str, place: tuple[float, float] | None, swing_deg: float | None, now_s: float
    ) -> None:
        """Take level of all axes, place (m ahead, m left), swing each tick; abort after a stop."""
        held_up, self._seen_s = now_s - self._seen_s > HELD_UP_S, now_s
        self._place, self._swing_deg, lasts_s = place, swing_deg or 0.0, now_s - self._since_s
        if self.phase == "ready" and level == "move":
            self.phase, self._reaction_s, self._since_s = "moving", lasts_s, now_s
        elif self.phase == "shown" and lasts_s > SHOWN_S:
            if self._todo and self._todo[0].part == self._last.part:
                self._next(now_s)
            else:
                self.phase = "pause" if self._todo else "done"
                self._until_s = now_s + self._break_s
        elif self.phase == "moving" and level not in ("move", "ready"):
            self.break_off("stopped", now_s)
        elif self.phase == "moving" and (held_up or lasts_s > LIMIT_S):
            self.break_off("held" if held_up else "long", now_s)

    def grip(self, by: str, now_s: float) -> None:
        """End the placement under way where the grapple is, and write its row; else do nothing."""
        if self.phase != "moving" or self._place is None:
            return
        one = self._last = self._todo.pop(0)
        error_m = math.dist(self._place, self._planned[one])
        self._result = (HIT if error_m <= one.width_m / 2.0 else MISS), error_m
        self._table.add(
            **one._asdict(), input=by, reaction_s=self._reaction_s, seconds=now_s - self._since_s,
            error_m=error_m, swing_deg=self._swing_deg, outcome=self._result[0],
        )  # fmt: skip
        self.phase, self._since_s = "shown", now_s

    def break_off(self, why: str, now_s: float) -> None:
        """Abort the placement under way, if any: write its row, pause, and do it again later."""
        if self.phase == "moving":
            one, seconds = self._todo.pop(0), now_s - self._since_s
            self._table.add(**one._asdict(), seconds=seconds, outcome=BROKEN, why=why)
            self._todo.insert(sum(other.part == one.part for other in self._todo), one)
            self.phase, self._why, self._until_s = "pause", why, now_s

    def shown(self, now_s: float) -> dict[str, Any]:
        """Return what the page shows, without the setting; ``target``: m ahead, m left, width."""
        over = self.phase in ("shown", "done")
        one = self._last if over else self._todo[0]
        numbers, left = (
            sum(o.part == one.part for o in all_) for all_ in (self._planned, self._todo)
        )
        target = self.phase in ("ready", "moving")
        return {
            "phase": self.phase,
            "why": self._why,
            "result": self._result,
            "part": one.part,
            "parts": max(other.part for other in self._planned),
            "practice": bool(one.practice),
            "number": numbers - left + (not over),
            "numbers": numbers,
            "wait_s": max(0, math.ceil(self._until_s - now_s)) if self.phase == "pause" else 0,
            "target": [*self._planned[one], one.width_m] if target else None,
        }
