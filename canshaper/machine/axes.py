"""Binds the axes of a deployment to the DBC: valve, filters, status, and checks of each."""

from dataclasses import replace

from canshaper.codec.status import AXIS_STATUS
from canshaper.config.enable import slowest_ms
from canshaper.config.schema import AxisSection
from canshaper.config.source import Place
from canshaper.machine.filters import check_filters
from canshaper.machine.identity import bind_status
from canshaper.machine.inputs import bind_ends, bind_feedback, bind_rope, bind_status_word
from canshaper.machine.lookup import Lookup
from canshaper.machine.stop_distance import stated_fault
from canshaper.machine.valves import BoundAxis, SharedValves, bind_valve


def bind_axes(lookup: Lookup) -> dict[str, BoundAxis]:
    """Bind the axes; return each without a problem by name, slewing axes first."""
    shared_valves: SharedValves = {}
    # A slewing axis acts first: when it trips, the other axis adds nothing for it in the same tick.
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
    joysticks = lookup.config.joysticks
    lookup.diagnostics.check_name(
        (*place, "command", "joystick"), "a joystick", joystick, joysticks
    )
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
    rope = axis.sway.length if axis.sway else None
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
        rope=bind_rope(lookup, (*place, "sway", "length"), rope) if rope else None,
    )
