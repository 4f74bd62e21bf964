"""Robust shapers for a fleet: the worst drives of a campaign leave least.

``robust`` covers a box of lengths, each of them alike. A fleet is what the section "uncertainty"
draws: lengths, damping, loads that are picked up, valves, operators. Its candidates are robust
designs of every swinging axis, for a middle and a range of lengths. Each drives the same drives, in
C, and that one is taken whose worst twentieth leaves least on average: fewer drives settle that
than their 99th percentile, which falls with it. Drives that no candidate has seen judge it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

from canshaper.campaign.draw import Setting, draw_drive
from canshaper.campaign.native import NativeCrane
from canshaper.campaign.run import Source, loaded
from canshaper.campaign.statistics import Quantile, quantile
from canshaper.commissioning.robust import RobustDesign, design_robust
from canshaper.config.filters import filter_of
from canshaper.config.limits import Sway
from canshaper.design.parallel import Processes
from canshaper.errors import DesignError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.report.console import OnProgress
from canshaper.shaping.sway import GRAVITY_M_S2
from canshaper_sim.parameters import changed_parameters

# Seeds of the drives that choose and of those that judge; a campaign begins with 0.
CHOOSING = range(1_000_000, 1_000_400)
JUDGING = range(2_000_000, 2_001_000)
# Share of the worst drives whose mean is to be least.
_WORST = 0.05
# Candidates: middle as a part of the way from the shortest length to the longest, and range.
_MIDDLES = (0.15, 0.3, 0.45)
_RANGES = (0.1, 0.2, 0.3)
_DURATIONS = (0.8, 0.9, 1.0, 1.1, 1.2)  # of the front, of the response that is asked for


@dataclass(frozen=True)
class Candidate:
    """Designs of all swinging axes.

    Attributes:
        low, high: pendulums that they cover, as parts of the lengths in the file.
        duration_s: of their impulse responses.
    """

    low: float
    high: float
    duration_s: float


@dataclass(frozen=True)
class FleetRow:
    """Swing that the judging drives leave.

    Attributes:
        name: of the row.
        candidate: what was designed; None for the file as it is.
        worst_deg: mean of the worst twentieth.
        p50_deg, p99_deg: quantiles, with their bounds of 95 % confidence.
    """

    name: str
    candidate: Candidate | None
    worst_deg: float
    p50_deg: Quantile
    p99_deg: Quantile


@dataclass(frozen=True)
class FleetDesign:
    """A design for a fleet.

    Attributes:
        designs: of each swinging axis.
        asked: its row.
        rows: of the file, of the box of all lengths, and of the best of each duration.
        left_out: drives of those that judge which the C has no part for.
    """

    designs: Sequence[RobustDesign]
    asked: FleetRow
    rows: Sequence[FleetRow]
    left_out: int


def swinging(deployment: Deployment) -> dict[str, Sway]:
    """Axes that are designed, with their sway data.

    Raises:
        DesignError: there is none, or one has more than one filter.
    """
    axes = {}
    for name, axis in deployment.axes.items():
        if sway := axis.config.sway:
            if axis.rope or axis.config.gain_schedule or axis.config.profiles:
                text = "expected one filter, got a rope, gain_schedule or profiles"
                raise DesignError(f"--fleet: axis {name}: {text}")
            axes[name] = sway
    if not axes:
        raise DesignError("expected an axis with sway data, got none")
    return axes


def design_fleet(
    deployment: Deployment, duration_s: float | None, workers: Processes, on_progress: OnProgress
) -> FleetDesign:
    """Design the shapers of all swinging axes for the fleet of the file.

    Args:
        deployment: the machine.
        duration_s: of the impulse responses; None for that of the file's, or one swing.
        workers: drive the candidates.
        on_progress: called with the part that is done.

    Raises:
        ConfigError: the C has no part for the machine.
        DesignError: no axis can be designed so.
        NativeError: no C can be compiled.
        UsageError: the tail is shorter than the response, or there is no such shaper.
    """
    axes = swinging(deployment)
    NativeCrane(deployment)  # its faults are named before anything begins
    longest_s = min(deployment.axes[name].config.limits.tail_s for name in axes)
    asked_s = duration_s or min(longest_s, _duration_s(deployment, axes))
    if asked_s > longest_s:
        text = f"expected up to the tail_s of the file, {longest_s:g} s, got {asked_s:g} s"
        raise UsageError(f"--duration: {text}")
    low, high = _lengths(deployment)
    durations = [one for part in _DURATIONS if (one := part * asked_s) <= longest_s]
    grid = [one for duration in durations for one in _grid(low, high, duration)]
    count = len(grid) + len(durations) + 2  # of those that are judged: the file and the box
    done = 0

    def drive(
        seeds: range, jobs: Sequence[Candidate | None]
    ) -> dict[Candidate | None, list[float]]:
        nonlocal done
        left = {}
        for job, one in workers.run(partial(_left, Source.of(deployment, ranges), seeds), jobs):
            left[job] = one
            done += 1
            on_progress(done / count)
        return left

    ranges = deployment.config.uncertainty
    chosen = drive(CHOOSING, grid)
    by_duration = [[c for c in grid if c.duration_s == one] for one in durations]
    front = [min(some, key=lambda c: _worst_deg(chosen[c])) for some in by_duration]
    jobs = [None, Candidate(low, high, asked_s), *front]
    left = drive(JUDGING, jobs)
    names = ["the file", "box of lengths", *["for the fleet"] * len(front)]
    rows = [
        FleetRow(
            name, job, _worst_deg(left[job]), quantile(left[job], 0.5), quantile(left[job], 0.99)
        )
        for name, job in zip(names, jobs, strict=True)
    ]
    asked = durations.index(asked_s)
    designs = _designs(deployment, front[asked])
    return FleetDesign(designs, rows[2 + asked], rows, len(JUDGING) - len(left[None]))


def _grid(low: float, high: float, duration_s: float) -> Iterator[Candidate]:
    for part in _MIDDLES:
        middle = low + part * (high - low)
        yield from (Candidate(middle * (1 - r), middle * (1 + r), duration_s) for r in _RANGES)


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


def _worst_deg(left: Sequence[float]) -> float:
    count = math.ceil(_WORST * len(left))
    return math.fsum(sorted(left)[-count:]) / count


def _designs(deployment: Deployment, candidate: Candidate) -> list[RobustDesign]:
    designs = []
    for name, sway in swinging(deployment).items():
        length_m = GRAVITY_M_S2 / sway.mode().omega_rad_s ** 2
        ends = candidate.low * length_m, candidate.high * length_m
        one = design_robust(deployment, name, lengths_m=ends, duration_s=candidate.duration_s)
        designs.append(one)
    return designs


def fitted(deployment: Deployment, designs: Sequence[RobustDesign]) -> Deployment:
    """The machine with these shapers, and with the swing that they are for."""
    axes = dict(deployment.axes)
    for one in designs:
        bound = axes[one.bound.name]
        assert bound.config.sway
        sway = bound.config.sway.model_copy(update=one.task.sway)
        changes = {"filter": filter_of(**one.section), "sway": sway}
        axes[bound.name] = replace(bound, config=bound.config.model_copy(update=changes))
    return replace(deployment, axes=axes)


def _left(source: Source, seeds: range, candidate: Candidate | None) -> list[float]:
    """Residual swing of each drive, deg; of one that swings over its largest."""
    deployment = source.load()
    if candidate:
        deployment = fitted(deployment, _designs(deployment, candidate))
    native, nominal = NativeCrane(deployment, keeps=False), changed_parameters([], deployment)
    driven = (native.drive(one, nominal) for one in _drives(source.path, source.files, seeds))
    left = (one["peak_deg" if over else "residual_deg"] for one, over in driven)
    return [one for one in left if one is not None]


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
