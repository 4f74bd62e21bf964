"""The filters and the manoeuvres of the comparison; each filter is made for both axes.

The manoeuvres are strokes of one axis and of both axes, loading, and random joysticks.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from canshaper.config.filters import Filter, filter_of
from canshaper.design.profiles import swinging_axis
from canshaper.design.tuning.robust import least_residual
from canshaper.errors import DesignError
from canshaper.machine.deployment import Deployment
from canshaper.shaping.registry import KINDS
from canshaper.shaping.sway import SwayMode
from canshaper_sim.crane import CraneParameters
from canshaper_sim.operator import SCRIPTS, Script, Stroke, random_script

AXES = ("slew", "near_far")
# Time of the run-on that every filter is given: longer than the longest of them takes.
TAIL_S = 3.0
# Impulse responses: duration in swings of near-far, and the range of length they are made for.
DESIGNS = ((0.68, 15.0), (0.82, 15.0), (1.1, 30.0))


@dataclass(frozen=True)
class Candidate:
    """A filter of the comparison, with its name for tables.

    Attributes:
        name: name of the filter in tables.
        filters: by axis, as they would stand in a deployment file.
        ours: the filter is limit-aware, as G_FF and the robust shaper are, or the file's by load.
        motion: it runs with the two-axis motion, if the deployment has one.
        sensor: it runs with the sway sensors of the deployment.
        by_load: it is the file's own filter, with the sets of its gain schedules.
        sway: by axis, the keys of ``sway`` that differ from the file for this filter.
    """

    name: str
    filters: Mapping[str, Filter]
    ours: bool = False
    motion: bool = True
    sensor: bool = False
    by_load: bool = False
    sway: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def candidates(deployment: Deployment) -> list[Candidate]:
    """Return every filter, for slew and near-far; impulse responses suit the rates of the valves.

    Raises:
        DesignError: the deployment lacks one of these axes, or its sway data.
    """
    if not {*AXES} <= deployment.axes.keys():
        text = f"expected axes {' and '.join(AXES)}, or a crane with a rope"
        raise DesignError(f"{deployment.path}: {text}, got {', '.join(deployment.axes)}")
    modes = {axis: swinging_axis(deployment, axis)[1].mode() for axis in AXES}
    ticks_s = {axis: tick_s(deployment, axis) for axis in AXES}
    settings = [
        (kind, {axis: kind.settings(modes[axis], ticks_s[axis]) for axis in AXES})
        for kind in sorted(KINDS.values(), key=lambda kind: kind.limit_aware)
    ]
    every = [
        Candidate(
            label,
            {axis: filter_of(kind.name, **by_axis[axis][label]) for axis in AXES},
            ours=kind.limit_aware,
            motion=kind.needs_sway,  # without a model of the swing it would add to it
        )
        for kind, by_axis in settings
        for label in by_axis[AXES[0]]
    ]
    designs = []
    for swings, range_pct in DESIGNS:
        duration_s = round(swings * modes["near_far"].period_s, 1)
        filters = {
            axis: _robust(deployment, axis, modes[axis], duration_s, range_pct) for axis in AXES
        }
        name = f"robust {duration_s:.1f} s ±{range_pct:g} %"
        designs.append(Candidate(name, filters, ours=True))
    every += designs
    if deployment.motions:
        alike = {designs[1].name: _short(designs[1].name), "G_FF third pole -4": "G_FF 3rd pole"}
        every += [
            replace(one, name=f"{alike[one.name]} apart", motion=False)
            for one in every
            if one.name in alike
        ]
    configs = {axis: deployment.axes[axis].config for axis in AXES}
    if all(config.gain_schedule for config in configs.values()):
        own = {axis: config.filter for axis, config in configs.items()}
        every.append(Candidate("the file's, by load", own, ours=True, by_load=True))
    if all(_damped(deployment, axis) for axis in AXES):
        every += [
            replace(one, name=_short(one.name) + " +sensor", sensor=True)
            for one in every
            if one.motion and not one.by_load and one.filters["slew"].kind == "robust"
        ]
    return every


def _short(name: str) -> str:
    """Return the name without its length range and prefix: tables have 80 columns."""
    return name.removeprefix("limit-aware ").partition(" ±")[0]


def _damped(deployment: Deployment, axis: str) -> bool:
    """Return whether a sway sensor damps the axis."""
    sensor = deployment.axes[axis].sway_sensor
    return sensor is not None and sensor.config.use == "damp"


def tick_s(deployment: Deployment, axis: str) -> float:
    """Return the period of the axis' valve message, s."""
    return deployment.axes[axis].period_ticks * deployment.config.tick_ms / 1000.0


def _robust(
    deployment: Deployment, axis: str, mode: SwayMode, duration_s: float, range_pct: float
) -> Filter:
    """Return a designed impulse response as a filter of a deployment file."""
    period_s = tick_s(deployment, axis)
    shaper = least_residual(
        mode,
        tick_s=period_s,
        duration_s=duration_s,
        range_pct=range_pct,
        rate_per_s=deployment.axes[axis].config.limits.slowest_per_s,
    )
    taps = [round(tap, 8) for tap in shaper.taps]
    return filter_of("robust", tick_ms=round(1000.0 * period_s), taps=taps)


def with_candidate(deployment: Deployment, candidate: Candidate) -> Deployment:
    """Return the deployment with the candidate's filters, its sensors or none, and a long tail.

    The stopping distance is left out; motions and gain schedules too, where it runs without them.
    """
    axes = dict(deployment.axes)
    for axis, its_filter in candidate.filters.items():
        config = axes[axis].config
        limits = config.limits.model_copy(update={"tail_s": TAIL_S, "stop_distance_m": None})
        changes: dict[str, Any] = {
            "filter": its_filter,
            "limits": limits,
            "gain_schedule": config.gain_schedule,
        }
        if not candidate.by_load:
            changes["gain_schedule"] = []
        if own := candidate.sway.get(axis):
            assert config.sway
            changes["sway"] = config.sway.model_copy(update=own)
        config = config.model_copy(update=changes)
        sensor = axes[axis].sway_sensor if candidate.sensor else None
        axes[axis] = replace(axes[axis], config=config, sway_sensor=sensor)
    motions = deployment.motions if candidate.motion else {}
    return replace(deployment, axes=axes, motions=motions)


RANDOM_SEEDS = tuple(range(1, 13))
INITIAL_SWAY_DEG = 10.0
LENGTH_ERRORS_PCT = (-30, -15, 0, 15, 30)
# A load multiplies the mass of the grapple by this, and lengthens the pendulum by this, m.
LOAD_MASS = 3.0
LOAD_M = 0.4
# In the loading cycle, s: joysticks are neutral before the first; the load lies after the second.
_LOAD_FROM_S, _LOAD_TO_S = 7.5, 17.0
# Part of the full speed in the file that a slow valve reaches.
SLOW_VALVE = 0.7
# Flow of a small pump, full axis flows; radius from which a pulse meets the end stop at full speed.
PUMP_FLOW = 1.2
END_FROM_M = 5.7
# Near-far begins so much later than slew, where both move.
LATE_S = (-1.2, 0.0, 1.2)
# Duration in s and level.
TAPS = ((0.15, 1.0), (0.4, 1.0), (0.6, 0.2))

_START_S = 0.5
_REST_S = 5.0
_RAMP_S = 0.1
_NOMINAL = CraneParameters()


@dataclass(frozen=True)
class Manoeuvre:
    """A script, the crane that drives it, and the place of its results in the table.

    Attributes:
        work: kind of work, a column of the table: pulse, tap, reversal, both, random, cycle,
            load, gain, pump, end or start.
        name: name of the manoeuvre.
        script: the strokes, with a rest at the end.
        axis: the axis that moves; None if several move.
        initial_deg: swing along the boom at the start, degrees.
        lengths_pct: errors of the pendulum length at which it is driven, percent.
        crane: the crane with the right pendulum length.
        load_s: time at which the grapple picks up a load, s; None for no load.
    """

    work: str
    name: str
    script: Script
    axis: str | None = None
    initial_deg: float = 0.0
    lengths_pct: tuple[int, ...] = (0,)
    crane: CraneParameters = _NOMINAL
    load_s: float | None = None


def manoeuvres() -> list[Manoeuvre]:
    """Return all manoeuvres, those of a single axis first."""
    single = [task for axis in AXES for task in _single(axis)]
    pulse = next(task for task in single if task.name == "pulse near-far")
    loading = SCRIPTS["loading"].strokes
    with_load = [stroke for stroke in loading if stroke.end_s <= _LOAD_TO_S]
    both = list(_both())
    at_once = next(task for task in both if task.name == "both at once out")
    return [
        *single,
        *both,
        *(
            Manoeuvre("random", f"random {n}", _resting(random_script(n, 20.0, AXES).strokes))
            for n in RANDOM_SEEDS
        ),
        Manoeuvre("cycle", "loading cycle", _resting(loading), lengths_pct=(-15, 0, 15)),
        Manoeuvre("load", "load picked up", _resting(with_load), load_s=_LOAD_FROM_S),
        *(
            replace(at_once, work="gain", name=f"slow {_word(axis)}", lengths_pct=(0,), crane=crane)
            for axis, crane in _slow_cranes()
        ),
        replace(
            at_once,
            work="pump",
            name="small pump",
            lengths_pct=(0,),
            crane=replace(_NOMINAL, pump_flow=PUMP_FLOW),
        ),
        replace(
            pulse,
            work="end",
            name="end stop",
            lengths_pct=(0,),
            crane=replace(_NOMINAL, start_radius_m=END_FROM_M),
        ),
        replace(
            pulse, work="start", name="swinging", lengths_pct=(0,), initial_deg=INITIAL_SWAY_DEG
        ),
    ]


def _single(axis: str) -> Iterator[Manoeuvre]:
    """Yield pulse, reversal and taps of one axis."""
    pulse = Stroke(axis, _START_S, 3.0, 1.0, _RAMP_S)
    out = replace(pulse, duration_s=1.5)
    back = replace(out, start_s=_START_S + 1.5, level=-1.0)
    for work, strokes in (("pulse", [pulse]), ("reversal", [out, back])):
        yield Manoeuvre(
            work, f"{work} {_word(axis)}", _resting(strokes), axis, lengths_pct=LENGTH_ERRORS_PCT
        )
    for duration_s, level in TAPS:
        name = f"tap {duration_s:g} s {100 * level:g} % {_word(axis)}"
        stroke = Stroke(axis, _START_S, duration_s, level, _RAMP_S)
        yield Manoeuvre("tap", name, _resting([stroke]), axis)


def _both() -> Iterator[Manoeuvre]:
    """Yield a slew with a stroke of near-far before, with or after it: outwards, or a little in."""
    for late_s in LATE_S:
        start_s = _START_S + max(0.0, -late_s)
        slew = Stroke("slew", start_s, 3.0, 1.0, _RAMP_S)
        when = f"{late_s:+g} s" if late_s else "at once"
        for way, duration_s, level in (("out", 3.0, 1.0), ("in", 2.0, -0.4)):
            near_far = Stroke("near_far", start_s + late_s, duration_s, level, _RAMP_S)
            script = _resting([slew, near_far])
            name = f"both {when} {way}"
            yield Manoeuvre("both", name, script, lengths_pct=LENGTH_ERRORS_PCT)


def _slow_cranes() -> Iterator[tuple[str, CraneParameters]]:
    """Yield an axis and a crane whose valve of this axis is slower than the file says."""
    slew, near_far = _NOMINAL.slew_full_speed_rad_s, _NOMINAL.near_far_full_speed_m_s
    yield "slew", replace(_NOMINAL, slew_full_speed_rad_s=SLOW_VALVE * slew)
    yield "near_far", replace(_NOMINAL, near_far_full_speed_m_s=SLOW_VALVE * near_far)


def _resting(strokes: "list[Stroke] | tuple[Stroke, ...]") -> Script:
    row = tuple(strokes)
    return Script("compared", row, max(stroke.end_s for stroke in row) + _REST_S)


def _word(axis: str) -> str:
    return axis.replace("_", "-")
