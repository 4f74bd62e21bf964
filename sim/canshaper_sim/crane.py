"""The simulated crane: three valves move the boom tip, the grapple hangs from it and swings.

The tip moves in cylindrical coordinates about the pillar (slew angle theta1, radius x, height z)
and follows its valves exactly: boom flexibility and pump pressure are left out, as in the paper.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from canshaper_sim.grapple import Grapple, Sway, TipMotion, advance
from canshaper_sim.valve import Valve, ValveParameters

SLEW: Final = "slew"  # positive: theta1 grows
NEAR_FAR: Final = "near_far"  # positive: outwards
LIFT: Final = "lift"  # positive: upwards
AXES: Final = (SLEW, NEAR_FAR, LIFT)

# Longest internal step. Free of stops, driven runs agree with 0.5 ms steps within 4e-7 rad (1e-8
# without dead time), where a stop is met within 5e-4 rad; 20 ms steps would do 3e-6 and 1e-3 rad.
INTERNAL_STEP_S: Final = 0.010

_HORIZONTAL: Final = math.pi / 2.0

# name -> (lowest, highest) value that still describes a forestry or loader crane.
_ALLOWED = {
    "slew_full_speed_rad_s": (0.01, 3.0),
    "near_far_full_speed_m_s": (0.01, 5.0),
    "lift_full_speed_m_s": (0.01, 5.0),
    "radius_min_m": (0.0, 30.0),
    "radius_max_m": (0.0, 30.0),
    "height_min_m": (-20.0, 30.0),
    "height_max_m": (-20.0, 30.0),
    "start_theta1_rad": (-1000.0, 1000.0),
}


@dataclass(frozen=True, slots=True)
class CraneParameters:
    """Grapple, valves, full speeds, end stops and start pose of one crane.

    Full speed is the speed of the tip (slew: of theta1) when the valve lets full flow through.
    """

    grapple: Grapple = field(default_factory=Grapple)
    slew: ValveParameters = field(default_factory=ValveParameters)
    near_far: ValveParameters = field(default_factory=ValveParameters)
    lift: ValveParameters = field(default_factory=ValveParameters)
    slew_full_speed_rad_s: float = 0.5
    near_far_full_speed_m_s: float = 1.0
    lift_full_speed_m_s: float = 0.8
    radius_min_m: float = 1.8
    radius_max_m: float = 8.0
    height_min_m: float = 1.5  # the grapple (1.4 m) just clears the ground
    height_max_m: float = 7.0
    start_theta1_rad: float = 0.0
    start_radius_m: float = 3.0
    start_height_m: float = 4.0

    def __post_init__(self) -> None:
        allowed = dict(_ALLOWED)
        allowed["start_radius_m"] = (self.radius_min_m, self.radius_max_m)
        allowed["start_height_m"] = (self.height_min_m, self.height_max_m)
        for name, (low, high) in allowed.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"crane: {name} = {value}, allowed {low} .. {high}")


class CraneState(NamedTuple):
    """Pose, tip speeds and sway at one instant; angles in rad, lengths in m, per second."""

    time_s: float
    theta1_rad: float
    radius_m: float
    height_m: float
    theta1_rate_rad_s: float
    radius_rate_m_s: float
    height_rate_m_s: float
    theta5_rad: float
    theta6_rad: float
    theta5_rate_rad_s: float
    theta6_rate_rad_s: float


class _TipAxis:
    """One coordinate of the tip: a valve times a full speed, between two end stops.

    `advance` gives position and speed at the middle and the end of a step and the acceleration at
    start, middle and end. At a stop the oil goes over the relief valve: the valve runs on, the tip
    stands. The middle acceleration is chosen so that Simpson's rule gives the true change of
    speed; a stop, or a spool that arrives within the step, thus gives the grapple its exact
    impulse instead of a spike that depends on where the stages fall.
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

    def advance(self, step_s: float) -> None:
        """Move on by step_s seconds."""
        valve = self.valve
        full_speed = self._full_speed
        start = self.position
        start_speed = self.speed
        self.start_acceleration = full_speed * valve.speed_rate
        valve.advance(0.5 * step_s)
        middle_speed = full_speed * valve.speed
        valve.advance(0.5 * step_s)
        speed = full_speed * valve.speed
        end = start + step_s / 6.0 * (start_speed + 4.0 * middle_speed + speed)
        self.at_stop = not self._low <= end <= self._high
        if self.at_stop:
            end = self._low if end < self._low else self._high
            speed = 0.0
            middle_speed = 0.25 * (6.0 * (end - start) / step_s - start_speed)
            # Runge-Kutta sees (a0 + 2 a_mid) h^2/6 as travel and (a0 + 4 a_mid + a1) h/6 as
            # change of speed: with a1 = 0 both are met.
            travel = 6.0 * ((end - start) / step_s - start_speed) / step_s
            middle_acceleration = 0.5 * (-6.0 * start_speed / step_s - travel)
            self.start_acceleration = travel - 2.0 * middle_acceleration
            self.end_acceleration = 0.0
        else:
            self.end_acceleration = full_speed * valve.speed_rate
            middle_acceleration = 0.25 * (
                6.0 * (speed - start_speed) / step_s
                - self.start_acceleration
                - self.end_acceleration
            )
        # The parabola of the speed through start, middle and end, integrated to the middle.
        self.middle_position = start + step_s / 24.0 * (
            5.0 * start_speed + 8.0 * middle_speed - speed
        )
        self.middle_speed = middle_speed
        self.middle_acceleration = middle_acceleration
        self.position = end
        self.speed = speed


class Crane:
    """Crane and grapple in motion: `step` with the values in the valve frames, read `state`."""

    __slots__ = (
        "_axes",
        "_lift",
        "_near_far",
        "_slew",
        "_sway",
        "_time_s",
        "parameters",
        "swung_over",
    )

    def __init__(self, parameters: CraneParameters | None = None, sway: Sway | None = None) -> None:
        """Stand in the start pose, valves closed; `sway` is the initial sway (default: none)."""
        p = self.parameters = parameters or CraneParameters()
        self._slew = _TipAxis(
            p.slew, p.slew_full_speed_rad_s, p.start_theta1_rad, -math.inf, math.inf
        )
        self._near_far = _TipAxis(
            p.near_far,
            p.near_far_full_speed_m_s,
            p.start_radius_m,
            p.radius_min_m,
            p.radius_max_m,
        )
        self._lift = _TipAxis(
            p.lift, p.lift_full_speed_m_s, p.start_height_m, p.height_min_m, p.height_max_m
        )
        self._axes = {SLEW: self._slew, NEAR_FAR: self._near_far, LIFT: self._lift}
        self._sway = sway or Sway()
        self._time_s = 0.0
        # Set for good once a joint has passed 90 deg: the grapple is above the horizontal, where a
        # real one falls into its rotator and the numbers mean nothing any more.
        self.swung_over = False

    @property
    def state(self) -> CraneState:
        """The present state."""
        slew, near_far, lift = self._slew, self._near_far, self._lift
        return CraneState(
            self._time_s,
            slew.position,
            near_far.position,
            lift.position,
            slew.speed,
            near_far.speed,
            lift.speed,
            *self._sway,
        )

    @property
    def axes_at_stop(self) -> tuple[str, ...]:
        """The axes whose tip coordinate is held by an end stop just now."""
        return tuple(name for name, axis in self._axes.items() if axis.at_stop)

    def step(self, dt_s: float, commands: Mapping[str, float]) -> None:
        """Hold the commands (axis -> value of its valve frame, -1 .. 1) for dt_s seconds.

        An axis that is not in `commands` keeps its last one, as a valve between two frames does.
        Raises ValueError for dt_s <= 0, an unknown axis or a command that is not finite.
        """
        if not 0.0 < dt_s < math.inf:
            raise ValueError(f"crane: dt_s = {dt_s}, allowed positive values")
        for name, command in commands.items():
            axis = self._axes.get(name)
            if axis is None:
                raise ValueError(f"crane: axis {name!r}, allowed {', '.join(AXES)}")
            axis.valve.set_command(command)
        # The smallest number of equal steps; the margin forgives rounding of dt_s.
        count = math.ceil(dt_s / INTERNAL_STEP_S - 1e-9)
        step_s = dt_s / count
        for _ in range(count):
            self._advance(step_s)
        self._time_s += dt_s
        if abs(self._sway.theta5_rad) > _HORIZONTAL or abs(self._sway.theta6_rad) > _HORIZONTAL:
            self.swung_over = True

    def _advance(self, step_s: float) -> None:
        slew, near_far, lift = self._slew, self._near_far, self._lift
        start_radius, start_radius_rate = near_far.position, near_far.speed
        start_slew_rate = slew.speed
        slew.advance(step_s)
        near_far.advance(step_s)
        lift.advance(step_s)
        tips = (
            TipMotion(
                start_radius,
                start_radius_rate,
                near_far.start_acceleration,
                start_slew_rate,
                slew.start_acceleration,
                lift.start_acceleration,
            ),
            TipMotion(
                near_far.middle_position,
                near_far.middle_speed,
                near_far.middle_acceleration,
                slew.middle_speed,
                slew.middle_acceleration,
                lift.middle_acceleration,
            ),
            TipMotion(
                near_far.position,
                near_far.speed,
                near_far.end_acceleration,
                slew.speed,
                slew.end_acceleration,
                lift.end_acceleration,
            ),
        )
        self._sway = advance(self.parameters.grapple, self._sway, step_s, tips)
