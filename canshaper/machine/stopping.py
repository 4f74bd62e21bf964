"""Stopping distance of an axis at the tip, against its bound; measured or rehearsed numbers."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypedDict

from canshaper.config.enable import slowest_ms
from canshaper.config.origin import simulated
from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.config.source import Place
from canshaper.machine.deployment import Deployment
from canshaper.shaping.stopping import allowed_s

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
    limits = axis.limits
    return speed * allowed_s(
        limits.output_limits(),
        stop_s=limits.stop_s,
        timeout_s=timeout_ms / 1000.0,
        period_s=period_s,
    )


def stated_fault(axis: AxisSection, *, timeout_ms: int, period_s: float) -> str | None:
    """Why an axis breaks its own ``stop_distance_m``, or None; arguments as ``allowed_m``."""
    stated = axis.limits.stop_distance_m
    if stated is None:
        return None
    allowed = allowed_m(axis, timeout_ms=timeout_ms, period_s=period_s)
    if allowed is None:
        return f"expected the section sway or slewing with it, got {stated:g} m without"
    if allowed <= stated:
        return None
    return (
        f"expected {_up(allowed)} m or more, by max_pct, tail_s, stop_s, fall_per_s and the speed"
        f" of the tip, got {stated:g} m"
    )


def unstated_fault(axis: AxisSection, *, timeout_ms: int, period_s: float) -> str | None:
    """Why an axis may not move without a ``stop_distance_m``, or None; as ``allowed_m``."""
    allowed = allowed_m(axis, timeout_ms=timeout_ms, period_s=period_s)
    if axis.limits.stop_distance_m is not None or allowed is None or allowed <= MOST_UNSTATED_M:
        return None
    return (
        f"missing: to stop, the limits allow {_up(allowed)} m, which is more than"
        f" {MOST_UNSTATED_M:g} m; where that is meant, state stop_distance_m: {_up(allowed)}"
    )


def stop_fault(deployment: Deployment, name: str, axis: AxisSection) -> str | None:
    """Why an axis may not move over the way in which it stops, stated or not, or None.

    Args:
        deployment: the machine.
        name: the axis.
        axis: its configuration, or another one that it shall have.
    """
    when = _when(deployment, name)
    return stated_fault(axis, **when) or unstated_fault(axis, **when)


def unstated(deployment: Deployment) -> Iterator[tuple[Place, str]]:
    """Axes that stop over a long way which the file does not state: where, and why."""
    for name, axis in deployment.axes.items():
        if fault := unstated_fault(axis.config, **_when(deployment, name)):
            yield ("axes", name, "limits", "stop_distance_m"), fault


class _When(TypedDict):
    timeout_ms: int
    period_s: float


def _when(deployment: Deployment, name: str) -> _When:
    """When an axis sees an event."""
    axis = deployment.axes[name]
    return {
        "timeout_ms": slowest_ms(deployment.config, axis.config.command.joystick),
        "period_s": axis.period_ticks * deployment.config.tick_ms / 1000.0,
    }


def _up(distance_m: float) -> str:
    """Rounded up to the centimetre, so that it can be written as it is shown."""
    return f"{math.ceil(100.0 * distance_m - 1e-9) / 100.0:g}"


def rehearsed(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Sections with numbers of a simulated crane: where, and what to do."""
    for place in simulated(config.axes, ("axes",)):
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
