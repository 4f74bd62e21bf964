"""Checks that every filter of a deployment runs at the period of the valve that it drives."""

from collections.abc import Iterator, Sequence
from typing import Any

from canshaper.config.bus import REDUCED_PCT
from canshaper.config.filters import Breakpoint, Filter, Profile, designed
from canshaper.config.limits import Sway
from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.config.source import Diagnostics, Place
from canshaper.machine.lookup import Lookup
from canshaper.shaping.registry import KINDS, STEPS_BETWEEN, ParameterSet, at_position, build_shaper
from canshaper.shaping.sway import SwayMode, SwayModel


def check_filters(lookup: Lookup, place: Place, axis: AxisSection, period_s: float) -> None:
    """Check that each filter of an axis runs at its valve's period, and that its profiles exist."""
    add, rate = lookup.diagnostics.add, axis.limits.slowest_per_s
    check_rope(lookup, place, axis)
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
    """Check that the filter still runs at both ends of each adjustable number in ``sway``."""
    control, rate = lookup.config.control, axis.limits.slowest_per_s
    if control is None:
        return
    from canshaper.config.adjust import AxisKey, adjusted, faults

    for text, ends in control.adjustable.items():
        key = AxisKey.parsed(text)
        if key is None or (key.axis, key.section) != (name, "sway") or [*faults(key, axis, *ends)]:
            continue
        for end in ends:
            try:
                then = adjusted(axis, {key: end}, axis)
                fault = filter_fault(then.filter, then.sway, period_s, rate)
            except ValueError as error:
                # Rules between two numbers of sway are checked when both have their new values.
                fault = str(error) if str(error).startswith("filter") else None
            if fault:
                place = ("control", "adjustable", text)
                lookup.diagnostics.add(place, f"at {end:g}: {fault}")


def _parts(place: Place, axis: AxisSection) -> list[tuple[Place, AxisSection | Profile]]:
    """Return the axis and its profiles, each with its place."""
    profiles = axis.profiles.items()
    return [(place, axis), *(((*place, "profiles", name), one) for name, one in profiles)]


def every_filter(place: Place, axis: AxisSection) -> list[tuple[Place, Filter, Sway | None]]:
    """Return (place, filter, sway data) of every filter that the axis may use."""
    filters = [*at_ends(place, axis)]
    for at, part in _parts(place, axis):
        filters.append(((*at, "filter"), part.filter, axis.sway))
        for i, one in enumerate(part.gain_schedule):
            filters.append(((*at, "gain_schedule", i, "filter"), one.filter, one.sway))
    return filters


def at_ends(place: Place, axis: AxisSection) -> Iterator[tuple[Place, Filter, Sway | None]]:
    """Yield (place, filter, sway data) at the shortest and the longest rope of the axis.

    Yield nothing without a measured rope, or for a filter that does not follow it.
    """
    sway, chosen = axis.sway, axis.filter
    follows = KINDS[chosen.kind].follows
    if sway is None or sway.length is None or follows is None:
        return
    for key, mode in zip(("lowest_m", "highest_m"), sway.ends(), strict=True):
        factor = mode.period_s / sway.mode().period_s
        swing = designed(mode)
        changes = follows(chosen.parameters(), factor)
        if design := chosen.design():
            lasts = {"duration_s": design.duration_s and round(factor * design.duration_s, 2)}
            rate = design.valve_rate_per_s
            rate_then = {"valve_rate_per_s": rate and round(rate / factor, 2)}
            changes["designed_for"] = design.model_copy(update=swing | lasts | rate_then)
        one = dict.fromkeys(("length", "length_m", "damping_nms", "mass_kg", "decay_per_swing"))
        at = (*place, "sway", "length", key)
        yield at, chosen.model_copy(update=changes), sway.model_copy(update=one | swing)


def check_rope(lookup: Lookup, place: Place, axis: AxisSection) -> None:
    """Check that filter and other sections of an axis suit a measured rope length, if any."""
    if axis.sway is None or axis.sway.length is None:
        return
    add, at = lookup.diagnostics.add, (*place, "sway", "length")
    if KINDS[axis.filter.kind].follows is None:
        kinds = ", ".join(name for name, kind in KINDS.items() if kind.follows)
        add(at, f"expected a filter that follows it, {kinds}, got {axis.filter.kind}")
    for key in ("gain_schedule", "profiles", "sway_sensor"):
        if getattr(axis, key):
            add(at, f"expected no {key} with it: sway and filter follow the length alone")
    design = axis.filter.design()
    if design and design.second:
        text = "expected none with sway.length: its period does not go with the rope's"
        add((*place, "filter", "designed_for", "second"), text)


def unfit(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Yield (place, reason) of filters that do not suit swing, valve or reversal of the file."""
    for name, axis in config.axes.items():
        for place, chosen, sway in every_filter(("axes", name), axis):
            design = chosen.design()
            if design and sway:
                rate = axis.limits.slowest_per_s
                for key, fault in design.faults(sway.mode(), rate, axis.limits.tail_s):
                    again = f"design it again: canshaper {KINDS[chosen.kind].designed_by}"
                    cure = "lengthen it" if key == "duration_s" else again
                    yield (*place, "designed_for", key), f"{fault}; {cure}"
            if design and (lets_end_s := design.reversal_s(axis.limits)):
                text = "a reversal cuts the response off and makes this mode swing; write in limits"
                cure = f"reversal: brake_shaped, reversal_s: {lets_end_s:g}"
                yield (*place, "designed_for", "second"), f"{text} {cure}"


def check_profiles(diagnostics: Diagnostics, config: DeploymentConfig) -> None:
    """Check that next_profile of a joystick has profiles, and no section ``profile`` beside it."""
    for name, joystick in config.joysticks.items():
        if joystick.next_profile:
            place = ("joysticks", name, "next_profile")
            if config.profile:
                text = "expected one of profile and next_profile, got both"
                diagnostics.add(place, text)
            if not any(axis.profiles for axis in config.axes.values()):
                diagnostics.add(place, "expected an axis with profiles, got none")


def check_control(diagnostics: Diagnostics, config: DeploymentConfig) -> None:
    """Check that adjustable numbers may change in motion, and low speeds for rehearse_faults."""
    if config.control is None:
        return
    from canshaper.config.adjust import AxisKey, faults

    add, slow = diagnostics.add, config.control.rehearse_faults
    for text, (low, high) in config.control.adjustable.items():
        place = ("control", "adjustable", text)
        key = AxisKey.parsed(text)
        if key is None:
            add(place, "expected axes.AXIS.SECTION.NAME, got no key of an axis")
        elif diagnostics.check_name(place, "an axis", key.axis, config.axes):
            for fault in faults(key, config.axes[key.axis], low, high):
                add(place, fault)
            if slow and key.name == "max_pct" and high > REDUCED_PCT:
                add(place, f"expected up to {REDUCED_PCT:g} with rehearse_faults, got {high:g}")
    if not slow:
        return
    fast = {("axes", n, "limits", "max_pct"): a.limits.max_pct for n, a in config.axes.items()}
    motions = {("motion", n, "max_pct"): one.max_pct for n, one in config.motion.items()}
    for where, most in (fast | motions).items():
        if most > REDUCED_PCT:
            text = f"expected up to {REDUCED_PCT:g} with control.rehearse_faults"
            add(where, f"{text}, got {most:g}")


def filter_fault(
    chosen: Filter, sway: Sway | None, period_s: float, valve_rate_per_s: float
) -> str | None:
    """Return why a filter cannot run, or None.

    Args:
        chosen: the filter.
        sway: sway data that it runs with.
        period_s: time between two commands to the valve, seconds.
        valve_rate_per_s: fastest change of the valve's command, full speeds per second.
    """
    mode = sway.mode() if sway else None
    return _fault(chosen.kind, chosen.parameters(), mode, period_s, valve_rate_per_s)


def parameter_sets(sets: Sequence[Breakpoint]) -> list[ParameterSet]:
    """Return the parameter sets of a gain schedule, as the axis runs them."""
    return [
        ParameterSet(one.breakpoint, one.sway.mode(), one.filter.kind, one.filter.parameters())
        for one in sets
    ]


def _fault_between(
    sets: Sequence[Breakpoint], period_s: float, valve_rate_per_s: float
) -> str | None:
    """Return why a filter between two breakpoints cannot run, or None.

    Every filter that the load state may select is built here, so that none is refused in motion.
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
