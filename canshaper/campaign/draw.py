"""Draw one drive of a campaign: crane, load, valves, operator, faults.

Every number comes from the seed of the drive by NumPy's SeedSequence, in a fixed order. A drive is
therefore the same in every process and in every order. Two files with the same ranges get the same
crane and the same operator for a seed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from canshaper.campaign.operators import OPERATORS, Draw, Fault, bus_fault, sensor_fault
from canshaper.config.desk import MOST_FLOW, Uncertainty
from canshaper.design.lockstep import DriveOptions, driven_part
from canshaper.errors import CampaignError
from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import ALL_AXES, JOINTS, LUFFING, NEAR_FAR, ON_ROPE, OVERHEAD, SLEW, kind_of
from canshaper_sim.crane import FULL_SPEEDS, CraneParameters
from canshaper_sim.cranes import cranes
from canshaper_sim.grapple import Grapple, Sway
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.recorder import dwell_s
from canshaper_sim.recording import DWELL_S
from canshaper_sim.strokes import Script

# A drive that is to meet an end stop begins within this distance of it.
_NEAR_M = 1.5
Parameters = dict[str, Any]
"""Drawn parameters of the crane; each replaces the nominal one."""
_GUSTS = 0.25  # standard deviation of the wind speed, as a part of its mean
# When a load is picked up, and when it is put down, as parts of the drive.
_PICK_UP, _PUT_DOWN = (0.1, 0.5), (0.5, 0.9)


@dataclass(frozen=True)
class Setting:
    """One drawn drive.

    Attributes:
        operator: kind of operator.
        fault: kind of fault; "" for none.
        factors: the drawn numbers, by name.
        script: the strokes of the operator.
        options: crane and loads of the simulation, see ``DriveOptions``.
        dwell_s: swing counts as residual from this time after a release on.
    """

    operator: str
    fault: str
    factors: dict[str, float]
    script: Script
    options: DriveOptions
    dwell_s: float


def driven_axes(deployment: Deployment) -> tuple[str | None, list[str]]:
    """Return the name of the driven crane (the first of several) and the coordinates it moves.

    Raises:
        CampaignError: no axis moves the crane.
    """
    crane = next(iter(cranes(deployment)), None)
    moved = {*driven_part(deployment, crane).coordinates.values()}
    if not moved:
        text = "expected an axis that moves the crane, got none: the section crane names them"
        raise CampaignError(f"{deployment.path}: {text}")
    return crane, [axis for axis in ALL_AXES if axis in moved]


def check_same_axes(first: Deployment, second: Deployment) -> None:
    """Check that a seed draws the same crane and operator for both deployments.

    Raises:
        CampaignError: their axes differ, so that the same number would be drawn for another
            quantity; or their files simulate different cranes.
    """
    (_, ones), (_, others) = driven_axes(first), driven_axes(second)
    if ones != others:
        text = f"expected the axes of {first.path.name}, {', '.join(ones)}, got {', '.join(others)}"
        raise CampaignError(f"{second.path}: {text}")
    if changed_parameters([], first) != changed_parameters([], second):
        text = f"expected the crane.simulated of {first.path.name}, got another crane"
        raise CampaignError(f"{second.path}: {text}")


def draw_drive(
    deployment: Deployment,
    seed: int,
    ranges: Uncertainty,
    nominal: CraneParameters | None = None,
    longest_s: float = 0.0,
) -> Setting:
    """Draw one drive.

    Args:
        seed: seed of the drive, 0 or more.
        ranges: ranges of the crane's parameters.
        nominal: the crane that the ranges refer to; None for that of the file.
        longest_s: longest ``dwell_s`` of all files that are driven with the same seeds.

    Raises:
        CampaignError: no axis moves the crane.
    """
    of_crane, of_operator, of_load, of_fault, of_place = (
        Draw(one) for one in np.random.SeedSequence(seed).spawn(5)
    )
    crane, axes = driven_axes(deployment)
    nominal = nominal or changed_parameters([], deployment)
    drawn, factors = _crane(of_crane, axes, ranges, nominal)
    placed, of_places = _place(of_place, axes, ranges, nominal, seed)
    swing = [of_crane.between(*ranges.sway_deg) * of_crane.one_of((-1, 1)) for _ in range(2)]
    operator = of_operator.one_of([*OPERATORS])
    script = OPERATORS[operator](of_operator, axes, f"campaign-{seed}")
    duration_s = script.duration_s  # of the strokes alone: the tails of the file change no draw
    rest_s = max(dwell_s(driven_part(deployment, crane)), longest_s)
    script = replace(script, duration_s=duration_s + (rest_s - DWELL_S))
    if deployment.config.crane:
        script = script.moving(deployment.by_coordinate)
    loads, of_loads = _loads(of_load, ranges, duration_s, drawn["grapple"])
    if "rope_m" in factors:  # on a rope the period does not depend on the load
        loads, of_loads = [], {}
    sensors = any(axis.sway_sensor for axis in deployment.axes.values())
    fault = _fault(of_fault, ranges, duration_s, sensors=sensors)
    sensor = replace(nominal.sway_sensor, seed=seed % 1_000_000, **fault.sensor)
    options: DriveOptions = {
        "parameters": replace(nominal, **{**drawn, **placed, "sway_sensor": sensor}),
        "sway": Sway(*map(math.radians, swing)),
        "loads": loads,
        "crane": crane,
    }
    if fault.disturb is not None:
        options["disturb"] = fault.disturb
    factors |= of_places
    factors |= {"sway_across_deg": swing[0], "sway_along_deg": swing[1], **of_loads}
    return Setting(operator, fault.name, factors, script, options, rest_s)


def on_unit(setting: Setting, unit: Path, nominal: CraneParameters) -> Setting:
    """Return the drive with an FMU as its crane: only operator and faults stay drawn."""
    drawn = setting.options["parameters"]
    assert drawn
    parameters = replace(nominal, sway_sensor=drawn.sway_sensor)
    own: DriveOptions = {"unit": unit, "parameters": parameters, "sway": None, "loads": ()}
    return replace(setting, factors={}, options={**setting.options, **own})


def _crane(
    draw: Draw, axes: Sequence[str], ranges: Uncertainty, nominal: CraneParameters
) -> tuple[Parameters, dict[str, float]]:
    """Draw tool, pose and valves; return them and the drawn numbers."""
    factors = {
        "length_pct": draw.between(*ranges.length_pct),
        "damping_pct": draw.between(*ranges.damping_pct),
    }
    kind = kind_of(axes)
    by_rope, by_joints = kind in ON_ROPE, kind == JOINTS
    if by_rope:
        factors["rope_m"] = draw.between(*ranges.rope_m)
    if kind not in (OVERHEAD, LUFFING):
        factors["radius_m"] = draw.between(*ranges.radius_m)
    damped = 1.0 + factors["damping_pct"] / 100.0
    grapple = nominal.grapple
    grapple = replace(
        grapple.longer(factors["length_pct"]),
        c5_n_m_s_rad=damped * grapple.c5_n_m_s_rad,
        c6_n_m_s_rad=damped * grapple.c6_n_m_s_rad,
    )
    crane: Parameters = {"grapple": grapple}
    part = kind if by_rope else "joints"  # that holds the parameters of the axes
    own: Parameters = {}
    if by_joints:  # joints cannot reach every radius: they begin at that of the file
        del factors["radius_m"]
    elif by_rope:
        own = _on_rope(getattr(nominal, kind), factors)
    else:
        crane["start_radius_m"] = _clamp(factors, "radius", nominal)
    for axis in axes:
        drawn = {
            "dead_time_s": draw.between(*ranges.valve_dead_time_s),
            "lag_s": draw.between(*ranges.valve_lag_s),
            "rate_limit_1_s": draw.between(*ranges.valve_rate_per_s),
            "deadband": draw.between(*ranges.valve_deadband_pct) / 100.0,
            "hysteresis": draw.between(*ranges.valve_hysteresis_pct) / 100.0,
        }
        gain_pct = draw.between(*ranges.valve_gain_pct)
        factors |= {f"{axis}_{name}": value for name, value in drawn.items()}
        factors[f"{axis}_gain_pct"] = gain_pct
        of_part = by_rope or (by_joints and axis != SLEW)
        owner, changed = (getattr(nominal, part), own) if of_part else (nominal, crane)
        full = FULL_SPEEDS[axis]
        changed[axis] = replace(getattr(owner, axis), **drawn)
        changed[full] = (1.0 + gain_pct / 100.0) * getattr(owner, full)
    if own:
        crane[part] = replace(getattr(nominal, part), **own)
    return crane, factors


def _clamp(factors: dict[str, float], name: str, crane: Any) -> float:
    """Clamp a drawn length to the range of the crane; write it back and return it."""
    low: float = getattr(crane, f"{name}_min_m")
    high: float = getattr(crane, f"{name}_max_m")
    factors[f"{name}_m"] = clamped = min(max(factors[f"{name}_m"], low), high)
    return clamped


def _on_rope(nominal: Any, factors: dict[str, float]) -> Parameters:
    """Return the parameters of the drawn rope and radius; clamp both in ``factors`` too."""
    own: Parameters = {}
    if "radius_m" in factors:
        own["start_radius_m"] = _clamp(factors, "radius", nominal)
    return own | {
        "rope_m": _clamp(factors, "rope", nominal),
        "rope_error_pct": factors["length_pct"],
        "damping_ratio": nominal.damping_ratio * (1.0 + factors["damping_pct"] / 100.0),
    }


def _place(
    draw: Draw, axes: Sequence[str], ranges: Uncertainty, nominal: CraneParameters, seed: int
) -> tuple[Parameters, dict[str, float]]:
    """Draw pump, ground, wind and a start near an end stop; return them and the drawn numbers.

    A crane with a rope gets none of them.
    """
    if kind_of(axes) in ON_ROPE:
        return {}, {}
    factors = {
        "pump_flow": draw.between(*ranges.pump_flow),
        "starved": float(draw.between(0.0, 100.0) < ranges.starved_pct),
        "pitch_deg": draw.between(*ranges.slope_deg) * draw.one_of((-1, 1)),
        "roll_deg": draw.between(*ranges.slope_deg) * draw.one_of((-1, 1)),
        "rock_hz": draw.between(*ranges.rock_hz),
        "wind_m_s": draw.between(*ranges.wind_m_s),
        "wind_heading_deg": draw.between(-180.0, 180.0),
    }
    near, ahead_m = draw.between(0.0, 100.0) < ranges.stops_pct, draw.between(0.0, _NEAR_M)
    at_m = draw.one_of((nominal.radius_min_m + ahead_m, nominal.radius_max_m - ahead_m))
    crane: Parameters = {}
    if near := near and NEAR_FAR in axes:
        factors["radius_m"] = crane["start_radius_m"] = at_m
    tilts = {name: factors[name] for name in ("pitch_deg", "roll_deg", "rock_hz")}
    speed = factors["wind_m_s"]
    heading, gust = factors["wind_heading_deg"], _GUSTS * speed
    wind = replace(nominal.wind, speed_m_s=speed, gust_m_s=gust, heading_deg=heading, seed=seed)
    if factors["pump_flow"] < MOST_FLOW:
        pump = replace(nominal.pump, shares_flow=0.0 if factors["starved"] else 1.0)
        crane |= {"pump_flow": factors["pump_flow"], "pump": pump}
    crane |= {"carrier": replace(nominal.carrier, **tilts), "wind": wind}
    return crane, factors | {"near_stop": float(near)}


def _loads(
    draw: Draw, ranges: Uncertainty, duration_s: float, empty: Grapple
) -> tuple[list[tuple[float, Grapple]], dict[str, float]]:
    """Draw a load; return (time in s, grapple from then on) of each change, and drawn numbers."""
    loaded = draw.between(0.0, 100.0) < ranges.load_change_pct
    mass, lower_m = draw.between(*ranges.load_mass), draw.between(*ranges.load_m)
    times_s = [duration_s * draw.between(*part) for part in (_PICK_UP, _PUT_DOWN)]
    if not loaded:
        return [], {"load_mass": 1.0, "load_m": 0.0}
    full = replace(empty, m2_kg=mass * empty.m2_kg, l2_m=empty.l2_m + lower_m)
    return [*zip(times_s, (full, empty), strict=True)], {"load_mass": mass, "load_m": lower_m}


def _fault(draw: Draw, ranges: Uncertainty, duration_s: float, *, sensors: bool) -> Fault:
    """Draw a fault of the bus or of a sensor, or none."""
    of_bus, of_sensor = draw.between(0.0, 100.0), draw.between(0.0, 100.0)
    if of_bus < ranges.bus_fault_pct:
        return bus_fault(draw, duration_s)
    if sensors and of_sensor < ranges.sensor_fault_pct:
        return sensor_fault(draw, duration_s)
    return Fault("")
