"""Stopping distance of an axis at the tip, against its bound; measured or rehearsed numbers."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypedDict

from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.config.section import simulated
from canshaper.config.source import Place
from canshaper.machine.deployment import Deployment
from canshaper.shaping.limits import OutputLimits

# Farthest that limits allow without a word of the file: what a tip at 1 m/s, a usual speed of
# near-far, travels in the default tail of 2 s. A person next to the load needs to know of more.
MOST_UNSTATED_M = 2.0


@dataclass(frozen=True, slots=True)
class FullSpeed:
    """Full speed of an axis.

    Attributes:
        m_s: speed of the tip; None where the file does not say.
        rad_s: angular speed of an axis that slews; None where it does not, or none is given.
    """

    m_s: float | None
    rad_s: float | None


def full_speed(axis: AxisSection) -> FullSpeed:
    """Full speed of an axis, of one that slews at its largest radius where that is known."""
    slewing = axis.slewing
    speed_m_s = axis.sway.full_speed_m_s if axis.sway else None
    if slewing:
        speed = slewing.full_speed_rad_s
        return FullSpeed(speed * slewing.largest_radius_m, speed)
    return FullSpeed(speed_m_s, None)


def output_limits(axis: AxisSection, *, timeout_ms: int, period_s: float) -> OutputLimits:
    """Limits of an axis, with the run-on that its ``stop_distance_m`` leaves.

    The tip travels at full speed until a lost joystick is seen, and while a command waits; what is
    left of the distance is for the run-on. Arguments as ``allowed_m``.
    """
    limits = axis.limits.output_limits()
    stated, speed = axis.limits.stop_distance_m, full_speed(axis).m_s
    if stated is None or speed is None:
        return limits
    waits = limits.maximum * (timeout_ms / 1000.0 + 2.0 * period_s)
    return replace(limits, run_on=stated / speed - waits)


def allowed_s(limits: OutputLimits, *, stop_s: float, timeout_s: float, period_s: float) -> float:
    """Travel that the limits allow after release or a lost joystick, whatever the filter does.

    Full speed until the event is seen, full speed for the whole tail, then the slowest fall; where
    the run-on is bounded no farther than that, and a period for the tick in which it ends.

    Args:
        limits: limits of the axis.
        stop_s: longest duration of STOPPING.
        timeout_s: age at which the joystick counts as lost.
        period_s: time between two commands to the valve; an event waits so long at most.

    Returns:
        Seconds of full speed.
    """
    full, fall = limits.maximum, limits.fall_per_s
    # Durations are whole ticks; the longest that rounding makes of them.
    tail_s, stop_s = limits.tail_s + 0.5 * period_s, max(stop_s + 0.5 * period_s, period_s)
    falling_s = min(full / fall, max(0.0, stop_s - tail_s))
    stop = full * min(tail_s, stop_s) + (full - 0.5 * fall * falling_s) * falling_s
    release = full * tail_s + 0.5 * full * full / fall
    run_on = limits.run_on + full * period_s
    stop, release = min(stop, run_on), min(release, run_on)
    return max(full * (timeout_s + period_s) + stop, full * period_s + release)


def allowed_m(axis: AxisSection, *, timeout_ms: int, period_s: float) -> float | None:
    """Farthest that the limits allow the tip to travel when it stops; None without its speed.

    Args:
        axis: the axis.
        timeout_ms: that of its joystick.
        period_s: time between two commands to the valve.
    """
    speed = full_speed(axis).m_s
    if speed is None:
        return None
    return speed * allowed_s(
        output_limits(axis, timeout_ms=timeout_ms, period_s=period_s),
        stop_s=axis.limits.stop_s,
        timeout_s=timeout_ms / 1000.0,
        period_s=period_s,
    )


def stated_fault(axis: AxisSection, *, timeout_ms: int, period_s: float) -> str | None:
    """Why no limit keeps an axis within its ``stop_distance_m``, or None; as ``allowed_m``."""
    stated, speed = axis.limits.stop_distance_m, full_speed(axis).m_s
    if stated is None:
        return None
    if speed is None:
        return f"expected the section sway or slewing with it, got {stated:g} m without"
    limits = output_limits(axis, timeout_ms=timeout_ms, period_s=period_s)
    lacks = 0.5 * limits.maximum**2 / limits.fall_per_s - limits.run_on
    if lacks <= 0.0:
        return None
    return (
        f"expected {_up(stated + lacks * speed)} m or more, what it travels without any run-on by"
        f" max_pct, fall_per_s, timeout_ms and the speed of the tip, got {stated:g} m"
    )


def unstated_fault(axis: AxisSection, *, timeout_ms: int, period_s: float) -> str | None:
    """Why an axis may not move without a ``stop_distance_m``, or None; as ``allowed_m``."""
    allowed = allowed_m(axis, timeout_ms=timeout_ms, period_s=period_s)
    if axis.limits.stop_distance_m is not None or allowed is None or allowed <= MOST_UNSTATED_M:
        return None
    return (
        f"missing: to stop, the limits allow {_up(allowed)} m, which is more than"
        f" {MOST_UNSTATED_M:g} m; write how far the tip may travel when it stops"
    )


def stop_fault(deployment: Deployment, name: str, axis: AxisSection) -> str | None:
    """Why the stopping distance of an axis is too long, stated in the file or not; None if not.

    Args:
        deployment: the machine.
        name: the axis.
        axis: its configuration, or another one that it shall have.
    """
    times = when(deployment, name)
    return stated_fault(axis, **times) or unstated_fault(axis, **times)


def unstated(deployment: Deployment) -> Iterator[tuple[Place, str]]:
    """Axes that stop over a long way which the file does not state: where, and why."""
    for name, axis in deployment.axes.items():
        if fault := unstated_fault(axis.config, **when(deployment, name)):
            yield ("axes", name, "limits", "stop_distance_m"), fault


class When(TypedDict):
    """Times on which the stopping distance of an axis depends, see ``allowed_m``."""

    timeout_ms: int
    period_s: float


def when(deployment: Deployment, name: str) -> When:
    """When an axis sees an event: timeout of its joystick, time between two commands."""
    axis = deployment.axes[name]
    return {
        "timeout_ms": axis.timeout_ms,
        "period_s": axis.period_ticks * deployment.config.tick_ms / 1000.0,
    }


def _up(distance_m: float) -> str:
    """Rounded up to the centimetre, so that it can be written as it is shown."""
    return f"{math.ceil(100.0 * distance_m - 1e-9) / 100.0:g}"


def rehearsed(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Sections with numbers of a simulated crane: where, and what to do."""
    for place in simulated(config):
        yield place, "measured on a simulated crane; measure it on the machine"


def rehearsed_valves(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Valve curves of a simulated crane that would move valves on a real bus: where, and why."""
    for name, axis in config.axes.items():
        bus = config.buses[axis.valve.bus]
        if not bus.is_virtual:
            for place in simulated(axis.limits, ("axes", name, "limits")):
                text = (
                    "expected a valve measured on the machine, got one of a simulated crane, on"
                    f" {bus.interface} {bus.channel}; canshaper calibrate --live measures it,"
                    " canshaper run --simulated takes it as it is"
                )
                yield place, text
