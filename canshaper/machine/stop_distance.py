"""Stopping distance of an axis at the tip against its limit; numbers of a simulated crane."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypedDict

from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.config.section import simulated
from canshaper.config.source import Place
from canshaper.machine.deployment import Deployment
from canshaper.shaping.limits import OutputLimits

# Longest stopping distance that the file need not state: a tip at 1 m/s, a usual speed of near-far,
# travels as far in the default tail of 2 s. A person next to the load has to know of a longer one.
MOST_UNSTATED_M = 2.0


@dataclass(frozen=True, slots=True)
class FullSpeed:
    """Full speed of an axis.

    Attributes:
        m_s: speed of the tip, m/s; None where the file does not state it.
        rad_s: angular speed of a slewing axis, rad/s; None for any other axis.
    """

    m_s: float | None
    rad_s: float | None


def full_speed(axis: AxisSection) -> FullSpeed:
    """Return the full speed of an axis; the tip of a slewing axis is at its largest radius."""
    slewing = axis.slewing
    speed_m_s = axis.sway.full_speed_m_s if axis.sway else None
    if slewing:
        speed = slewing.full_speed_rad_s
        return FullSpeed(speed * slewing.largest_radius_m, speed)
    return FullSpeed(speed_m_s, None)


def output_limits(axis: AxisSection, *, timeout_ms: int, period_s: float) -> OutputLimits:
    """Return the limits of an axis, with the run-on that its ``stop_distance_m`` leaves.

    The tip travels at full speed until a lost joystick is seen, and while a command waits; the
    run-on may use the rest.

    ``timeout_ms``: of its joystick; ``period_s``: between two commands to the valve.
    """
    limits = axis.limits.output_limits()
    stated, speed = axis.limits.stop_distance_m, full_speed(axis).m_s
    if stated is None or speed is None:
        return limits
    waits = limits.maximum * (timeout_ms / 1000.0 + 2.0 * period_s)
    return replace(limits, run_on=stated / speed - waits)


def allowed_s(limits: OutputLimits, *, stop_s: float, timeout_s: float, period_s: float) -> float:
    """Return the travel that the limits allow after release or a lost joystick, for any filter.

    The axis moves at full speed until the event is seen, at full speed for the whole tail, then by
    the slowest fall. A bounded run-on ends earlier, plus one period for the tick in which it ends.

    Args:
        limits: limits of the axis.
        stop_s: longest duration of STOPPING, seconds.
        timeout_s: age at which the joystick counts as lost, seconds.
        period_s: time between two commands to the valve, seconds: the longest wait of an event.

    Returns:
        Seconds of full speed.
    """
    full, fall = limits.maximum, limits.fall_per_s
    # Durations are rounded to whole ticks; these are the longest results.
    tail_s, stop_s = limits.tail_s + 0.5 * period_s, max(stop_s + 0.5 * period_s, period_s)
    falling_s = min(full / fall, max(0.0, stop_s - tail_s))
    stop = full * min(tail_s, stop_s) + (full - 0.5 * fall * falling_s) * falling_s
    release = full * tail_s + 0.5 * full * full / fall
    run_on = limits.run_on + full * period_s
    stop, release = min(stop, run_on), min(release, run_on)
    return max(full * (timeout_s + period_s) + stop, full * period_s + release)


def allowed_m(axis: AxisSection, *, timeout_ms: int, period_s: float) -> float | None:
    """Return the longest stopping distance of the tip (m) that the limits allow.

    It is None where the file does not state the speed of the tip.

    Args:
        axis: the axis.
        timeout_ms: longest timeout of its joystick and the switches of that, milliseconds.
        period_s: time between two commands to the valve, seconds.
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
    """Return why no limit can keep an axis within its ``stop_distance_m``, or None.

    ``timeout_ms``: of its joystick; ``period_s``: between two commands to the valve.
    """
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
    """Return why an axis may not move without a ``stop_distance_m``, or None.

    ``timeout_ms``: of its joystick; ``period_s``: between two commands to the valve.
    """
    allowed = allowed_m(axis, timeout_ms=timeout_ms, period_s=period_s)
    if axis.limits.stop_distance_m is not None or allowed is None or allowed <= MOST_UNSTATED_M:
        return None
    return (
        f"missing: to stop, the limits allow {_up(allowed)} m, which is more than"
        f" {MOST_UNSTATED_M:g} m; write how far the tip may travel when it stops"
    )


def stop_fault(deployment: Deployment, name: str, axis: AxisSection) -> str | None:
    """Return the fault of the axis' stopping distance, stated or unstated; None without one.

    Args:
        deployment: the machine.
        name: name of the axis.
        axis: configuration to check: the present one of the axis, or a new one.
    """
    times = when(deployment, name)
    return stated_fault(axis, **times) or unstated_fault(axis, **times)


def unstated(deployment: Deployment) -> Iterator[tuple[Place, str]]:
    """Yield (place, fault) of axes with a long stopping distance that the file does not state."""
    for name, axis in deployment.axes.items():
        if fault := unstated_fault(axis.config, **when(deployment, name)):
            yield ("axes", name, "limits", "stop_distance_m"), fault


class When(TypedDict):
    """Timeout of an axis' joystick, and time between two commands to its valve."""

    timeout_ms: int
    period_s: float


def when(deployment: Deployment, name: str) -> When:
    """Return timeout of an axis' joystick and switches, and time between two commands."""
    axis = deployment.axes[name]
    return {
        "timeout_ms": axis.timeout_ms,
        "period_s": axis.period_ticks * deployment.config.tick_ms / 1000.0,
    }


def _up(distance_m: float) -> str:
    """Return a distance rounded up to the centimetre, so that the shown value is accepted."""
    return f"{math.ceil(100.0 * distance_m - 1e-9) / 100.0:g}"


def rehearsed(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Yield (place, what to do) of sections with numbers of a simulated crane."""
    for place in simulated(config):
        yield place, "measured on a simulated crane; measure it on the machine"


def rehearsed_valves(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Yield (place, fault) of valve curves of a simulated crane whose valve is on a real bus."""
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
