"""An overhead crane: bridge, trolley and hoist; a load that hangs from a rope and swings freely.

The load is a point at r below the trolley, at the length of the rope: |r| = l(t). The tension of
the rope per kg of load and m of rope, k, keeps this distance:

    r'' = -a - g e_z - k r - c (r' - (l'/l) r)      a: acceleration of the trolley
    k = (r . (-a - g e_z) + |r'|^2 - l'^2 - l l'') / l^2        c = 2 damping_ratio sqrt(g / l)

(r . r = l^2, differentiated twice; Goldstein, Classical Mechanics, 1.4). No small angle is assumed,
and the terms of a rope that changes its length, such as 2 l' theta', are included. The rope never
gets slack: the load never falls freely.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from canshaper_sim.actuator import Actuator, EndParameters
from canshaper_sim.axes import BRIDGE, HOIST, TROLLEY
from canshaper_sim.ranges import check_ranges
from canshaper_sim.sling import PARTS, SlingParameters, SlungLoad, Vector, dot, plus
from canshaper_sim.valve import ValveParameters

if TYPE_CHECKING:
    from canshaper_sim.grapple import Sway

# name -> (lowest, highest) value that still describes an overhead crane.
_ALLOWED = {
    "bridge_full_speed_m_s": (0.05, 20.0),
    "trolley_full_speed_m_s": (0.05, 20.0),
    "runway_m": (1.0, 1000.0),
    "span_m": (1.0, 200.0),
}
_ROPE = {
    "hoist_full_speed_m_s": (0.02, 3.0),
    "rope_min_m": (0.5, 150.0),
    "rope_max_m": (0.5, 150.0),
    "damping_ratio": (0.0, 0.5),
    "rope_error_pct": (-50.0, 50.0),
    "g_m_s2": (1.0, 25.0),
}


def drive() -> ValveParameters:
    """Return an electric drive: no deadband, full speed within 0.2 s, a lag of 0.1 s."""
    return ValveParameters(deadband=0.0, rate_limit_1_s=5.0, lag_s=0.1)


@dataclass(frozen=True, slots=True)
class RopeParameters:
    """Hoist and rope of a crane, and the damping of its load's swing."""

    hoist: ValveParameters = field(default_factory=drive)
    hoist_full_speed_m_s: float = 0.5
    rope_m: float = 8.0  # down to the middle of the load, at the start
    rope_min_m: float = 1.5
    rope_max_m: float = 30.0
    damping_ratio: float = 0.005
    rope_error_pct: float = 0.0  # error of the length signal
    g_m_s2: float = 9.81

    def check(self, owner: str, allowed: Mapping[str, tuple[float, float]]) -> None:
        """Raise DesignError for a value outside its range; `allowed` adds to those of the rope."""
        start = {"rope_m": (self.rope_min_m, self.rope_max_m)}
        check_ranges(owner, self, {**allowed, **_ROPE, **start})

    def winch(self, ends: EndParameters) -> Actuator:
        """Return the hoist at the start; its position is minus the length of the rope, m."""
        rope = (-self.rope_m, -self.rope_max_m, -self.rope_min_m)
        return Actuator(self.hoist, self.hoist_full_speed_m_s, *rope, ends=ends)


@dataclass(frozen=True, slots=True)
class OverheadParameters(RopeParameters):
    """Drives, full speeds and ranges of one overhead crane, its rope and its start pose."""

    bridge: ValveParameters = field(default_factory=drive)
    trolley: ValveParameters = field(default_factory=drive)
    bridge_full_speed_m_s: float = 1.0
    trolley_full_speed_m_s: float = 1.0
    runway_m: float = 100.0  # the trolley begins in the middle of runway and span
    span_m: float = 60.0
    sling: SlingParameters = field(default_factory=SlingParameters)

    def __post_init__(self) -> None:
        self.check("overhead", _ALLOWED)

    def boom(self, ends: EndParameters) -> "OverheadBoom":
        """Return bridge, trolley and rope in the start pose."""
        runway, span = 0.5 * self.runway_m, 0.5 * self.span_m
        return OverheadBoom(
            {
                BRIDGE: Actuator(
                    self.bridge, self.bridge_full_speed_m_s, 0.0, -runway, runway, ends=ends
                ),
                TROLLEY: Actuator(
                    self.trolley, self.trolley_full_speed_m_s, 0.0, -span, span, ends=ends
                ),
                HOIST: self.winch(ends),
            },
            self,
            self.sling,
        )


class OverheadBoom:
    """Bridge, trolley and rope, with the load on it.

    Args:
        axes: actuators of the three axes; the hoist's position is minus the length of the rope, m.
        parameters: hoist and rope of the crane.
        sling: the sling between hook and load, if there is one.

    Attributes:
        load: load relative to the trolley: along the runway, along the bridge, upwards, m. With a
            sling this is the hook.
        rate: velocity of ``load``, m/s.
        slung: the load on the sling; None without a sling, and before ``swing``.
    """

    def __init__(
        self,
        axes: dict[str, Actuator],
        parameters: RopeParameters,
        sling: SlingParameters | None = None,
    ) -> None:
        self.axes = axes
        self._p = parameters
        self._sling = sling if sling and sling.length_m else None
        self.load: Vector = (0.0, 0.0, axes[HOIST].position)
        self.rate: Vector = (0.0, 0.0, 0.0)
        self.slung: SlungLoad | None = None

    def swing(self, sway: "Sway") -> None:
        """Hang the load at theta5 along the runway, theta6 along the bridge; rates are ignored."""
        along, across = math.tan(sway.theta5_rad), math.tan(sway.theta6_rad)
        down = self.rope_m / math.sqrt(1.0 + along * along + across * across)
        self.load = (down * along, down * across, -down)
        if self._sling:
            p = self._p
            self.slung = SlungLoad(self._sling, p.damping_ratio, p.g_m_s2, self.load)

    @property
    def rope_m(self) -> float:
        """Length of the rope, m."""
        return -self.axes[HOIST].position

    @property
    def signal_m(self) -> float:
        """Length of the rope that the crane reports, m."""
        return self.rope_m * (1.0 + self._p.rope_error_pct / 100.0)

    @property
    def angles(self) -> tuple[float, float, float, float]:
        """Swing along runway and along bridge, rad, then the rates of both, rad/s."""
        x, y, z = self.load
        vx, vy, vz = self.rate
        along, across = x * x + z * z, y * y + z * z
        return (
            math.atan2(x, -z),
            math.atan2(y, -z),
            (x * vz - z * vx) / along,
            (y * vz - z * vy) / across,
        )

    @property
    def sling_angles(self) -> tuple[float, float]:
        """Swing of the sling along runway and bridge, rad; of the rope if there is no sling."""
        if not self.slung:
            return self.angles[:2]
        x, y, z = plus(self.slung.position, -1.0, self.hook)
        return math.atan2(x, -z), math.atan2(y, -z)

    @property
    def hook(self) -> Vector:
        """Position of the hook, m, in the same coordinates as ``SlungLoad.position``."""
        bridge, trolley, _ = self.axes.values()
        return plus((bridge.position, trolley.position, 0.0), 1.0, self.load)

    @property
    def pose(self) -> tuple[float, float, float, float, float, float]:
        """Angle and distance of the trolley from its start, minus the rope's length, then rates.

        In rad and m, per second; at the start itself the rates of angle and distance are 0.
        """
        bridge, trolley, hoist = self.axes.values()
        x, y, vx, vy = bridge.position, trolley.position, bridge.speed, trolley.speed
        radius = math.hypot(x, y)
        turn = (x * vy - y * vx) / radius**2 if radius else 0.0
        out = (x * vx + y * vy) / radius if radius else 0.0
        return math.atan2(y, x), radius, hoist.position, turn, out, hoist.speed

    def advance(self, step_s: float) -> None:
        """Move bridge, trolley, rope and load on by step_s seconds."""
        if not (slung := self.slung):
            self._move(step_s)
            return
        part_s = step_s / PARTS
        for _ in range(PARTS):  # half a pull, both on their ways, half a pull
            self._pull(slung, 0.5 * part_s)
            self._move(part_s)
            slung.position = plus(slung.position, part_s, slung.rate)
            self._pull(slung, 0.5 * part_s)

    def _pull(self, slung: SlungLoad, part_s: float) -> None:
        """Let the sling pull at the hook for part_s seconds; the rope bears the part along it."""
        bridge, trolley, _ = self.axes.values()
        rate = plus((bridge.speed, trolley.speed, 0.0), 1.0, self.rate)
        change = slung.pull(part_s, self.hook, rate)
        r = self.load
        self.rate = plus(plus(self.rate, 1.0, change), -dot(r, change) / dot(r, r), r)

    def _move(self, step_s: float) -> None:
        bridge, trolley, _ = self.axes.values()
        for axis in (bridge, trolley):
            axis.advance(step_s)
        start = (bridge.start_acceleration, trolley.start_acceleration, 0.0)
        middle = (bridge.middle_acceleration, trolley.middle_acceleration, 0.0)
        end = (bridge.end_acceleration, trolley.end_acceleration, 0.0)
        self._hang(step_s, start, middle, end)

    def _hang(self, step_s: float, start: Vector, middle: Vector, end: Vector) -> None:
        """Move rope and load on below a trolley with these accelerations, m/s^2.

        One classical Runge-Kutta step, then load and rate are put back onto the rope.
        """
        hoist = self.axes[HOIST]
        before = hoist.position, hoist.speed
        hoist.advance(step_s)
        ropes = (
            (*before, hoist.start_acceleration),
            (hoist.middle_position, hoist.middle_speed, hoist.middle_acceleration),
            (hoist.position, hoist.speed, hoist.end_acceleration),
        )
        r, v, half = self.load, self.rate, 0.5 * step_s
        a1 = self._acceleration(r, v, start, ropes[0])
        r2, v2 = plus(r, half, v), plus(v, half, a1)
        a2 = self._acceleration(r2, v2, middle, ropes[1])
        r3, v3 = plus(r, half, v2), plus(v, half, a2)
        a3 = self._acceleration(r3, v3, middle, ropes[1])
        r4, v4 = plus(r, step_s, v3), plus(v, step_s, a3)
        a4 = self._acceleration(r4, v4, end, ropes[2])
        sixth = step_s / 6.0
        r = plus(plus(plus(plus(r, sixth, v), 2 * sixth, v2), 2 * sixth, v3), sixth, v4)
        v = plus(plus(plus(plus(v, sixth, a1), 2 * sixth, a2), 2 * sixth, a3), sixth, a4)
        length, change = -hoist.position, -hoist.speed
        self.load = r = plus((0.0, 0.0, 0.0), length / math.sqrt(dot(r, r)), r)
        self.rate = plus(v, (change * length - dot(r, v)) / length**2, r)

    def _acceleration(
        self, r: Vector, v: Vector, trolley: Vector, hoist: tuple[float, float, float]
    ) -> Vector:
        """Return the acceleration of the load relative to the trolley, m/s^2.

        Args:
            r: load relative to the trolley, m.
            v: velocity of r, m/s.
            trolley: acceleration of the trolley, m/s^2.
            hoist: minus the length of the rope (m), then speed (m/s), acceleration (m/s^2).
        """
        length, change, change_2 = (-one for one in hoist)
        pull = (-trolley[0], -trolley[1], -trolley[2] - self._p.g_m_s2)
        tension = (dot(r, pull) + dot(v, v) - change**2 - length * change_2) / length**2
        damping = 2.0 * self._p.damping_ratio * math.sqrt(self._p.g_m_s2 / length)
        return plus(plus(pull, damping * change / length - tension, r), -damping, v)
