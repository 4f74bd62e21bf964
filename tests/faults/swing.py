"""The tool of a machine with sway sensors: it swings as its valves are commanded, and is disturbed.

One pendulum an axis, at the file's own length or another one; a model of this folder's own.
"""

import math
import random
from collections.abc import Iterable
from typing import TYPE_CHECKING

from tests.faults.axis import Axis

if TYPE_CHECKING:
    from tests.faults.fault import Fault

GRAVITY_M_S2 = 9.81
VALVE_LAG_S = 0.1
STEP_S = 0.005
# Speed that a push gives, per tick; and angle at which a pile holds the tool.
PUSH_RAD_S, HELD_RAD = 0.4, 0.05

KINDS = ("tool: pushed", "tool: held", "tool: longer")


class Swing:
    """How the tool swings along one axis."""

    def __init__(self, axis: Axis, rng: random.Random) -> None:
        assert axis.period_s is not None
        self.axis = axis
        period_s = axis.period_s * rng.choice((1.0, 1.0, rng.uniform(0.8, 1.25)))
        self._omega = 2.0 * math.pi / period_s
        self._damping = rng.uniform(0.01, 0.08)
        self._commanded = self._speed = 0.0
        self._time_ns = 0
        self.angle, self.rate = rng.choice((0.0, 0.0, rng.uniform(-0.2, 0.2))), 0.0

    def command(self, data: bytes) -> None:
        """The valve was sent this frame."""
        self._commanded = self.axis.velocity(self.axis.sent(data)[0]) * self.axis.full_speed_m_s

    def advance(self, now_ns: int, active: "Iterable[Fault]") -> None:
        """Swing until now, disturbed by the faults that act on this axis."""
        kinds = {f.kind for f in active if f.axis is self.axis}
        omega = self._omega * (0.8 if "tool: longer" in kinds else 1.0)
        if "tool: pushed" in kinds:
            self.rate += PUSH_RAD_S
        while self._time_ns < now_ns:
            self._time_ns += round(STEP_S * 1e9)
            tip_m_s2 = (self._commanded - self._speed) / VALVE_LAG_S
            self._speed += STEP_S * tip_m_s2
            fall = 2.0 * self._damping * omega * self.rate + omega**2 * math.sin(self.angle)
            self.rate += STEP_S * (omega**2 / GRAVITY_M_S2 * tip_m_s2 - fall)
            self.angle += STEP_S * self.rate
        if "tool: held" in kinds:
            self.angle, self.rate = HELD_RAD, 0.0
