"""A campaign: which drives there are, who drives them, and what is kept of them."""

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

# Drives in one piece of work: a second of it.
_DRIVES = 16
Seeds = tuple[int, ...]


@dataclass(frozen=True)
class Source:
    """A deployment as it is sent to where it is driven.

    Attributes:
        path: of the deployment file.
        files: content of it and of its DBC files, by their absolute paths.
        ranges: from which its cranes are drawn; of two files that are compared, those of the first.
        changes: parameters of the nominal crane, NAME=VALUE.
        engine: native or python; what C has no part for is Python's.
        longest_s: longest ``dwell_s`` of the files that are compared; see ``draw_drive``.
        unit: FMU in place of the crane.
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
        """Read the files of a deployment."""
        path = deployment.path.absolute()  # links stay: the DBC files are named from there
        paths = [path, *(path.parent / name for name in deployment.config.dbc)]
        files = tuple((str(one), one.read_bytes()) for one in paths)
        return cls(str(path), files, ranges, tuple(changes), engine, longest_s)

    def load(self) -> Deployment:
        """Load the deployment, once in a process."""
        return loaded(self.path, self.files)

    def native(self) -> NativeCrane | ConfigError | None:
        """Controller and crane in C, once in a process; why not, or None without ``engine``.

        Raises:
            NativeError: it cannot be compiled here, or its arithmetic is another one.
        """
        return _native(self.path, self.files) if self.engine == "native" else None

    @property
    def about(self) -> dict[str, Any]:
        """Identity of the drives: only drives with the same identity go together."""
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
    """The deployment, once in a process: from where it lies, or elsewhere from what was sent."""
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
    """Draw, drive and measure each of some drives; the one named ``both`` by both engines."""
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
    """One of N shares of a campaign, I/N; all of it without one.

    Raises:
        CampaignError: there is no such share, or no drive in it.
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
    """Make every drive that is not kept yet, and keep it; what is done is kept however it ends.

    Args:
        engine: who drives.
        source: what is driven.
        seeds: the drives.
        store: where they are kept.
        on_progress: called with the number of drives that are done.

    Raises:
        CampaignError: the engine cannot go on, or the disk takes no more.
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
