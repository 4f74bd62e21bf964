"""A load on a sling below a hook, a double pendulum with the rope; it may stand on the ground.

The load is a point in the world. A taut sling pulls it; while it stands on the ground, the ground
carries it and friction holds it. Sling and ground are springs per kg of load, as stiff as the step
length allows: about 6 mm of deflection under the load at rest. The drives feel no force of the
load.
"""

import math
from dataclasses import dataclass

from canshaper_sim.ranges import check_ranges

Vector = tuple[float, float, float]

PARTS = 4  # parts of a step: the spring of a sling with a light hook has a period of 35 ms
_OMEGA_RAD_S, _DAMPING_RATIO = 40.0, 0.3  # springs of sling and ground
_FRICTION = 0.5  # between load and ground
_STICKS_M_S = 0.01  # below which friction falls
_ALLOWED = {
    "length_m": (0.0, 20.0),
    "load_ratio": (0.05, 20.0),
    "ground_m": (1.0, math.inf),
    "off_m": (-5.0, 5.0),
}


@dataclass(frozen=True, slots=True)
class SlingParameters:
    """A sling from the hook to the load, and the ground on which the load may stand."""

    length_m: float = 0.0  # 0: they swing as one
    load_ratio: float = 1.0  # mass of the load, masses of the hook
    ground_m: float = math.inf  # below the trolley
    off_m: float = 0.0  # at the start the load stands so far from the hook, along the runway

    def __post_init__(self) -> None:
        check_ranges("sling", self, _ALLOWED)


class SlungLoad:
    """The load on a sling, and the force of the sling on both of its ends.

    Args:
        parameters: the sling.
        damping_ratio: damping ratio of a swing about the hook.
        g_m_s2: gravity.
        hook: position of the hook relative to the trolley, m; the load hangs in line with the rope,
            but for ``off_m`` and the ground.

    Attributes:
        position: along the runway, along the bridge, upwards, from where the trolley began, m.
        rate: velocity of the load, m/s.
    """

    def __init__(
        self, parameters: SlingParameters, damping_ratio: float, g_m_s2: float, hook: Vector
    ) -> None:
        self._p, self._g = parameters, g_m_s2
        self._damping = 2.0 * damping_ratio * math.sqrt(g_m_s2 / parameters.length_m)
        hangs_m = parameters.length_m + g_m_s2 / _OMEGA_RAD_S**2
        x, y, z = plus(hook, hangs_m / math.sqrt(dot(hook, hook)), hook)
        self.position: Vector = (x + parameters.off_m, y, max(z, -parameters.ground_m))
        self.rate: Vector = (0.0, 0.0, 0.0)

    def pull(self, part_s: float, hook: Vector, hook_rate: Vector) -> Vector:
        """Change the load's velocity by the forces that act on it for part_s seconds.

        Args:
            part_s: duration, s.
            hook: position of the hook, in the coordinates of the load, m.
            hook_rate: velocity of the hook, m/s.

        Returns:
            the change of the hook's velocity, as if it were free, m/s.
        """
        x, y, z = held = self._held(plus(hook, -1.0, self.position), hook_rate)
        vx, vy, vz = self.rate
        pressed = -self._p.ground_m - self.position[2]
        if pressed >= 0.0:
            carried = max(_OMEGA_RAD_S * (_OMEGA_RAD_S * pressed - 2.0 * vz), 0.0)
            # Friction, never more than what stops the load.
            drag = min(_FRICTION * carried / max(math.hypot(vx, vy), _STICKS_M_S), 1.0 / part_s)
            x, y, z = x - drag * vx, y - drag * vy, z + carried
        self.rate = plus(self.rate, part_s, (x, y, z - self._g))
        return plus((0.0, 0.0, 0.0), -part_s * self._p.load_ratio, held)

    def _held(self, up: Vector, hook_rate: Vector) -> Vector:
        """Return the sling's pull at the load, m/s^2, zeros if slack; `up` leads to the hook, m."""
        apart = math.sqrt(dot(up, up))
        stretch = apart - self._p.length_m
        if stretch <= 0.0:
            return (0.0, 0.0, 0.0)
        rate = plus(hook_rate, -1.0, self.rate)
        closing = 2.0 * _DAMPING_RATIO * dot(up, rate) / apart
        spring = max(_OMEGA_RAD_S * (_OMEGA_RAD_S * stretch + closing), 0.0) / apart
        return plus(plus((0.0, 0.0, 0.0), spring, up), self._damping, rate)


def plus(first: Vector, factor: float, second: Vector) -> Vector:
    """Return first + factor * second."""
    return (
        first[0] + factor * second[0],
        first[1] + factor * second[1],
        first[2] + factor * second[2],
    )


def dot(first: Vector, second: Vector) -> float:
    """Return the dot product of two vectors."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
