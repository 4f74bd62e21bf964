"""The filters that are compared, made for both axes of a deployment."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from canshaper.config.filters import Filter, filter_of
from canshaper.design.profiles import swinging_axis
from canshaper.design.tuning.robust import least_residual
from canshaper.machine.deployment import Deployment
from canshaper.shaping.registry import KINDS
from canshaper.shaping.sway import SwayMode

AXES = ("slew", "near_far")
# Time of the run-on that every filter is given: longer than the longest of them takes.
TAIL_S = 3.0
# Impulse responses: duration in swings of near-far, and the range of length they are made for.
DESIGNS = ((0.68, 15.0), (0.82, 15.0), (1.1, 30.0))


@dataclass(frozen=True)
class Candidate:
    """A filter with a name for tables, and whether it is one of ours.

    Attributes:
        name: what it is called.
        filters: by axis, as they would stand in a deployment file.
        ours: limit-aware, as G_FF and the robust shaper are.
        motion: with the two-axis motion, where the deployment has one.
        sensor: with its sway sensors.
        by_load: the file's own, with the sets of its gain schedules.
    """

    name: str
    filters: Mapping[str, Filter]
    ours: bool = False
    motion: bool = True
    sensor: bool = False
    by_load: bool = False


def candidates(deployment: Deployment) -> list[Candidate]:
    """Every filter, on slew and near-far; the impulse responses are made for the valves' rates.

    Raises:
        DesignError: one of these axes is not there, or has no sway data.
    """
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
    """Without what it covers: tables have 80 columns."""
    return name.removeprefix("limit-aware ").partition(" ±")[0]


def _damped(deployment: Deployment, axis: str) -> bool:
    """Whether the axis feeds back what a sway sensor measures."""
    sensor = deployment.axes[axis].sway_sensor
    return sensor is not None and sensor.config.use == "damp"


def tick_s(deployment: Deployment, axis: str) -> float:
    """Period of the axis' valve."""
    return deployment.axes[axis].period_ticks * deployment.config.tick_ms / 1000.0


def _robust(
    deployment: Deployment, axis: str, mode: SwayMode, duration_s: float, range_pct: float
) -> Filter:
    """A designed impulse response as it stands in a deployment file."""
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
    """The deployment with these filters, with its sensors or without, and time to run on."""
    axes = dict(deployment.axes)
    for axis, its_filter in candidate.filters.items():
        config = axes[axis].config
        limits = config.limits.model_copy(update={"tail_s": TAIL_S, "stop_distance_m": None})
        changes = {"filter": its_filter, "limits": limits, "gain_schedule": config.gain_schedule}
        if not candidate.by_load:
            changes["gain_schedule"] = []
        config = config.model_copy(update=changes)
        sensor = axes[axis].sway_sensor if candidate.sensor else None
        axes[axis] = replace(axes[axis], config=config, sway_sensor=sensor)
    motions = deployment.motions if candidate.motion else {}
    return replace(deployment, axes=axes, motions=motions)
