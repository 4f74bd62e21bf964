"""One coordinate of the crane (tip or joint), moved by a valve between two end stops."""

import math
from dataclasses import dataclass

from canshaper_sim.ranges import check_ranges
from canshaper_sim.valve import Valve, ValveParameters

# name -> (lowest, highest) value.
_ALLOWED = {"cushion_s": (0.0, 2.0), "creep": (0.02, 1.0)}


@dataclass(frozen=True, slots=True)
class EndParameters:
    """End stops of every axis: hard by default, or with a cushion ahead of each stop.

    A cushion throttles the oil over the last part of the stroke. A profiled cushion brakes with a
    constant deceleration, which gives the least peak pressure: the largest speed falls with the
    square root of the way left to the stop, down to ``creep``. On the way back a check valve
    bypasses the cushion. Cylinders have 20 to 50 mm of cushion, which a crane at full speed passes
    in 0.1 to 0.3 s (catalogues; Hydraulic Trainer, Rexroth).
    """

    cushion_s: float = 0.0  # length of the cushion, in s of full speed; 0: none
    creep: float = 0.1  # speed that it lets through at its end, fraction of full speed

    def __post_init__(self) -> None:
        check_ranges("ends", self, _ALLOWED)


class Actuator:
    """A coordinate between two end stops; its speed is the output of its valve times a full speed.

    `advance` computes position and speed at the middle and the end of a step and acceleration at
    start, middle and end. At a stop the oil goes over the relief valve: the valve runs on, the
    coordinate stands still. A cushion before the stop bounds the speed. The middle acceleration is
    chosen so that Simpson's rule gives the true change of speed; a stop, or a spool that arrives
    within the step, thus gives the grapple its exact impulse instead of a spike that depends on
    where the stages of its Runge-Kutta step fall.

    Positions are in rad or m, speeds in these per s, accelerations per s^2.
    """

    __slots__ = (
        "_cushion",
        "_full_speed",
        "_high",
        "_low",
        "at_stop",
        "end_acceleration",
        "middle_acceleration",
        "middle_position",
        "middle_speed",
        "position",
        "speed",
        "start_acceleration",
        "valve",
    )

    def __init__(
        self,
        valve: ValveParameters,
        full_speed: float,
        start: float,
        low: float,
        high: float,
        *,
        ends: EndParameters | None = None,
    ) -> None:
        self.valve = Valve(valve)
        self.position = start
        self.speed = 0.0
        self.at_stop = False
        self.start_acceleration = 0.0
        self.middle_position = start
        self.middle_speed = 0.0
        self.middle_acceleration = 0.0
        self.end_acceleration = 0.0
        self._full_speed = full_speed
        self._low = low
        self._high = high
        self._cushion = ends if ends and ends.cushion_s else None

    @property
    def room_s(self) -> float:
        """Time in s that the coordinate needs at full speed to its upper end stop."""
        return (self._high - self.position) / self._full_speed

    def advance(self, step_s: float) -> None:
        """Move valve and coordinate on by step_s seconds."""
        full_speed = self._full_speed
        start = self.position
        start_speed = self.speed
        start_rate, middle_speed, speed, end_rate = self.valve.advance(step_s)
        start_acceleration = full_speed * start_rate
        middle_speed *= full_speed
        speed *= full_speed
        end = start + step_s / 6.0 * (start_speed + 4.0 * middle_speed + speed)
        end_acceleration = full_speed * end_rate
        braked = False
        if self._cushion:
            middle_most, most = self._most_speeds(self._cushion, middle_speed, step_s)
            if braked := abs(middle_speed) > middle_most or abs(speed) > most:
                middle_speed = math.copysign(min(abs(middle_speed), middle_most), middle_speed)
                speed = math.copysign(min(abs(speed), most), speed)
                end = start + step_s / 6.0 * (start_speed + 4.0 * middle_speed + speed)
                end_acceleration = 2.0 * (speed - middle_speed) / step_s
        at_stop = not self._low <= end <= self._high
        if at_stop:
            end = self._low if end < self._low else self._high
            speed = 0.0
            middle_speed = 0.25 * (6.0 * (end - start) / step_s - start_speed)
            end_acceleration = 0.0
        if at_stop or braked:
            # Runge-Kutta sees (a0 + 2 a_mid) h^2/6 as travel and (a0 + 4 a_mid + a1) h/6 as
            # change of speed: so both are met.
            travel = 6.0 * ((end - start) / step_s - start_speed) / step_s
            change = 6.0 * (speed - start_speed) / step_s
            middle_acceleration = 0.5 * (change - end_acceleration - travel)
            start_acceleration = travel - 2.0 * middle_acceleration
        else:
            middle_acceleration = 0.25 * (
                6.0 * (speed - start_speed) / step_s - start_acceleration - end_acceleration
            )
        # The parabola of the speed through start, middle and end, integrated to the middle.
        self.middle_position = start + step_s / 24.0 * (
            5.0 * start_speed + 8.0 * middle_speed - speed
        )
        self.at_stop = at_stop
        self.start_acceleration = start_acceleration
        self.middle_speed = middle_speed
        self.middle_acceleration = middle_acceleration
        self.end_acceleration = end_acceleration
        self.position = end
        self.speed = speed

    def _most_speeds(
        self, cushion: EndParameters, towards: float, step_s: float
    ) -> tuple[float, float]:
        """Return the cushion's largest speeds at middle and end of a step, by `towards`' sign."""
        full_speed = self._full_speed
        room = self._high - self.position if towards > 0.0 else self.position - self._low
        # sqrt(room) falls in a straight line, and so does the speed.
        bound = full_speed * math.sqrt(room / (full_speed * cushion.cushion_s))
        fall = 0.5 * full_speed / cushion.cushion_s * step_s
        creep = cushion.creep * full_speed
        return max(creep, bound - 0.5 * fall), max(creep, bound - fall)
