"""Stopping distances of a deployment as a table: what the tip travels after each event.

Travel is in seconds of full speed: times the speed of the tip it is metres, times the angular speed
of a slewing axis radians. It is the travel of the commands; the lag of the valve adds to it.
"""

import copy
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, Self

from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from canshaper.config.filters import Filter, Profile
from canshaper.config.schema import AxisSection
from canshaper.controller.axis_control import AxisControl
from canshaper.inputs.joystick import JoystickInput
from canshaper.machine.deployment import Deployment
from canshaper.machine.filters import at_ends
from canshaper.machine.stop_distance import (
    FullSpeed,
    allowed_s,
    full_speed,
    output_limits,
    stop_fault,
    when,
)
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.states import MOVING, CommandInput, Reason

# Of a proportional valve with a first-order lag: that of the simulated crane, typical of pilot
# stages. The tip travels on for so long at its last speed, whatever the commands did before.
VALVE_LAG_S = 0.1
_AXES_A_TABLE = 3  # as many as fit 80 columns
# Until a filter of the schema gives full speed: five times the longest time constant.
WARM_UP_S = 25.0
# Releases that are tried: up to so long a stroke, or as long as the tail, at such intervals.
LONGEST_PULSE_S = 4.0
RELEASES_S = 0.1
# Longer than the longest tail and the slowest fall of the schema.
LONGEST_STOP_S = 15.0


@dataclass(frozen=True, slots=True)
class Travel:
    """Travel after each event, seconds of full speed; and time.

    Attributes:
        release: the joystick goes to neutral.
        reversal: the joystick goes to full speed the other way; what is still travelled in the old
            direction.
        lost: the joystick's frames end.
        enable: enable released, or emergency stop.
        reversal_s: how long it moves in the old direction after that reversal, s.
    """

    release: float
    reversal: float
    lost: float
    enable: float
    reversal_s: float

    @classmethod
    def worst(cls, travels: "list[Travel]") -> Self:
        """Return, for each event, the longest of these travels."""
        return cls(*(max(getattr(t, f.name) for t in travels) for f in fields(cls)))


@dataclass(frozen=True, slots=True)
class Stopping:
    """Stopping of one axis from its full speed; travel in seconds of full speed.

    ``maximum`` is max_pct as a part, ``stated_m`` the file's stop_distance_m; see ``needed_s``.
    """

    name: str
    speed: FullSpeed
    maximum: float
    travel: Travel
    needed_s: float
    allowed_s: float
    stated_m: float | None

    def cell(self, way_s: float) -> str:
        """Return a travel as text: metres, for slew degrees too; seconds without a known speed."""
        if self.speed.m_s is None:
            return f"{way_s:.2f} s"
        text = f"{way_s * self.speed.m_s:.2f} m"
        if self.speed.rad_s is not None:
            text += f"  {math.degrees(way_s * self.speed.rad_s):.0f} deg"
        return text


def stopping(deployment: Deployment) -> list[Stopping]:
    """Return the stopping of every axis, with the worst of its filters."""
    return [_stopping(deployment, bound) for bound in deployment.axes.values()]


def consequences(deployment: Deployment, name: str, chosen: Filter, tail_s: float | None) -> str:
    """Return in words the stopping distance with another filter, and what forbids its tail."""
    bound = deployment.axes[name]
    changes: dict[str, Any] = {"filter": chosen, "gain_schedule": [], "profiles": {}}
    one = _stopping(deployment, replace(bound, config=bound.config.model_copy(update=changes)))
    text = (
        f"Released at full speed, {name} travels {one.cell(one.travel.release)} with it;"
        f" its limits allow {one.cell(one.allowed_s)}."
    )
    if one.stated_m is not None and one.needed_s > one.allowed_s:
        text += f" It needs {one.cell(one.needed_s)}: stop_distance_m cuts it short."
    if tail_s is None:
        return text
    limits = bound.config.limits.model_copy(update={"tail_s": tail_s})
    fault = stop_fault(deployment, name, bound.config.model_copy(update={"limits": limits}))
    return f"{text} For tail_s: {tail_s:g}, stop_distance_m: {fault}." if fault else text


def _stopping(deployment: Deployment, bound: BoundAxis) -> Stopping:
    joystick = deployment.joysticks[bound.config.command.joystick]
    config, limits = bound.config, bound.config.limits
    tick_s = deployment.config.tick_ms / 1000.0
    times = {"timeout_s": bound.timeout_ms / 1000.0, "period_s": tick_s * bound.period_ticks}

    def axis(one: BoundAxis) -> ShapedAxis:
        return AxisControl(one, tick_s, JoystickInput(joystick), one.valve.message.sender()).axis

    unbounded = limits.model_copy(update={"stop_distance_m": None})
    free = replace(bound, config=config.model_copy(update={"limits": unbounded}))
    bounds = output_limits(config, **when(deployment, bound.name))
    allowed = allowed_s(bounds, stop_s=limits.stop_s, **times)
    return Stopping(
        bound.name,
        full_speed(config),
        limits.max_pct / 100.0,
        Travel.worst([travel(partial(axis, one), **times) for one in _variants(bound)]),
        max(needed_s(partial(axis, one), limits.tail_s, **times) for one in _variants(free)),
        allowed,
        limits.stop_distance_m,
    )


def _variants(bound: BoundAxis) -> Iterator[BoundAxis]:
    """Yield the axis with each pair of sway and filter of the file, and at the ends of a rope."""
    config = bound.config
    parts: list[AxisSection | Profile] = [config, *config.profiles.values()]
    for part in parts:
        pairs = [
            (config.sway, part.filter),
            *((one.sway, one.filter) for one in part.gain_schedule),
        ]
        for sway, chosen in pairs:
            changes = {"sway": sway, "filter": chosen}
            yield replace(bound, config=config.model_copy(update=changes))
    for _, chosen, sway in at_ends(("axes", bound.name), config):
        yield replace(bound, config=config.model_copy(update={"sway": sway, "filter": chosen}))


def print_stopping(deployment: Deployment, console: Console) -> None:
    """Print the distances; they fit in 80 columns."""
    axes = stopping(deployment)
    for first in range(0, len(axes), _AXES_A_TABLE):
        console.print(_table(axes[first : first + _AXES_A_TABLE]))
    console.print(Group(*_notes(axes), *_motion_notes(deployment)))


def _table(axes: list[Stopping]) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    table.add_column("stops from full speed in", no_wrap=True)
    for axis in axes:
        table.add_column(axis.name, justify="right")

    def row(title: str, cell: Callable[[Stopping], str]) -> None:
        table.add_row(title, *(cell(axis) for axis in axes))

    row("joystick released", lambda a: a.cell(a.travel.release))
    row("joystick reversed", lambda a: a.cell(a.travel.reversal))
    row("  in the old direction", lambda a: f"{a.travel.reversal_s:.2f} s")
    row("joystick lost", lambda a: a.cell(a.travel.lost))
    row("enable lost, e-stop", lambda a: a.cell(a.travel.enable))
    row("its filter needs", lambda a: a.cell(a.needed_s))
    row("limits allow", lambda a: a.cell(a.allowed_s))
    row("stop_distance_m", lambda a: "-" if a.stated_m is None else f"{a.stated_m:g} m")
    row("valve's lag adds", lambda a: a.cell(a.maximum * VALVE_LAG_S))
    return table


def _notes(axes: list[Stopping]) -> Iterator[RenderableType]:
    yield Text(
        "Travel of the commands from the event on: it waits for the next command, a lost joystick"
        f" for its timeout. The valve's lag is assumed to be {VALVE_LAG_S:g} s.",
        "dim",
    )
    for axis in axes:
        if axis.stated_m is not None and axis.needed_s > axis.allowed_s:
            yield Text(
                f"WARNING: {axis.name}: its filter needs {axis.cell(axis.needed_s)};"
                f" stop_distance_m ends it at {axis.stated_m:g} m, and more swing is left."
            )
    if unknown := [axis.name for axis in axes if axis.speed.m_s is None]:
        yield Text(
            f"{', '.join(unknown)}: in seconds of full speed; the file has no speed of the tip"
            " (sway.full_speed_m_s, or slewing).",
            "dim",
        )
    if all(axis.speed.rad_s is None for axis in axes):
        yield Text(
            "No axis has the section slewing: of one that slews these are metres at the radius of"
            " its sway.full_speed_m_s, not at the largest one.",
            "dim",
        )


def _motion_notes(deployment: Deployment) -> Iterator[RenderableType]:
    for motion in (bound.config for bound in deployment.motions.values()):
        if motion.near_far is not None:
            yield Text(
                f"{motion.slew}, {motion.near_far}: each of them alone; in their motion the way"
                " that one adds to the other comes on top.",
                "dim",
            )


def travel(new_axis: Callable[[], ShapedAxis], *, timeout_s: float, period_s: float) -> Travel:
    """Return the travel of an axis with its filter: it is run, and the worse direction counts.

    Args:
        new_axis: makes the axis.
        timeout_s: age at which the joystick counts as lost.
        period_s: time between two calls of ``ShapedAxis.tick``.
    """
    return Travel.worst([_travel(new_axis(), sign, timeout_s, period_s) for sign in (1.0, -1.0)])


def _travel(axis: ShapedAxis, sign: float, timeout_s: float, period_s: float) -> Travel:
    axis.tick(CommandInput())
    for _ in range(round(WARM_UP_S / period_s)):
        axis.tick(CommandInput(sign))
    # Until the next tick, and for silence until the timeout too, the axis moves on at full speed.
    full = sign * axis.output.setpoint

    def after(joystick: CommandInput, wait_s: float = period_s) -> float:
        return full * wait_s + _way(axis, joystick, sign, period_s)[0]

    way, ticks = _way(axis, CommandInput(-sign), sign, period_s)
    return Travel(
        release=after(CommandInput()),
        reversal=full * period_s + way,
        lost=after(CommandInput(fault=Reason.JOYSTICK_TIMEOUT), timeout_s + period_s),
        enable=after(CommandInput(enabled=False)),
        reversal_s=ticks * period_s,
    )


def needed_s(
    new_axis: Callable[[], ShapedAxis], tail_s: float, *, timeout_s: float, period_s: float
) -> float:
    """Return the least bound of travel, s of full speed, that cuts no run-on of a filter short.

    It holds for every stroke at full speed, and includes the timeout of a lost joystick.

    Args:
        new_axis: makes the axis, with ``OutputLimits.run_on`` that bounds nothing.
        tail_s: how long its output may run on.
        timeout_s, period_s: as of ``travel``.
    """
    most = 0.0
    ticks = max(round(RELEASES_S / period_s), 1)
    longest_s = max(LONGEST_PULSE_S, tail_s)
    for sign in (1.0, -1.0):
        axis, way = new_axis(), 0.0
        axis.tick(CommandInput())
        for _ in range(round(longest_s / RELEASES_S)):
            for _ in range(ticks):
                axis.tick(CommandInput(sign))
            way = max(way, _way(axis, CommandInput(), sign, period_s)[0])
        most = max(most, sign * axis.output.setpoint * (timeout_s + 2.0 * period_s) + way)
    return most


def _way(
    steady: ShapedAxis, joystick: CommandInput, sign: float, period_s: float
) -> tuple[float, int]:
    """Return the travel in the old direction, s of full speed, and how many ticks that takes."""
    axis = copy.deepcopy(steady)
    way_s = most_s = 0.0
    last = 0
    for tick in range(1, round(LONGEST_STOP_S / period_s) + 1):
        axis.tick(joystick)
        if axis.state not in MOVING:
            break
        velocity = sign * axis.output.setpoint
        way_s += velocity * period_s
        most_s = max(most_s, way_s)
        last = tick if velocity > 0.0 else last
    return most_s, last
