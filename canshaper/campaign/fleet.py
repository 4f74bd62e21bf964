"""Filters for a fleet: the worst drives of a campaign leave least.

``robust`` and ``tune`` cover a box of lengths, each of them alike. A fleet is what the section
"uncertainty" draws: lengths, damping, loads that are picked up, valves, operators. Its candidates
are designs of every swinging axis, for a middle and a range of lengths. Each drives the same
drives, in C, and that one is taken whose worst twentieth leaves least on average: fewer drives
settle that than their 99th percentile, which falls with it. Drives that no candidate has seen judge
it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial

from canshaper.campaign.draw import Setting, draw_drive
from canshaper.campaign.fleet_filters import (
    GFF,
    ROBUST,
    Candidate,
    FleetFilter,
    designed,
    fitted,
    swinging,
)
from canshaper.campaign.native import NativeCrane
from canshaper.campaign.run import Source, loaded
from canshaper.config.limits import Sway
from canshaper.design.parallel import Processes
from canshaper.errors import DesignError, InfeasibleError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.report.console import OnProgress
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.recorder import dwell_s

# Seeds of the drives that choose and of those that judge; a campaign begins with 0.
CHOOSING = range(1_000_000, 1_000_400)
JUDGING = range(2_000_000, 2_001_000)
# Share of the worst drives whose mean is to be least.
_WORST = 0.05
# Option of the run-on.
_OPTIONS = {ROBUST: "--duration", GFF: "--max-run-on"}
# Candidates: middle as a part of the way from the shortest length to the longest, and range, on
# which a G_FF that its run-on holds does not depend.
_MIDDLES = (0.15, 0.3, 0.45)
_RANGES = {ROBUST: (0.1, 0.2, 0.3), GFF: (0.2,)}
_BEFORE = 0.9  # of the time from which on swing is left: what runs on longer swings then
_DURATIONS = (0.8, 0.9, 1.0, 1.1, 1.2)  # of the front, of the run-on that is asked for


@dataclass(frozen=True)
class Driven:
    """Drives of a candidate.

    Attributes:
        candidate: it; None for the file as it is.
        filters: of each swinging axis.
        left_deg: residual swing of each drive; of one that swings over its largest.
        run_on_s: of each drive, until the tip stands.
        why: there are no such filters, and so no drives.
    """

    candidate: Candidate | None
    filters: Sequence[FleetFilter] = ()
    left_deg: list[float] = field(default_factory=list)
    run_on_s: list[float] = field(default_factory=list)
    why: str = ""

    @property
    def worst_deg(self) -> float:
        """Mean of what the worst drives leave."""
        count = math.ceil(_WORST * len(self.left_deg))
        return math.fsum(sorted(self.left_deg)[-count:]) / count


FILE, BOX, FLEET, OTHER = "the file", "box of lengths", "for the fleet", "fleet, robust"
Rows = Mapping[str, Sequence[Driven]]
"""Of the file, of the box of all lengths, of the best of each run-on, and next to G_FF of the best
robust shapers; some may be none."""
Known = Mapping[Candidate | None, Sequence[FleetFilter]]


def design_fleet(
    deployment: Deployment,
    kind: str,
    duration_s: float | None,
    workers: Processes,
    on_progress: OnProgress,
    *,
    front: bool = True,
) -> tuple[Driven, Rows]:
    """Design the filters of all swinging axes for the fleet of the file.

    G_FF stands next to robust shapers of the run-on that is asked for.

    Args:
        deployment: the machine.
        kind: of the filters, robust or gff.
        duration_s: see ``Candidate``; None for that of the file's responses, or one swing, and of
            G_FF a little less than the time from which on swing counts as left.
        workers: drive the candidates.
        on_progress: called with the part that is done.
        front: quicker and slower ones too.

    Returns:
        The design, and all rows, as the drives judge them that it has not seen.

    Raises:
        ConfigError: the C has no part for the machine.
        DesignError: no axis can be designed so.
        NativeError: no C can be compiled.
        UsageError: the tail is shorter than the run-on, or there is no such filter.
    """
    axes, option = swinging(deployment), _OPTIONS[kind]
    NativeCrane(deployment)  # its faults are named before anything begins
    longest_s = min(deployment.axes[name].config.limits.tail_s for name in axes)
    usual_s = _BEFORE * dwell_s(deployment) if kind == GFF else _duration_s(deployment, axes)
    asked_s = duration_s or min(longest_s, usual_s)
    if asked_s > longest_s:
        text = f"expected up to the tail_s of the file, {longest_s:g} s, got {asked_s:g} s"
        raise UsageError(f"{option}: {text}")
    low, high = _lengths(deployment)
    parts = _DURATIONS if front else [1.0]
    durations = [one for part in parts if (one := part * asked_s) <= longest_s]
    groups = {(kind, one): [*_grid(kind, low, high, one)] for one in durations}
    groups[ROBUST, asked_s] = [*_grid(ROBUST, low, high, asked_s)]
    grid = [one for group in groups.values() for one in group]
    count = len(grid) + len(groups) + 2  # of those that are judged: the file and the box
    source, done = Source.of(deployment, deployment.config.uncertainty), 0

    def drive(
        seeds: range, jobs: Sequence[Candidate | None], known: Known
    ) -> dict[Candidate | None, Driven]:
        nonlocal done
        driven = {}
        for job, one in workers.run(partial(_driven, source, seeds, known), jobs):
            driven[job] = one
            done += 1
            on_progress(done / count)
        return driven

    chosen = drive(CHOOSING, grid, {})
    able = [[one for one in group if not chosen[one].why] for group in groups.values()]
    best = [min(some, key=lambda one: chosen[one].worst_deg) for some in able if some]
    own = [one for one in best if one.kind == kind]
    if not (asked := [one for one in own if one.duration_s == asked_s]):
        raise UsageError(f"{option}: {chosen[groups[kind, asked_s][0]].why}")
    box = Candidate(kind, low, high, asked_s)
    jobs, count = [None, box, *best], done + 2 + len(best)
    judged = drive(JUDGING, jobs, {one: chosen[one].filters for one in best})
    rows: dict[str, list[Candidate | None]] = {FILE: [None], BOX: [box], FLEET: [*own]}
    rows[OTHER] = [one for one in best if one.kind != kind]
    shown = {name: [judged[one] for one in of if not judged[one].why] for name, of in rows.items()}
    return judged[asked[0]], shown


def _grid(kind: str, low: float, high: float, duration_s: float) -> Iterator[Candidate]:
    for part in _MIDDLES:
        middle = low + part * (high - low)
        for r in _RANGES[kind]:
            yield Candidate(kind, middle * (1 - r), middle * (1 + r), duration_s)


def _duration_s(deployment: Deployment, axes: Mapping[str, Sway]) -> float:
    """Longest response in the file, or one swing where none says how long it is."""
    made = (deployment.axes[name].config.filter.design() for name in axes)
    own = [one.duration_s for one in made if one and one.duration_s]
    return max(own, default=max(sway.mode().period_s for sway in axes.values()))


def _lengths(deployment: Deployment) -> tuple[float, float]:
    """Shortest and longest pendulum of the drives that choose, as parts of the nominal one."""
    nominal = changed_parameters([], deployment)
    lengths = []
    for seed in CHOOSING:
        options = draw_drive(deployment, seed, deployment.config.uncertainty, nominal).options
        parameters = options["parameters"]
        assert parameters
        hanging = [parameters.grapple, *(one for _, one in options.get("loads", ()))]
        lengths += [one.l2_m / nominal.grapple.l2_m for one in hanging]
    return min(lengths), max(lengths)


def _driven(
    source: Source,
    seeds: range,
    known: Known,
    candidate: Candidate | None,
) -> Driven:
    """Drive a candidate; one whose filters are not known is designed first."""
    deployment, filters = source.load(), known.get(candidate)
    if candidate:
        try:
            axes = swinging(deployment)
            filters = filters or [designed(deployment, name, candidate) for name in axes]
        except InfeasibleError as error:
            return Driven(candidate, why=str(error))
        deployment = fitted(deployment, filters)
    made = Driven(candidate, filters or ())
    native, nominal = NativeCrane(deployment, keeps=False), changed_parameters([], deployment)
    for one in _drives(source.path, source.files, seeds):
        measures, over = native.drive(one, nominal)
        left_deg, run_on_s = measures["peak_deg" if over else "residual_deg"], measures["run_on_s"]
        if left_deg is not None and run_on_s is not None:
            made.left_deg.append(left_deg)
            made.run_on_s.append(run_on_s)
    return made


@cache
def _drives(path: str, files: tuple[tuple[str, bytes], ...], seeds: range) -> list[Setting]:
    """Drives without a fault of bus or sensor, drawn once in a process."""
    deployment = loaded(path, files)
    native, nominal = NativeCrane(deployment), changed_parameters([], deployment)
    drawn = [draw_drive(deployment, s, deployment.config.uncertainty, nominal) for s in seeds]
    drives = [one for one in drawn if not one.fault and native.has(one)]
    if not drives:
        text = "expected drives that the C has all parts for, got none"
        raise DesignError(f"--fleet: uncertainty: {text}")
    return drives
