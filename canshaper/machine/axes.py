"""Axes of a deployment, bound to the DBC: valve, filters, status, and what they require."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from canshaper.codec.status import AXIS_STATUS
from canshaper.config.adjust import Key, adjusted, faults
from canshaper.config.enable import slowest_ms
from canshaper.config.filters import Breakpoint, Filter, Profile
from canshaper.config.limits import Sway
from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.config.source import Diagnostics, Place
from canshaper.machine.identity import bind_status
from canshaper.machine.inputs import bind_ends, bind_feedback, bind_status_word
from canshaper.machine.lookup import Lookup
from canshaper.machine.stopping import stated_fault
from canshaper.machine.valves import BoundAxis, SharedValves, bind_valve
from canshaper.shaping.registry import KINDS, STEPS_BETWEEN, ParameterSet, at_position, build_shaper
from canshaper.shaping.sway import SwayMode, SwayModel


def check_filters(lookup: Lookup, place: Place, axis: AxisSection, period_s: float) -> None:
    """Check that every filter that the axis may get runs at the period of its valve."""
    add, rate = lookup.diagnostics.add, axis.limits.slowest_per_s
    parts, filters = _parts(place, axis), every_filter(place, axis)
    for at, part in parts:
        if part.gain_schedule and not lookup.config.load_state:
            add((*at, "gain_schedule"), "expected load_state, which chooses them, got none")
    wrong = {at: filter_fault(chosen, sway, period_s, rate) for at, chosen, sway in filters}
    for at, fault in wrong.items():
        if fault:
            add(at, fault)
    for at, part in () if any(wrong.values()) else parts:
        if fault := _fault_between(part.gain_schedule, period_s, rate):
            add((*at, "gain_schedule"), fault)
    if not any(wrong.values()):
        _check_ends(lookup, axis, str(place[-1]), period_s)
    if len(filters) > 1 and axis.sway is None:
        add(place, "expected sway data of its own with profiles or a gain schedule, got none")
    codes = lookup.config.profile.codes if lookup.config.profile else {}
    buttons = any(one.next_profile for one in lookup.config.joysticks.values())
    for name in axis.profiles:
        if name not in codes and not buttons:
            names = ", ".join(codes) or "none: there is no profile at the top level"
            add((*place, "profiles", name), f"expected a profile, got {name!r}; there are {names}")


def _check_ends(lookup: Lookup, axis: AxisSection, name: str, period_s: float) -> None:
    """Check that the filter runs, scaled to each end of an adjustable number of the swing."""
    control, rate = lookup.config.control, axis.limits.slowest_per_s
    for text, ends in (control.adjustable if control else {}).items():
        key = Key.parsed(text)
        if key is None or (key.axis, key.section) != (name, "sway") or [*faults(key, axis, *ends)]:
            continue
        for end in ends:
            try:
                then = adjusted(axis, {key: end}, axis)
                fault = filter_fault(then.filter, then.sway, period_s, rate)
            except ValueError as error:
                # Whether two numbers of the swing go together is known when both are changed.
                fault = str(error) if str(error).startswith("filter") else None
            if fault:
                place = ("control", "adjustable", text)
                lookup.diagnostics.add(place, f"at {end:g}: {fault}")


def _parts(place: Place, axis: AxisSection) -> list[tuple[Place, AxisSection | Profile]]:
    """The axis and its profiles, by their places."""
    profiles = axis.profiles.items()
    return [(place, axis), *(((*place, "profiles", name), one) for name, one in profiles)]


def every_filter(place: Place, axis: AxisSection) -> list[tuple[Place, Filter, Sway | None]]:
    """Every filter that the axis may get, by its place, with the sway data that it runs with."""
    filters: list[tuple[Place, Filter, Sway | None]] = []
    for at, part in _parts(place, axis):
        filters.append(((*at, "filter"), part.filter, axis.sway))
        for i, one in enumerate(part.gain_schedule):
            filters.append(((*at, "gain_schedule", i, "filter"), one.filter, one.sway))
    return filters


def unfit(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Yield filters that were designed for another swing or valve than the file has: where, why."""
    for name, axis in config.axes.items():
        for place, chosen, sway in every_filter(("axes", name), axis):
            design = chosen.design()
            if design and sway:
                rate = axis.limits.slowest_per_s
                for key, fault in design.faults(sway.mode(), rate, axis.limits.tail_s):
                    again = f"design it again: canshaper {KINDS[chosen.kind].designed_by}"
                    cure = "lengthen it" if key == "duration_s" else again
                    yield (*place, "designed_for", key), f"{fault}; {cure}"


def check_profiles(diagnostics: Diagnostics, config: DeploymentConfig) -> None:
    """Check that a button for the next profile has profiles, and no switch that chooses them."""
    for name, joystick in config.joysticks.items():
        if joystick.next_profile:
            place = ("joysticks", name, "next_profile")
            if config.profile:
                text = "expected one of profile and next_profile, got both"
                diagnostics.add(place, text)
            if not any(axis.profiles for axis in config.axes.values()):
                diagnostics.add(place, "expected an axis with profiles, got none")


def check_control(diagnostics: Diagnostics, config: DeploymentConfig) -> None:
    """Check that every adjustable number can be changed in motion."""
    add, adjustable = diagnostics.add, config.control.adjustable if config.control else {}
    for text, (low, high) in adjustable.items():
        place = ("control", "adjustable", text)
        key = Key.parsed(text)
        if key is None:
            add(place, "expected axes.AXIS.SECTION.NAME, got no key of an axis")
        elif diagnostics.check_axis(place, key.axis, config.axes):
            for fault in faults(key, config.axes[key.axis], low, high):
                add(place, fault)


def filter_fault(
    chosen: Filter, sway: Sway | None, period_s: float, valve_rate_per_s: float
) -> str | None:
    """Why a filter cannot run, or None.

    Args:
        chosen: the filter.
        sway: sway data that it runs with.
        period_s: time between two commands to the valve.
        valve_rate_per_s: rate of the valve, full speeds per second.
    """
    mode = sway.mode() if sway else None
    return _fault(chosen.kind, chosen.parameters(), mode, period_s, valve_rate_per_s)


def parameter_sets(sets: Sequence[Breakpoint]) -> list[ParameterSet]:
    """Sets of an axis or of a profile as they run."""
    return [
        ParameterSet(one.breakpoint, one.sway.mode(), one.filter.kind, one.filter.parameters())
        for one in sets
    ]


def _fault_between(
    sets: Sequence[Breakpoint], period_s: float, valve_rate_per_s: float
) -> str | None:
    """Why a filter between two breakpoints cannot run, or None.

    Each that the load may ask for is built here, so that none is refused in motion.
    """
    running = parameter_sets(sets)
    for steps in range((len(running) - 1) * STEPS_BETWEEN):
        one = at_position(running, steps)
        if fault := _fault(one.kind, one.parameters, one.mode, period_s, valve_rate_per_s):
            return f"at {one.at:g}, between two breakpoints: {fault}"
    return None


def _fault(
    kind: str,
    parameters: dict[str, Any],
    mode: SwayMode | None,
    period_s: float,
    valve_rate_per_s: float,
) -> str | None:
    try:
        model = SwayModel(mode, period_s) if mode else None
        build_shaper(kind, period_s, model, valve_rate_per_s=valve_rate_per_s, **parameters)
    except ValueError as error:
        return str(error)
    return None


def bind_axes(lookup: Lookup) -> dict[str, BoundAxis]:
    """Bind the axes; return those without a problem, by name."""
    shared_valves: SharedValves = {}
    # A slewing axis acts first: where it trips, nothing of it is in the other one's next output.
    slewing = {motion.slew for motion in lookup.config.motion.values()}
    order = sorted(lookup.config.axes.items(), key=lambda item: item[0] not in slewing)
    axes = {n: _bind_axis(lookup, shared_valves, n, a) for n, a in order}
    if not lookup.diagnostics.problems:  # else a signal may be unused because it was not bound
        for shared in shared_valves.values():
            if not shared.codec.rewrites:  # its signals are the joystick's
                shared.used.check_start_values(shared.codec.start)
    bound = {n: axis for n, axis in axes.items() if axis}
    if not any(axis.sway_sensor for axis in lookup.config.axes.values()):
        return bound
    from canshaper.machine.sway_sensor import bind_sway_sensors

    tick_s = lookup.config.tick_ms / 1000.0
    periods = {n: tick_s * axis.period_ticks for n, axis in bound.items()}
    sensors = bind_sway_sensors(lookup, periods)
    return {n: replace(axis, sway_sensor=sensors.get(n)) for n, axis in bound.items()}


def _bind_axis(
    lookup: Lookup, shared_valves: SharedValves, name: str, axis: AxisSection
) -> BoundAxis | None:
    place: Place = ("axes", name)
    add, problems = lookup.diagnostics.add, lookup.diagnostics.problems
    before, joystick = len(problems), axis.command.joystick
    if joystick not in lookup.config.joysticks:
        names = ", ".join(lookup.config.joysticks)
        text = f"expected a joystick, got {joystick!r}; there are {names}"
        add((*place, "command", "joystick"), text)
    valve = bind_valve(lookup, shared_valves, (*place, "valve"), axis.valve, axis.command)
    status, status_ticks = bind_status(lookup, (*place, "status"), axis.status, AXIS_STATUS)
    if valve is None or len(problems) > before:
        return None
    codec, ticks = valve
    period_s = ticks * lookup.config.tick_ms / 1000.0
    check_filters(lookup, place, axis, period_s)
    timeout_ms = slowest_ms(lookup.config, joystick)
    if fault := stated_fault(axis, timeout_ms=timeout_ms, period_s=period_s):
        add((*place, "limits", "stop_distance_m"), fault)
    if len(problems) > before:
        return None
    cia408, ends = axis.valve.cia408, axis.limits.ends
    at: Place = (*place, "valve", "cia408", "status")
    return BoundAxis(
        name=name,
        config=axis,
        valve=codec,
        period_ticks=ticks,
        timeout_ms=timeout_ms,
        status=status,
        status_ticks=status_ticks,
        feedback=bind_feedback(lookup, (*place, "feedback"), axis.feedback)
        if axis.feedback
        else None,
        status_word=bind_status_word(lookup, at, cia408.status) if cia408 else None,
        ends=bind_ends(lookup, (*place, "limits", "ends"), ends) if ends else None,
    )
