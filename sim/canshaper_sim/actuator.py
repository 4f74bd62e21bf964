"""One coordinate of the crane moved by a valve between two end stops: of the tip, or a joint."""

from canshaper_sim.valve import Valve, ValveParameters


class Actuator:
    """A valve times a full speed, between two end stops.

    `advance` gives position and speed at the middle and the end of a step and the acceleration at
    start, middle and end. At a stop the oil goes over the relief valve: the valve runs on, the
    coordinate stands. The middle acceleration is chosen so that Simpson's rule gives the true
    change of speed; a stop, or a spool that arrives within the step, thus gives the grapple its
    exact impulse instead of a spike that depends on where the stages fall.

    Units are those of the coordinate: rad or m, per second.
    """

    __slots__ = (
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
        self, valve: ValveParameters, full_speed: float, start: float, low: float, high: float
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

    @property
    def room_s(self) -> float:
        """How long it moves at full speed until its upper end."""
        return (self._high - self.position) / self._full_speed

    def advance(self, step_s: float) -> None:
        """Move on by step_s seconds."""
        full_speed = self._full_speed
        start = self.position
        start_speed = self.speed
        start_rate, middle_speed, speed, end_rate = self.valve.advance(step_s)
        start_acceleration = full_speed * start_rate
        middle_speed *= full_speed
        speed *= full_speed
        end = start + step_s / 6.0 * (start_speed + 4.0 * middle_speed + speed)
        at_stop = not self._low <= end <= self._high
        if at_stop:
            end = self._low if end < self._low else self._high
            speed = 0.0
            middle_speed = 0.25 * (6.0 * (end - start) / step_s - start_speed)
            # Runge-Kutta sees (a0 + 2 a_mid) h^2/6 as travel and (a0 + 4 a_mid + a1) h/6 as
            # change of speed: with a1 = 0 both are met.
            travel = 6.0 * ((end - start) / step_s - start_speed) / step_s
            middle_acceleration = 0.5 * (-6.0 * start_speed / step_s - travel)
            start_acceleration = travel - 2.0 * middle_acceleration
            end_acceleration = 0.0
        else:
            end_acceleration = full_speed * end_rate
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
