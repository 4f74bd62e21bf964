"""Rows of a campaign on the disk: a folder of Parquet files, with one row for each drive.

A file is written under another name and then renamed: after a crash, on a full disk and after a
power loss every file of the folder is whole. Any program that reads Parquet reads the folder.
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

# Most rows that wait in memory, and how long at most: a power loss costs no more than these.
MOST_ROWS = 1000
MOST_S = 30.0
_KEY = b"canshaper"
_TYPES = {bool: pa.bool_(), int: pa.int64(), str: pa.string(), float: pa.float64()}
# Types of the columns that may have no value, and are no measures.
_KNOWN = {"seed": pa.int64(), "operator": pa.string(), "fault": pa.string(), "why": pa.string()}


class Store:
    """The rows of one folder.

    Args:
        folder: the folder; it is made where it does not exist.
        about: identity of the drives, see ``Source.about``.

    Attributes:
        seeds: seeds of the drives that are kept, on the disk or still waiting in memory.

    Raises:
        CampaignError: the folder has drives of another identity, or cannot be made or read.
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
        """Add rows, but none of a drive that is kept already; now and then ``flush`` them."""
        for row in rows:
            if row["seed"] not in self.seeds:
                self.seeds.add(row["seed"])
                self._rows.append(row)
        if len(self._rows) >= MOST_ROWS or monotonic() - self._flushed_s >= MOST_S:
            self.flush()

    def flush(self) -> None:
        """Write the waiting rows to the disk, all or none; drop those that others have stored.

        Raises:
            CampaignError: the disk refuses them, or the folder has got drives of another identity.
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
        # Readers pass over this name, and no other process uses it.
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
        """Add the rows of another folder and write them; return how many were new.

        Raises:
            CampaignError: its drives have another identity, or it has none.
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
        """Return columns (``names``, or all) of the rows on disk, ordered by seed; {} without."""
        tables = [_read(path, names) for path in parts(self.folder)]
        if not tables:
            return {}
        table = pa.concat_tables(tables, promote_options="default").sort_by("seed")
        return {name: table[name].to_pylist() for name in table.column_names}

    def _look(self) -> set[int]:
        """Return the seeds of the files that are new: another campaign may write here too."""
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
    """Return the Parquet files of a folder, ordered by name."""
    return sorted(folder.glob("drives-*.parquet"))


def _read(path: Path, names: Sequence[str] | None = None) -> Any:
    try:
        return pq.read_table(path, columns=None if names is None else [*names])
    except (OSError, pa.ArrowException) as error:
        raise CampaignError(f"{path}: {str(error).splitlines()[0]}") from None


def _type(rows: list[dict[str, Any]], name: str) -> Any:
    """Return the type of a column: that of its first value, a float where it has none."""
    values: Iterator[Any] = (row[name] for row in rows if row[name] is not None)
    return _TYPES[type(next(values, 0.0))]


def _differs(expected: str, kept: str) -> str:
    """Return the first difference between two identities, for an error message."""
    ours, theirs = json.loads(expected), json.loads(kept) if kept else {}
    keys = [key for key in ours if ours[key] != theirs.get(key)]
    key = keys[0] if keys else "file"
    return f"{key} {ours.get(key)}, got {theirs.get(key, 'none')}; choose another --out"
