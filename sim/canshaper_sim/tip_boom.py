"""The interface of a boom, and the boom whose tip the valves move directly, by its coordinates."""

from typing import Protocol

from canshaper_sim.actuator import Actuator
from canshaper_sim.axes import LIFT, NEAR_FAR, SLEW
from canshaper_sim.grapple import TipMotion, new_tuple


class CraneBoom(Protocol):
    """A boom that carries the grapple: its actuators by axis name, and the motion of its tip."""

    axes: dict[str, Actuator]

    @property
    def pose(self) -> tuple[float, float, float, float, float, float]:
        """Slew angle, radius and height of the tip, then their rates; rad, m, per second."""

    def advance(self, step_s: float) -> tuple[TipMotion, TipMotion, TipMotion]:
        """Advance by step_s seconds; return the tip motion at start, middle and end of the step."""


class TipBoom:
    """A boom without joints: one valve moves the tip in each cylindrical coordinate."""

    __slots__ = ("_lift", "_near_far", "_slew", "axes")

    def __init__(self, slew: Actuator, near_far: Actuator, lift: Actuator) -> None:
        self._slew, self._near_far, self._lift = slew, near_far, lift
        self.axes = {SLEW: slew, NEAR_FAR: near_far, LIFT: lift}

    @property
    def pose(self) -> tuple[float, float, float, float, float, float]:
        """Slew angle, radius and height of the tip, then their rates; rad, m, per second."""
        slew, near_far, lift = self._slew, self._near_far, self._lift
        return (
            slew.position,
            near_far.position,
            lift.position,
            slew.speed,
            near_far.speed,
            lift.speed,
        )

    def advance(self, step_s: float) -> tuple[TipMotion, TipMotion, TipMotion]:
        """Advance by step_s seconds; return the tip motion at start, middle and end of the step."""
        slew, near_far, lift = self._slew, self._near_far, self._lift
        start_radius, start_radius_rate = near_far.position, near_far.speed
        start_slew, start_slew_rate = slew.position, slew.speed
        start_height, start_height_rate = lift.position, lift.speed
        slew.advance(step_s)
        near_far.advance(step_s)
        lift.advance(step_s)
        start = (
            start_radius,
            start_radius_rate,
            near_far.start_acceleration,
            start_slew_rate,
            slew.start_acceleration,
            lift.start_acceleration,
            start_slew,
            start_height,
            start_height_rate,
        )
        middle = (
            near_far.middle_position,
            near_far.middle_speed,
            near_far.middle_acceleration,
            slew.middle_speed,
            slew.middle_acceleration,
            lift.middle_acceleration,
            slew.middle_position,
            lift.middle_position,
            lift.middle_speed,
        )
        end = (
            near_far.position,
            near_far.speed,
            near_far.end_acceleration,
            slew.speed,
            slew.end_acceleration,
            lift.end_acceleration,
            slew.position,
            lift.position,
            lift.speed,
        )
        return new_tuple(TipMotion, start), new_tuple(TipMotion, middle), new_tuple(TipMotion, end)
