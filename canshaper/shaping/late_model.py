"""The sway model as it was at the time of a measurement: behind the valve and the sensor."""

import math
from collections import deque

from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.sway_sensor import SensorTiming

# The lead that a two-axis motion makes ends with the motion. The rest that rounding leaves decays
# with this time constant, and is 0 below this value (full speed times seconds).
LEAD_S, NO_LEAD = 1.0, 1e-5


class Late:
    """Velocity of an axis at the time when the sensor's newest value was measured.

    It is the commanded velocity, delayed by the sensor and behind the valve's lag.

    Args:
        timing: delay of the sensor and lag of the valve, s.
        tick_s: time between two ticks, s.

    Attributes:
        now: part of full speed at the end of the tick.
        middle: part of full speed in its middle.
    """

    __slots__ = ("_half", "_sent", "_share", "_whole", "middle", "now")

    def __init__(self, timing: SensorTiming, tick_s: float) -> None:
        ticks = timing.delay_s / tick_s
        whole = math.floor(ticks + 1e-9)
        self._sent = deque([0.0] * (whole + 2), maxlen=whole + 2)
        self._share = ticks - whole
        lag_s = timing.lag_s
        self._whole = -math.expm1(-tick_s / lag_s) if lag_s else 1.0
        self._half = -math.expm1(-0.5 * tick_s / lag_s) if lag_s else 1.0
        self.now = self.middle = 0.0

    def step(self, velocity: float) -> None:
        """Advance a tick in which ``velocity`` was sent."""
        sent = self._sent
        sent.append(velocity)
        held = sent[1] + self._share * (sent[0] - sent[1])
        now = self.now
        self.middle = now + self._half * (held - now)
        self.now = now + self._whole * (held - now)


class LateModel:
    """The sway as it was at the time of the measurement.

    The velocity that a motion of two axes adds makes no swing of the grapple, but it moves the tip
    ahead of the grapple: the measured angle includes that lead.

    Args:
        sway: sway model of the axis.
        timing: delay and lag.

    Attributes:
        speed: of the tip, full speeds.
    """

    __slots__ = ("_added", "_lead", "_own", "speed", "sway")

    def __init__(self, sway: SwayModel, timing: SensorTiming) -> None:
        tick_s = sway.tick_s
        self.sway = SwayModel(sway.mode, tick_s)
        self._own, self._added = Late(timing, tick_s), Late(timing, tick_s)
        self._lead = self.speed = 0.0

    def step(self, velocity: float, added: float) -> None:
        """Advance a tick in which ``velocity`` was sent for the axis itself, ``added`` besides."""
        own, tick_s = self._own, self.sway.tick_s
        own.step(velocity)
        self.sway.step(own.middle)
        late = self._added
        if added or self._lead or late.now:
            late.step(added)
            self._lead += tick_s * late.middle
            if not added:
                self._lead -= tick_s / LEAD_S * self._lead
                if abs(self._lead) < NO_LEAD and abs(late.now) < NO_LEAD:
                    self._lead = late.now = 0.0
        self.speed = own.now + late.now

    @property
    def angle(self) -> float:
        """Normalised angle, see ``SwayModel``."""
        return self.sway.angle + self._lead

    @property
    def rate(self) -> float:
        """Normalised rate of the angle."""
        return self.sway.rate + self.speed

    def restart(self) -> None:
        """Begin with no swing."""
        self.sway.angle = self.sway.rate = self._lead = 0.0

    def retune(self, mode: SwayMode) -> None:
        """Go on with another mode at the same physical swing."""
        self.sway = self.sway.retuned(mode, self._own.now)
