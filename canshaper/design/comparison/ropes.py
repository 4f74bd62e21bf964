"""Comparison of filters on the same work of a crane with a rope, by the length of the rope.

A crane without a rope-length signal is driven with the length in the file, and 10 % off it.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

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
from canshaper_sim.axes import (
    BRIDGE,
    EXTENSION,
    HOIST,
    LIFT_CYLINDER,
    LUFFING,
    LUFFING_AXES,
    NEAR_FAR,
    ON_ROPE,
    OVERHEAD,
    SLEW,
    TOWER,
    TROLLEY,
    WITHOUT_SWAY,
    kind_of,
)
from canshaper_sim.machines import AXES_OF
from canshaper_sim.operator import random_script
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.recorder import dwell_s
from canshaper_sim.strokes import Script, Stroke

ROPES_M = (2.0, 5.0, 10.0, 25.0)
# (rope, radius) of a tower crane at the start, m.
PLACES_M = ((10.0, 40.0), (30.0, 20.0), (30.0, 40.0), (30.0, 60.0), (50.0, 40.0))
# The rope that a filter is made for which follows none.
_FOR_M = {OVERHEAD: 8.0, TOWER: 20.0, LUFFING: 8.0}
_LUFFING_ROPES_M, _SEEDS, _RANDOM_S = (4.0, 8.0, 16.0), 3, 30.0
# Nobody waits longer than a swing to see what is left.
_LONGEST_LOOK_S = 11.0


@dataclass(frozen=True)
class RopeFilter:
    """A filter of the axes that swing the load.

    Attributes:
        name: name of the filter in the table.
        filters: by axis; empty for the filters of the file.
        rope_m: fixed length that the filter is made for, m; None: that of the file, or measured.
        bypass: drive with anti-sway off.
    """

    name: str
    filters: dict[str, Filter]
    rope_m: float | None = None
    bypass: bool = False


@dataclass(frozen=True)
class Work:
    """Work that each filter does.

    Attributes:
        name: its column of the table, such as ``5 m hoisted``.
        rope_m: length of the rope at the start, m.
        strokes: strokes of the joysticks, by coordinate.
        radius_m: radius of a tower crane at the start, m.
    """

    name: str
    rope_m: float
    strokes: tuple[Stroke, ...]
    radius_m: float | None = None


def on_rope(deployment: Deployment) -> str | None:
    """Return the kind of crane if its load hangs from a rope, else None."""
    kind = kind_of(deployment.coordinates.values())
    return kind if kind in ON_ROPE else None


def rope_filters(deployment: Deployment) -> list[RopeFilter]:
    """Return the filters to compare.

    Raises:
        DesignError: the deployment lacks an axis that swings the load, or its sway data.
    """
    by_coordinate = deployment.by_coordinate
    kind = kind_of(by_coordinate)
    axes = [one for one in AXES_OF[kind] if one not in WITHOUT_SWAY]
    if missing := [one for one in axes if one not in by_coordinate]:
        names = f"{', '.join(axes[:-1])} and {axes[-1]}"
        raise DesignError(f"expected {names} in crane, without {missing[0]}")
    measured = is_measured(deployment)
    rope_m, by_length = (_FOR_M[kind], " by length") if measured else (None, "")
    zvd, zv, gff = dict[str, Filter](), dict[str, Filter](), dict[str, Filter]()
    two_mode = dict[str, Filter]()
    for axis in (by_coordinate[one] for one in axes):
        sway = swinging_axis(deployment, axis)[1]
        mode, period_s = sway.mode(), tick_s(deployment, axis)
        taps = [round(tap, 8) for tap in zv_taps(mode, period_s)]
        zvd[axis] = filter_of("zvd")
        zv[axis] = filter_of("robust", tick_ms=round(1000.0 * period_s), taps=taps)
        design = deployment.axes[axis].config.filter.design()
        if design and (second := design.second):
            swing = {"period_s": second.period_s, "damping_ratio": second.damping_ratio}
            two_mode[axis] = filter_of("two_mode", **swing)
        omega = mode.omega_rad_s
        gff[axis] = filter_of("gff", a1=2.000001 / omega, a2=1.0 / omega**2)
    return [
        RopeFilter("off", {}, bypass=True),
        RopeFilter(f"ZVD for {rope_m:g} m" if rope_m else "ZVD", zvd, rope_m=rope_m),
        RopeFilter(f"ZV{by_length}", zv),
        *([RopeFilter("ZV of both modes", two_mode)] if two_mode else ()),
        RopeFilter(f"G_FF{by_length}", gff),
        RopeFilter("the file's", {}),
    ]


def is_measured(deployment: Deployment) -> bool:
    """Return whether any axis follows a rope-length signal."""
    return any(axis.rope for axis in deployment.axes.values())


def _nominal_m(deployment: Deployment) -> float:
    """Return the length of the simulated crane's rope at the start, m."""
    crane: Any = getattr(changed_parameters([], deployment), kind_of(deployment.by_coordinate))
    rope_m: float = crane.rope_m
    return rope_m


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


def works(deployment: Deployment) -> Iterator[Work]:
    """Yield a crane's work for each rope: of constant length, or hoisted in or after travel."""
    kind = kind_of(deployment.by_coordinate)
    if kind == TOWER:
        for rope_m, radius_m in PLACES_M:
            yield from _of_tower(rope_m, radius_m)
        return
    if kind == LUFFING:
        for rope_m in _LUFFING_ROPES_M:
            for name, strokes in _of_luffing():
                yield Work(f"{rope_m:g} m {name}", rope_m, strokes)
        return
    nominal_m, hoists = _nominal_m(deployment), HOIST in deployment.by_coordinate
    wrong = 0.9 * nominal_m, nominal_m, 1.1 * nominal_m
    for rope_m in ROPES_M if is_measured(deployment) else wrong:
        for name, *own in _of_bridge(rope_m, hoists):
            yield Work(f"{rope_m:g} m {name}", rope_m, tuple(own))


def _of_bridge(rope_m: float, hoists: bool) -> Iterator[tuple[Any, ...]]:
    up = 1.0 if rope_m >= 4.0 else -1.0
    hoist_s = min(6.0, 1.8 * rope_m - 3.0) if up > 0.0 else 5.0
    travel = Stroke(BRIDGE, 0.5, 6.0, 1.0)
    both = (travel, Stroke(TROLLEY, 2.0, 5.0, 1.0))
    yield "still", travel
    yield "still", Stroke(BRIDGE, 0.5, 4.0, 1.0), Stroke(BRIDGE, 4.5, 4.0, -1.0)
    yield "still", Stroke(TROLLEY, 0.5, 0.3, 1.0)
    yield "still", *both
    if not hoists:
        return
    yield "hoisted", *both, Stroke(HOIST, 2.0, hoist_s, up)
    yield "hoisted", travel, Stroke(HOIST, 3.0, 8.0, -1.0)
    yield "hoisted", travel, Stroke(HOIST, 6.7, hoist_s, up)


def _of_tower(rope_m: float, radius_m: float) -> Iterator[Work]:
    """Yield slew and trolley together, reversed, each alone; and hoisting in or after travel."""
    out = 1.0 if radius_m < 50.0 else -1.0
    turn, run = Stroke(SLEW, 0.5, 10.0, 1.0), Stroke(NEAR_FAR, 2.5, 8.0, out)
    back = Stroke(SLEW, 6.5, 6.0, -1.0)
    still = (
        (turn, run),
        (Stroke(SLEW, 0.5, 6.0, 1.0), back, Stroke(NEAR_FAR, 3.0, 6.0, out)),
        (turn,),
        (Stroke(NEAR_FAR, 0.5, 0.6, out),),
    )
    hoist = 1.0 if rope_m > 20.0 else -1.0
    hoisted = (
        (turn, run, Stroke(HOIST, 3.0, 8.0, hoist)),
        (turn, run, Stroke(HOIST, 10.5, 8.0, hoist)),
    )
    for name, each in (("still", still), ("hoisted", hoisted)):
        for strokes in each:
            yield Work(f"{rope_m:g} m at {radius_m:g} m {name}", rope_m, strokes, radius_m)


def _of_luffing() -> Iterator[tuple[str, tuple[Stroke, ...]]]:
    """Yield pulse and reversal of each axis, all axes at once, and random operators."""
    for axis, press_s in ((SLEW, 8.0), (LIFT_CYLINDER, 5.0), (EXTENSION, 6.0)):
        yield "pulse", (Stroke(axis, 0.5, press_s, 1.0),)
        half_s = 0.5 * press_s + 1.0
        yield "reversal", (Stroke(axis, 0.5, half_s, 1.0), Stroke(axis, 0.5 + half_s, half_s, -1.0))
    for luff in (1.0, -1.0):
        luffs, out = Stroke(LIFT_CYLINDER, 2.0, 4.0, luff), Stroke(EXTENSION, 3.0, 5.0, 1.0)
        yield "all", (Stroke(SLEW, 0.5, 8.0, 1.0), luffs, out)
    for seed in range(_SEEDS):
        yield "random", random_script(seed, _RANDOM_S, LUFFING_AXES).strokes


Job = tuple[RopeFilter, Work]


def left_deg(deployment: Deployment, job: Job) -> float:
    """Drive the work of a job with its filter; return the largest swing after the dwell, deg."""
    (one, work), crane = job, changed_parameters([], deployment)
    strokes, rope_m = work.strokes, work.rope_m
    end_s = max(stroke.end_s for stroke in strokes) + dwell_s(deployment)
    look_s = min(2.0 * math.pi * math.sqrt(max(rope_m, 8.0) / GRAVITY_M_S2), _LONGEST_LOOK_S)
    script = Script("rope", strokes, end_s + look_s).moving(deployment.by_coordinate)
    kind, start = kind_of(deployment.by_coordinate), {"rope_m": rope_m}
    if work.radius_m is not None:
        start["start_radius_m"] = work.radius_m
    own: Any = {kind: replace(getattr(crane, kind), **start)}
    crane = replace(crane, **own)
    recording = drive(_with(deployment, one), script, parameters=crane, bypass=one.bypass)
    assert recording.crane is not None  # its feedback has both planes
    swing = zip(recording.t_s, recording.crane.sway_deg, strict=True)
    return max(deg for time_s, deg in swing if time_s >= end_s)


def compare_ropes(
    deployment: Deployment, on_progress: Callable[[float], None], processes: int | None = None
) -> dict[str, dict[str, float]]:
    """Return filter -> name of the work -> the largest swing that the filter leaves, degrees."""
    jobs: list[Job] = [
        (one, work) for one in rope_filters(deployment) for work in works(deployment)
    ]
    table: dict[str, dict[str, float]] = {one.name: {} for one, _ in jobs}
    for one, work in jobs:
        table[one.name][work.name] = 0.0
    done = Processes(processes).run(partial(_left, deployment.path), jobs)
    for count, ((one, work), left) in enumerate(done, 1):
        row = table[one.name]
        row[work.name] = max(row[work.name], left)
        on_progress(count / len(jobs))
    return table


def _left(file: Path, job: Job) -> float:
    return left_deg(_deployment(file), job)


@cache  # loaded once a process
def _deployment(file: Path) -> Deployment:
    return load_deployment(file)
