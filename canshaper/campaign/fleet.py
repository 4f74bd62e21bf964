"""Filters for a fleet: the design whose worst drives of a campaign leave the least swing.

``robust`` and ``tune`` weigh all lengths of a range alike. A fleet is what the section
"uncertainty" draws: lengths, damping, loads, valves, operators. A candidate is a design of every
swinging axis for one range of lengths. All candidates do the same drives, in C. The best one has
the least mean residual swing over its worst twentieth: this mean needs fewer drives than the 99th
percentile, and falls with it. Other drives, which chose no candidate, judge the best one.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial

from canshaper.campaign.draw import Setting, draw_drive
from canshaper.campaign.fleet_candidates import (
    BOX,
    CHOOSING,
    FILE,
    FLEET,
    GFF,
    JUDGING,
    OTHER,
    ROBUST,
    Candidate,
    Driven,
    FleetFilter,
    Rows,
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

# Option of the command line that sets the run-on.
_OPTIONS = {ROBUST: "--duration", GFF: "--max-run-on"}
# Candidates: middle, 0 at the shortest length and 1 at the longest, and half the range as a part of
# the middle. A G_FF whose run-on is given does not depend on the range: it has one.
_MIDDLES = (0.15, 0.3, 0.45)
_RANGES = {ROBUST: (0.1, 0.2, 0.3), GFF: (0.2,)}
_BEFORE = 0.9  # of dwell_s: what runs on longer is counted as residual swing
_DURATIONS = (0.8, 0.9, 1.0, 1.1, 1.2)  # run-ons of the front, of the one asked for


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

    A G_FF is compared with robust shapers of the same run-on.

    Args:
        kind: kind of the filters, robust or gff.
        duration_s: see ``Candidate``. None: of robust the longest response in the file, or one
            swing; of G_FF a little less than ``dwell_s``; up to the shortest ``tail_s``.
        workers: processes that drive the candidates.
        on_progress: called with the part that is done, 0 to 1.
        front: also design for shorter and longer run-ons.

    Returns:
        The design, and all rows, measured over the drives that judge.

    Raises:
        ConfigError: the C does not support the machine.
        DesignError: no axis swings, or one has several filters or a rope; or the C has no drives.
        NativeError: the C cannot be compiled.
        UsageError: the run-on exceeds ``tail_s``, or no filter keeps it.
    """
    axes, option = swinging(deployment), _OPTIONS[kind]
    NativeCrane(deployment)  # raises its errors before any work begins
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
    count = len(grid) + len(groups) + 2  # 2: the file and the box are only judged
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
    """Return the longest response in the file, or one swing where no filter states its length."""
    made = (deployment.axes[name].config.filter.design() for name in axes)
    own = [one.duration_s for one in made if one and one.duration_s]
    return max(own, default=max(sway.mode().period_s for sway in axes.values()))


def _lengths(deployment: Deployment) -> tuple[float, float]:
    """Return the shortest and the longest drawn pendulum, as parts of the nominal length."""
    nominal = changed_parameters([], deployment)
    lengths = []
    for seed in CHOOSING:
        options = draw_drive(deployment, seed, deployment.config.uncertainty, nominal).options
        parameters = options["parameters"]
        assert parameters
        hanging = [parameters.grapple, *(one for _, one in options.get("loads", ()))]
        lengths += [one.l2_m / nominal.grapple.l2_m for one in hanging]
    return min(lengths), max(lengths)


def _driven(source: Source, seeds: range, known: Known, candidate: Candidate | None) -> Driven:
    """Drive a candidate; design its filters first where ``known`` lacks them."""
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
    """Return the drives without a fault that the C supports; each process draws them once.

    Raises:
        DesignError: there is none.
    """
    deployment = loaded(path, files)
    native, nominal = NativeCrane(deployment), changed_parameters([], deployment)
    drawn = [draw_drive(deployment, s, deployment.config.uncertainty, nominal) for s in seeds]
    drives = [one for one in drawn if not one.fault and native.has(one)]
    if not drives:
        text = "expected drives that the C has all parts for, got none"
        raise DesignError(f"--fleet: uncertainty: {text}")
    return drives
