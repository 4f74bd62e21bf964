"""Run a campaign: choose the drives, drive them, keep their rows."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from hashlib import sha256
from itertools import islice
from pathlib import Path
from typing import Any

from canshaper.campaign.engine import Engine
from canshaper.campaign.measure import Row, measured_drive
from canshaper.campaign.native import NativeCrane
from canshaper.campaign.store import Store
from canshaper.config.desk import Uncertainty
from canshaper.errors import CampaignError, ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.machine.identity import program_sha256
from canshaper_sim.parameters import changed_parameters

# Drives in one job, which takes about a second.
_DRIVES = 16
Seeds = tuple[int, ...]


@dataclass(frozen=True)
class Source:
    """A deployment as it is sent to a worker.

    Attributes:
        path: path of the deployment file.
        files: content of this file and of its DBC files, by absolute path.
        ranges: ranges of the crane's parameters; of two compared files those of the first.
        changes: changed parameters of the nominal crane, NAME=VALUE.
        engine: native or python; Python drives what the C does not support.
        longest_s: longest ``dwell_s`` of the compared files; see ``draw_drive``.
        unit: path of an FMU that replaces the crane.
    """

    path: str
    files: tuple[tuple[str, bytes], ...]
    ranges: Uncertainty
    changes: tuple[str, ...] = ()
    engine: str = "python"
    longest_s: float = 0.0
    unit: Path | None = None

    @classmethod
    def of(
        cls,
        deployment: Deployment,
        ranges: Uncertainty,
        changes: Sequence[str] = (),
        engine: str = "python",
        longest_s: float = 0.0,
    ) -> "Source":
        """Read the files of a deployment; return its source with these other attributes."""
        path = deployment.path.absolute()  # links stay: the DBC files are named from there
        paths = [path, *(path.parent / name for name in deployment.config.dbc)]
        files = tuple((str(one), one.read_bytes()) for one in paths)
        return cls(str(path), files, ranges, tuple(changes), engine, longest_s)

    def load(self) -> Deployment:
        """Return the deployment; each process loads it once."""
        return loaded(self.path, self.files)

    def native(self) -> NativeCrane | ConfigError | None:
        """Return controller and crane in C; each process compiles them once.

        Returns:
            The error where the C does not support the machine; None where ``engine`` is python.

        Raises:
            NativeError: the C cannot be compiled here, or its arithmetic differs from Python's.
        """
        return _native(self.path, self.files) if self.engine == "native" else None

    @property
    def about(self) -> dict[str, Any]:
        """Identity of the drives: a folder keeps drives of one identity only."""
        unit = [sha256(self.unit.read_bytes()).hexdigest()] if self.unit else []
        content = sha256(b"".join(sha256(data).digest() for _, data in self.files)).hexdigest()
        return {
            "file": f"{Path(self.path).name} sha256:{content[:16]}",
            "program": f"sha256:{program_sha256()[:16]}",
            "ranges": self.ranges.model_dump(),
            "crane": [*self.changes, *unit],
            "residual_from_s": self.longest_s,
        }


@cache
def loaded(source_path: str, files: tuple[tuple[str, bytes], ...]) -> Deployment:
    """Return the deployment, from its own files or, where these differ, from the sent ones."""
    try:
        if all(Path(path).read_bytes() == data for path, data in files):
            return load_deployment(Path(source_path))
    except OSError:
        pass
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for path, data in files:
            place = root / path.lstrip("/")
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(data)
        return load_deployment(root / source_path.lstrip("/"))


@cache
def _native(source_path: str, files: tuple[tuple[str, bytes], ...]) -> NativeCrane | ConfigError:
    try:
        return NativeCrane(loaded(source_path, files))
    except ConfigError as error:
        return error


def drive_all(source: Source, seeds: Seeds, *, both: int = -1) -> list[Row]:
    """Drive and measure drives; return the rows. Both engines drive ``both`` and each 50th seed."""
    deployment = source.load()
    nominal = changed_parameters([*source.changes], deployment)
    native = source.native()
    c = native if isinstance(native, NativeCrane) else None
    about = source.ranges, nominal, c
    options: Any = {"longest_s": source.longest_s, "unit": source.unit}
    return [
        measured_drive(deployment, seed, *about, both=seed == both, **options) for seed in seeds
    ]


def shard_of(seeds: range, shard: str | None) -> range:
    """Return share I of N of the seeds, for a shard I/N; all of them for None.

    Raises:
        CampaignError: the shard is not I/N, or its share has no drive.
    """
    if shard is None:
        return seeds
    part, _, of = shard.partition("/")
    if not (part.isdecimal() and of.isdecimal() and 1 <= int(part) <= int(of)):
        raise CampaignError(f"--shard: expected I/N with I from 1 to N, got {shard}")
    if not (share := seeds[int(part) - 1 :: int(of)]):
        raise CampaignError(f"--shard: expected {len(seeds)} shares at most, got {shard}")
    return share


def run_campaign(
    engine: Engine,
    source: Source,
    seeds: range,
    store: Store,
    on_progress: Callable[[int], object],
) -> None:
    """Do every drive that the store lacks. It keeps the finished ones even after an error.

    Args:
        on_progress: called with the number of finished drives, those of before included.

    Raises:
        CampaignError: the engine fails, or the disk is full.
    """
    left = [seed for seed in seeds if seed not in store.seeds]
    done = len(seeds) - len(left)
    on_progress(done)
    try:
        work = partial(drive_all, source, both=next(iter(left), -1))
        for _, rows in engine.run(work, _pieces(iter(left))):
            store.add(rows)
            done += len(rows)
            on_progress(done)
    finally:
        store.flush()


def _pieces(seeds: Iterator[int]) -> Iterator[Seeds]:
    while piece := tuple(islice(seeds, _DRIVES)):
        yield piece
