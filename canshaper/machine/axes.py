"""Axes of a deployment, bound to the DBC: valve, filters, status, and what they ask of others."""

from canshaper.codec.status import AXIS_STATUS
from canshaper.config.schema import AxisConfig
from canshaper.config.source import Place
from canshaper.machine.bound_axis import BoundAxis, BoundRadial
from canshaper.machine.filters import check_filters
from canshaper.machine.inputs import bind_feedback, bind_radius, bind_status_word
from canshaper.machine.lookup import Lookup
from canshaper.machine.statuses import bind_status
from canshaper.machine.stopping import stated_fault
from canshaper.machine.valves import SharedValves, bind_valve


def bind_axes(lookup: Lookup) -> dict[str, BoundAxis]:
    """The axes without any problem, by name."""
    shared_valves: SharedValves = {}
    axes = {n: _bind_axis(lookup, shared_valves, n, a) for n, a in lookup.config.axes.items()}
    return {name: axis for name, axis in axes.items() if axis}


def _bind_axis(
    lookup: Lookup, shared_valves: SharedValves, name: str, axis: AxisConfig
) -> BoundAxis | None:
    place: Place = ("axes", name)
    add, problems, joysticks = (
        lookup.diagnostics.add,
        lookup.diagnostics.problems,
        lookup.config.joysticks,
    )
    before = len(problems)
    if axis.command.joystick not in joysticks:
        names = ", ".join(joysticks)
        add(
            (*place, "command", "joystick"),
            f"found {axis.command.joystick!r}, joysticks are {names}",
        )
    valve = bind_valve(lookup, shared_valves, (*place, "valve"), axis.valve, axis.command)
    status = bind_status(lookup, (*place, "status"), axis.status, AXIS_STATUS)
    if valve is None or len(problems) > before:
        return None
    codec, ticks = valve
    period_s = ticks * lookup.config.tick_ms / 1000.0
    check_filters(lookup, place, axis, period_s)
    timeout_ms = joysticks[axis.command.joystick].timeout_ms
    if fault := stated_fault(axis, timeout_ms=timeout_ms, period_s=period_s):
        add((*place, "limits", "stop_distance_m"), fault)
    if len(problems) > before:
        return None
    cia408 = axis.valve.cia408
    at: Place = (*place, "valve", "cia408", "status")
    return BoundAxis(
        name,
        axis,
        codec.message.sender.fields.message,
        codec,
        ticks,
        *status,
        _bind_radial(lookup, (*place, "radial_compensation"), axis),
        bind_feedback(lookup, (*place, "feedback"), axis.feedback) if axis.feedback else None,
        bind_status_word(lookup, at, cia408.status) if cia408 else None,
    )


def _bind_radial(lookup: Lookup, place: Place, axis: AxisConfig) -> BoundRadial | None:
    config, axes = axis.radial_compensation, lookup.config.axes
    if config is None:
        return None
    target, at, add = axes.get(config.axis), (*place, "axis"), lookup.diagnostics.add
    if target is None or target is axis:
        others = ", ".join(n for n, a in axes.items() if a is not axis)
        add(at, f"found {config.axis!r}, other axes are {others}")
    elif target.sway is None:
        add(at, f"found {config.axis!r}, which has no sway data")
    elif _cycle(lookup, target) != _cycle(lookup, axis):
        add(at, f"found {config.axis!r}, whose valve has another cycle")
    else:
        _check_single(lookup, at, config.axis, axis)
    if axis.sway is None:
        add(place, "needs the sway data of its own axis; found no sway")
    radius = config.radius
    return BoundRadial(config, bind_radius(lookup, (*place, "radius"), radius) if radius else None)


def _check_single(lookup: Lookup, place: Place, name: str, axis: AxisConfig) -> None:
    """One other axis at most compensates with an axis, and none with one that does so itself."""
    for other, config in lookup.config.axes.items():
        radial = config.radial_compensation
        if radial is None or config is axis:
            continue
        if other == name:
            text = f"found {name!r}, which has a radial compensation itself"
            lookup.diagnostics.add(place, text)
        elif radial.axis == name:
            lookup.diagnostics.add(place, f"found {name!r}, which axis {other} uses already")


def _cycle(lookup: Lookup, axis: AxisConfig) -> int | None:
    """Cycle of the axis' valve message; None where there is no such message."""
    result = lookup.messages.find(axis.valve.message)
    return None if isinstance(result, str) else result[1].cycle_time
