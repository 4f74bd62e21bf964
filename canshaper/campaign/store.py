"""Rows of a campaign on the disk: Parquet files in a folder, one row a drive, each drive once.

A file is written under another name and put in its place at once: what a program that ends, a full
disk or a power loss leaves behind is whole. Any program that reads Parquet reads the folder.
"""

import json
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from canshaper.errors import CampaignError

# Rows that wait in memory, at most, and for how long: so much a power loss costs.
MOST_ROWS = 1000
MOST_S = 30.0
_KEY = b"canshaper"
_TYPES = {bool: pa.bool_(), int: pa.int64(), str: pa.string(), float: pa.float64()}
# Of columns whose first value may be missing.
_KNOWN = {"seed": pa.int64(), "operator": pa.string(), "fault": pa.string(), "why": pa.string()}


class Store:
    """The rows of one folder.

    Args:
        folder: made where it is not there.
        about: what the drives are of; another folder's or program's are refused.

    Attributes:
        seeds: of the drives that are kept.

    Raises:
        CampaignError: the folder has rows of something else, or cannot be read.
    """

    def __init__(self, folder: Path, about: dict[str, Any]) -> None:
        self.folder, self._about = folder, json.dumps(about, sort_keys=True)
        self._rows: list[dict[str, Any]] = []
        self._files: set[Path] = set()
        self.seeds: set[int] = set()
        self._flushed_s = monotonic()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CampaignError(f"{folder}: {error.strerror}") from None
        self._look()

    def add(self, rows: Iterable[dict[str, Any]]) -> None:
        """Keep rows; those of a drive that is there already are left out."""
        for row in rows:
            if row["seed"] not in self.seeds:
                self.seeds.add(row["seed"])
                self._rows.append(row)
        if len(self._rows) >= MOST_ROWS or monotonic() - self._flushed_s >= MOST_S:
            self.flush()

    def flush(self) -> None:
        """Put what waits on the disk.

        Raises:
            CampaignError: the disk does not take it; nothing of it is there.
        """
        self._flushed_s = monotonic()
        others = self._look()
        self._rows = [row for row in self._rows if row["seed"] not in others]
        if not self._rows:
            return
        rows = sorted(self._rows, key=lambda row: row["seed"])
        schema = pa.schema(
            [(name, _KNOWN.get(name) or _type(rows, name)) for name in rows[0]],
            metadata={_KEY: self._about.encode()},
        )
        path = self.folder / f"drives-{rows[0]['seed']:09d}.parquet"
        # No program reads it as a part of the folder, and no two campaigns write the same one.
        half = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            pq.write_table(pa.Table.from_pylist(rows, schema), half)
            with half.open("rb+") as file:
                os.fsync(file.fileno())
            half.replace(path)
        except OSError as error:
            half.unlink(missing_ok=True)
            raise CampaignError(
                f"{path}: {error.strerror or error}; what is there is whole"
            ) from None
        self._files.add(path)
        self._rows = []

    def merge(self, folder: Path) -> int:
        """Take the rows of another folder, file by file; how many were new.

        Raises:
            CampaignError: they are of something else, or there are none.
        """
        before = len(self.seeds)
        files = parts(folder)
        if not files:
            raise CampaignError(f"{folder}: expected the Parquet files of a campaign, got none")
        for path in files:
            self._check(path)
            self.add(_read(path).to_pylist())
            self.flush()
        return len(self.seeds) - before

    def columns(self, names: Sequence[str] | None = None) -> dict[str, list[Any]]:
        """Columns of all rows on the disk, in the order of the seeds."""
        tables = [_read(path, names) for path in parts(self.folder)]
        if not tables:
            return {}
        table = pa.concat_tables(tables, promote_options="default").sort_by("seed")
        return {name: table[name].to_pylist() for name in table.column_names}

    def _look(self) -> set[int]:
        """Seeds in files that are new: first all, later what another campaign has put here."""
        new = set(parts(self.folder)) - self._files
        seeds: set[int] = set()
        for path in new:
            self._check(path)
            seeds.update(_read(path, ["seed"])["seed"].to_pylist())
        self._files |= new
        self.seeds |= seeds
        return seeds

    def _check(self, path: Path) -> None:
        try:
            kept = (pq.read_schema(path).metadata or {}).get(_KEY, b"").decode()
        except (OSError, pa.ArrowException) as error:
            raise CampaignError(f"{path}: {str(error).splitlines()[0]}") from None
        if kept != self._about:
            raise CampaignError(f"{path}: expected drives of {_differs(self._about, kept)}")


def parts(folder: Path) -> list[Path]:
    """The files of a folder."""
    return sorted(folder.glob("drives-*.parquet"))


def _read(path: Path, names: Sequence[str] | None = None) -> Any:
    try:
        return pq.read_table(path, columns=None if names is None else [*names])
    except (OSError, pa.ArrowException) as error:
        raise CampaignError(f"{path}: {str(error).splitlines()[0]}") from None


def _type(rows: list[dict[str, Any]], name: str) -> Any:
    """Type of a column: that of its first value; of one without any that of a measure."""
    values: Iterator[Any] = (row[name] for row in rows if row[name] is not None)
    return _TYPES[type(next(values, 0.0))]


def _differs(expected: str, kept: str) -> str:
    """Return how a folder differs from the one expected, for an error."""
    ours, theirs = json.loads(expected), json.loads(kept) if kept else {}
    keys = [key for key in ours if ours[key] != theirs.get(key)]
    key = keys[0] if keys else "file"
    return f"{key} {ours.get(key)}, got {theirs.get(key, 'none')}; choose another --out"
