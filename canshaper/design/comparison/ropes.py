"""Filters of an overhead crane on the same work, by the length of its rope.

A rope without a length signal is compared as long as the file says, and a tenth wrong.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

from canshaper.config.filters import Filter, filter_of
from canshaper.design.comparison.manoeuvres import tick_s
from canshaper.design.lockstep import drive
from canshaper.design.parallel import Processes
from canshaper.design.profiles import swinging_axis
from canshaper.errors import DesignError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.shapers.fir import zv_taps
from canshaper.shaping.sway import GRAVITY_M_S2
from canshaper_sim.axes import BRIDGE, HOIST, OVERHEAD, TROLLEY, kind_of
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.recorder import dwell_s
from canshaper_sim.strokes import Script, Stroke

ROPES_M = (2.0, 5.0, 10.0, 25.0)
# Nobody waits longer than a swing to see what is left.
_LONGEST_LOOK_S = 11.0


@dataclass(frozen=True)
class RopeFilter:
    """A filter of bridge and trolley.

    Attributes:
        name: for the table.
        filters: by axis; empty for those of the file.
        rope_m: a length that it is made for, whatever the rope; None: it follows the rope.
        bypass: with anti-sway off.
    """

    name: str
    filters: dict[str, Filter]
    rope_m: float | None = None
    bypass: bool = False


def is_overhead(deployment: Deployment) -> bool:
    """Whether its axes move a bridge, a trolley or a hoist."""
    return kind_of(deployment.coordinates.values()) == OVERHEAD


def rope_filters(deployment: Deployment) -> list[RopeFilter]:
    """Return what is compared.

    Raises:
        DesignError: bridge or trolley is missing.
    """
    by_coordinate = deployment.by_coordinate
    if missing := [one for one in (BRIDGE, TROLLEY) if one not in by_coordinate]:
        raise DesignError(f"expected bridge and trolley in crane, without {missing[0]}")
    nominal_m = changed_parameters([], deployment).overhead.rope_m
    by_length = " by length" if is_measured(deployment) else ""
    zvd, zv, gff = dict[str, Filter](), dict[str, Filter](), dict[str, Filter]()
    for axis in (by_coordinate[BRIDGE], by_coordinate[TROLLEY]):
        sway = swinging_axis(deployment, axis)[1]
        mode, period_s = sway.mode(), tick_s(deployment, axis)
        taps = [round(tap, 8) for tap in zv_taps(mode, period_s)]
        zvd[axis] = filter_of("zvd")
        zv[axis] = filter_of("robust", tick_ms=round(1000.0 * period_s), taps=taps)
        omega = mode.omega_rad_s
        gff[axis] = filter_of("gff", a1=2.000001 / omega, a2=1.0 / omega**2)
    return [
        RopeFilter("off", {}, bypass=True),
        RopeFilter(f"ZVD for {nominal_m:g} m", zvd, rope_m=nominal_m),
        RopeFilter(f"ZV{by_length}", zv),
        RopeFilter(f"G_FF{by_length}", gff),
        RopeFilter("the file's", {}),
    ]


def is_measured(deployment: Deployment) -> bool:
    """Whether an axis follows the length of the rope."""
    return any(axis.rope for axis in deployment.axes.values())


def ropes_m(deployment: Deployment) -> tuple[float, ...]:
    """Return the ropes with which filters are compared."""
    if is_measured(deployment):
        return ROPES_M
    nominal_m = changed_parameters([], deployment).overhead.rope_m
    return 0.9 * nominal_m, nominal_m, 1.1 * nominal_m


def _with(deployment: Deployment, one: RopeFilter) -> Deployment:
    axes = dict(deployment.axes)
    for axis, chosen in one.filters.items():
        bound, sway = axes[axis], axes[axis].config.sway
        assert sway is not None
        if one.rope_m is not None:
            other = dict.fromkeys(
                ("length", "period_s", "decay_per_swing", "damping_nms", "mass_kg")
            )
            rope = {"length_m": one.rope_m, "damping_ratio": sway.mode().damping_ratio}
            sway = sway.model_copy(update=other | rope)
        config = bound.config.model_copy(update={"filter": chosen, "sway": sway})
        measured = bound.rope if one.rope_m is None else None
        axes[axis] = replace(bound, config=config, rope=measured)
    return replace(deployment, axes=axes)


def tasks(rope_m: float, hoist: bool = True) -> Iterator[tuple[str, list[Stroke]]]:
    """Kind of work and strokes with this rope: still, or hoisted in travel and after it."""
    up = 1.0 if rope_m >= 4.0 else -1.0
    hoist_s = min(6.0, 1.8 * rope_m - 3.0) if up > 0.0 else 5.0
    travel = Stroke(BRIDGE, 0.5, 6.0, 1.0)
    both = [travel, Stroke(TROLLEY, 2.0, 5.0, 1.0)]
    yield "still", [travel]
    yield "still", [Stroke(BRIDGE, 0.5, 4.0, 1.0), Stroke(BRIDGE, 4.5, 4.0, -1.0)]
    yield "still", [Stroke(TROLLEY, 0.5, 0.3, 1.0)]
    yield "still", both
    if not hoist:
        return
    yield "hoisted", [*both, Stroke(HOIST, 2.0, hoist_s, up)]
    yield "hoisted", [travel, Stroke(HOIST, 3.0, 8.0, -1.0)]
    yield "hoisted", [travel, Stroke(HOIST, 6.7, hoist_s, up)]


Job = tuple[RopeFilter, float, str, list[Stroke]]


def left_deg(deployment: Deployment, job: Job) -> float:
    """Swing that is left of a drive, degrees."""
    one, rope_m, _, strokes = job
    end_s = max(stroke.end_s for stroke in strokes) + dwell_s(deployment)
    look_s = min(2.0 * math.pi * math.sqrt(max(rope_m, 8.0) / GRAVITY_M_S2), _LONGEST_LOOK_S)
    script = Script("rope", tuple(strokes), end_s + look_s).moving(deployment.by_coordinate)
    crane = changed_parameters([], deployment)
    crane = replace(crane, overhead=replace(crane.overhead, rope_m=rope_m))
    recording = drive(_with(deployment, one), script, parameters=crane, bypass=one.bypass)
    assert recording.crane is not None  # of an overhead crane
    swing = zip(recording.t_s, recording.crane.sway_deg, strict=True)
    return max(deg for time_s, deg in swing if time_s >= end_s)


def compare_ropes(
    deployment: Deployment, on_progress: Callable[[float], None], processes: int | None = None
) -> dict[str, dict[str, float]]:
    """Largest swing that each filter leaves, degrees, by rope and work, such as ``5 m hoisted``."""
    jobs: list[Job] = [
        (one, rope_m, work, strokes)
        for one in rope_filters(deployment)
        for rope_m in ropes_m(deployment)
        for work, strokes in tasks(rope_m, HOIST in deployment.by_coordinate)
    ]
    table: dict[str, dict[str, float]] = {job[0].name: {} for job in jobs}
    for one, rope_m, work, _ in jobs:
        table[one.name][f"{rope_m:g} m {work}"] = 0.0
    done = Processes(processes).run(partial(_left, deployment.path), jobs)
    for count, ((one, rope_m, work, _), left) in enumerate(done, 1):
        cell, row = f"{rope_m:g} m {work}", table[one.name]
        row[cell] = max(row[cell], left)
        on_progress(count / len(jobs))
    return table


def _left(file: Path, job: Job) -> float:
    return left_deg(_deployment(file), job)


@cache  # loaded once a process
def _deployment(file: Path) -> Deployment:
    return load_deployment(file)
