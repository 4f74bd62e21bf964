"""Files of a study: the sealed key, and a table of placements for each person."""

import csv
import json
import os
import random
from base64 import b64decode, b64encode
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

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
    """Which letter is which setting, in base64: no one who opens the folder reads it by chance.

    Args:
        path: of the file; it is made where there is none.
        settings: hash of the file of each setting, by its name.
        task: what everyone does.

    Attributes:
        letters: name of the setting of each letter.
        seed: of the order of placements.
        mark: begin of the hash of the file, which stands in each row.

    Raises:
        UsageError: it is the key of another study.
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
    """Read the settings of a study from its key.

    Raises:
        UsageError: it is none.
    """
    try:
        found: dict[str, Any] = json.loads(b64decode(path.read_bytes()))
    except (OSError, ValueError) as error:
        raise UsageError(f"{path}: expected the key of a study: {error}") from None
    return found


def mark_of(path: Path) -> str:
    """Begin of the hash of a key."""
    return sha256(path.read_bytes()).hexdigest()[:8]


class Table:
    """Rows of a person, one a placement; each is on the disk before the next placement begins.

    Args:
        path: the file; a row that was cut off is taken away.
        common: columns that are the same in all rows.

    Attributes:
        rows: those that are written, as text.

    Raises:
        UsageError: there is a file that is no such table, or of another study.
    """

    def __init__(self, path: Path, common: dict[str, str]) -> None:
        self.path, self.common = path, common
        whole, end, _cut_off = (path.read_text("utf-8") if path.exists() else "").rpartition("\n")
        path.write_text(whole + end or f"{HEAD}\n", encoding="utf-8")
        self.rows = rows_of(path, common["study"])

    def add(self, **values: object) -> None:
        """Write a row."""
        row = {**dict.fromkeys(COLUMNS, ""), **self.common}
        row |= {k: f"{v:.3f}" if isinstance(v, float) else str(v) for k, v in values.items()}
        self.rows.append(row)
        with self.path.open("a", encoding="utf-8", newline="") as file:
            csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(row)
            file.flush()
            os.fsync(file.fileno())


def rows_of(path: Path, study: str) -> list[dict[str, str]]:
    """Rows of a table.

    Raises:
        UsageError: it is none of this study.
    """
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        rows = [*reader]
    if reader.fieldnames != COLUMNS or {row["study"] for row in rows} - {study}:
        raise UsageError(f"{path}: expected placements of the study {study}")
    return rows
