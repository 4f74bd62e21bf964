"""The boom joint by joint: four valves drive slew, lift, knuckle and extension between end stops.

The rate of a joint is its valve's opening times a full speed in every position of the joint: the
lever arms of the cylinders, which change by some tens of percent over the stroke, are left out, as
in the paper, whose inputs are joint speeds too. The tip follows from the kinematics of Eq. 1-3.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from canshaper.errors import DesignError
from canshaper_sim.actuator import Actuator, EndParameters
from canshaper_sim.axes import EXTENSION, KNUCKLE, LIFT_CYLINDER, SLEW
from canshaper_sim.grapple import TipMotion
from canshaper_sim.kinematics import Boom
from canshaper_sim.ranges import check_ranges
from canshaper_sim.valve import ValveParameters

# name -> (lowest, highest) value that still describes a forestry or loader crane.
_ALLOWED = {
    "pillar_m": (0.0, 10.0),
    "pillar_offset_m": (-2.0, 2.0),
    "main_boom_m": (0.5, 20.0),
    "knuckle_offset_m": (-1.0, 1.0),
    "outer_boom_m": (0.5, 20.0),
    "slew_min_deg": (-1e6, 0.0),
    "slew_max_deg": (0.0, 1e6),
    "lift_min_deg": (-89.0, 89.0),
    "lift_max_deg": (-89.0, 120.0),
    "knuckle_min_deg": (-175.0, 0.0),
    "knuckle_max_deg": (-175.0, 30.0),
    "extension_max_m": (0.0, 15.0),
    "start_extension_m": (0.0, 15.0),
    "lift_cylinder_full_speed_rad_s": (0.01, 3.0),
    "knuckle_full_speed_rad_s": (0.01, 3.0),
    "extension_full_speed_m_s": (0.01, 5.0),
}


@dataclass(frozen=True, slots=True)
class JointParameters:
    """Lengths, joint ranges, speeds and valves of a boom; by default a medium forwarder crane.

    Angles are those of `kinematics`: the lift joint is measured from the horizontal upwards; the
    knuckle joint is 0 for a straight arm and negative when folded in. Full speed is the rate of a
    joint when its valve lets full flow through; the slew joint takes full speed and valve from the
    slew axis of the crane.
    """

    lift_cylinder: ValveParameters = field(default_factory=ValveParameters)
    knuckle: ValveParameters = field(default_factory=ValveParameters)
    extension: ValveParameters = field(default_factory=ValveParameters)
    pillar_m: float = 1.7
    pillar_offset_m: float = 0.0
    main_boom_m: float = 3.7
    knuckle_offset_m: float = 0.0
    outer_boom_m: float = 2.3  # telescope in; reach 9 m with it out
    slew_min_deg: float = -190.0  # rack and pinion: about 380 deg in all
    slew_max_deg: float = 190.0
    lift_min_deg: float = -20.0
    lift_max_deg: float = 80.0
    knuckle_min_deg: float = -150.0
    knuckle_max_deg: float = 0.0
    extension_max_m: float = 3.0
    start_extension_m: float = 0.1  # nearly in; lift and knuckle follow from the tip's start
    # Together they give the tip of the default crane its full speeds in most of the work space.
    lift_cylinder_full_speed_rad_s: float = 0.4
    knuckle_full_speed_rad_s: float = 0.7
    extension_full_speed_m_s: float = 1.0

    def __post_init__(self) -> None:
        check_ranges("joints", self, _ALLOWED)
        for name in ("lift", "knuckle"):
            low, high = getattr(self, f"{name}_min_deg"), getattr(self, f"{name}_max_deg")
            if low >= high:
                raise DesignError(f"joints: {name}_max_deg: expected more than {low}, got {high}")
        if self.start_extension_m > self.extension_max_m:
            raise DesignError(
                f"joints: start_extension_m: expected 0.0 .. {self.extension_max_m},"
                f" got {self.start_extension_m}"
            )

    @property
    def boom(self) -> Boom:
        """The lengths of the boom."""
        return Boom(
            self.pillar_m,
            self.pillar_offset_m,
            self.main_boom_m,
            self.knuckle_offset_m,
            self.outer_boom_m,
        )

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Joint -> (lower, upper) end stop, rad or m."""
        return {
            SLEW: (math.radians(self.slew_min_deg), math.radians(self.slew_max_deg)),
            LIFT_CYLINDER: (math.radians(self.lift_min_deg), math.radians(self.lift_max_deg)),
            KNUCKLE: (math.radians(self.knuckle_min_deg), math.radians(self.knuckle_max_deg)),
            EXTENSION: (0.0, self.extension_max_m),
        }


class JointBoom:
    """The four joints in motion, and how they move the tip."""

    __slots__ = ("_boom", "_radius_m", "_radius_rate_m_s", "axes", "height_m", "height_rate_m_s")

    def __init__(
        self,
        parameters: JointParameters,
        slew_valve: ValveParameters,
        slew_full_speed_rad_s: float,
        start: tuple[float, float, float],
        ends: EndParameters | None = None,
    ) -> None:
        """Stand still with the tip at start: theta1 in rad, radius and height in m.

        Raises:
            DesignError: a joint would be outside its range.
            ValueError: the boom is too short or too long for the start.
        """
        p = parameters
        theta1, radius_m, height_m = start
        self._boom = p.boom
        extension = p.start_extension_m
        lift, knuckle = self._boom.angles(radius_m, height_m, extension)
        joints = {SLEW: theta1, LIFT_CYLINDER: lift, KNUCKLE: knuckle, EXTENSION: extension}
        drives = {
            SLEW: (slew_valve, slew_full_speed_rad_s),
            LIFT_CYLINDER: (p.lift_cylinder, p.lift_cylinder_full_speed_rad_s),
            KNUCKLE: (p.knuckle, p.knuckle_full_speed_rad_s),
            EXTENSION: (p.extension, p.extension_full_speed_m_s),
        }
        self.axes: dict[str, Actuator] = {}
        for name, (low, high) in p.ranges.items():
            value = joints[name]
            if not low <= value <= high:
                raise DesignError(
                    f"joints: {name} in the start pose: expected {_readable(name, (low, high))},"
                    f" got {_readable(name, [value])}"
                )
            self.axes[name] = Actuator(*drives[name], value, low, high, ends=ends)
        self._radius_m, self.height_m = self._boom.tip(lift, knuckle, extension)
        self._radius_rate_m_s = self.height_rate_m_s = 0.0

    @property
    def joints(self) -> tuple[float, float, float, float]:
        """Joint positions: slew, lift and knuckle in rad, extension in m."""
        slew, lift, knuckle, extension = self.axes.values()
        return slew.position, lift.position, knuckle.position, extension.position

    @property
    def joint_rates(self) -> tuple[float, float, float, float]:
        """Rates of slew, lift and knuckle in rad/s, of the extension in m/s."""
        slew, lift, knuckle, extension = self.axes.values()
        return slew.speed, lift.speed, knuckle.speed, extension.speed

    @property
    def pose(self) -> tuple[float, float, float, float, float, float]:
        """Slew angle, radius and height of the tip, then their rates; rad, m, per second."""
        slew = self.axes[SLEW]
        return (
            slew.position,
            self._radius_m,
            self.height_m,
            slew.speed,
            self._radius_rate_m_s,
            self.height_rate_m_s,
        )

    def advance(self, step_s: float) -> tuple[TipMotion, TipMotion, TipMotion]:
        """Advance by step_s seconds; return the tip motion at start, middle and end of the step.

        Position and speed of the tip follow from the kinematics of the joints. Its acceleration at
        the end is J q'' + J' q'. The accelerations at start and middle are chosen so that the
        Runge-Kutta step of the grapple sees the true travel and the true change of speed of the
        tip: they are exact for an acceleration that is a parabola over the step, and give the right
        impulse where a joint meets its stop or a spool arrives within the step.
        """
        slew, lift, knuckle, extension = self.axes.values()
        radius, radius_rate = self._radius_m, self._radius_rate_m_s
        height, height_rate = self.height_m, self.height_rate_m_s
        heading, slew_rate = slew.position, slew.speed
        for joint in (slew, lift, knuckle, extension):
            joint.advance(step_s)
        boom = self._boom
        at_middle = self._at_middle()
        end = (lift.position, knuckle.position, extension.position)
        rates = (lift.speed, knuckle.speed, extension.speed)
        accelerations = lift.end_acceleration, knuckle.end_acceleration, extension.end_acceleration
        jacobian = boom.jacobian(*end)
        self._radius_m, self.height_m = boom.tip(*end)
        self._radius_rate_m_s = _dot(jacobian[:3], rates)
        self.height_rate_m_s = _dot(jacobian[3:], rates)
        radius_drift, height_drift = boom.drift(end, rates)
        radius_end = _dot(jacobian[:3], accelerations) + radius_drift
        height_end = _dot(jacobian[3:], accelerations) + height_drift
        radius_start, radius_middle = _stages(
            step_s, self._radius_m - radius, radius_rate, self._radius_rate_m_s, radius_end
        )
        height_start, height_middle = _stages(
            step_s, self.height_m - height, height_rate, self.height_rate_m_s, height_end
        )
        turn = (slew_rate, slew.start_acceleration), (slew.middle_speed, slew.middle_acceleration)
        out = (radius, radius_rate, radius_start), (*at_middle[:2], radius_middle)
        up = (heading, height, height_rate), (slew.middle_position, *at_middle[2:])
        return (
            TipMotion(*out[0], *turn[0], height_start, *up[0]),
            TipMotion(*out[1], *turn[1], height_middle, *up[1]),
            TipMotion(
                self._radius_m,
                self._radius_rate_m_s,
                radius_end,
                slew.speed,
                slew.end_acceleration,
                height_end,
                slew.position,
                self.height_m,
                self.height_rate_m_s,
            ),
        )

    def _at_middle(self) -> tuple[float, float, float, float]:
        """Return radius, its rate, height, its rate in the middle of the last step; m and m/s."""
        _, lift, knuckle, extension = self.axes.values()
        middle = (lift.middle_position, knuckle.middle_position, extension.middle_position)
        rates = (lift.middle_speed, knuckle.middle_speed, extension.middle_speed)
        jacobian = self._boom.jacobian(*middle)
        radius, height = self._boom.tip(*middle)
        return radius, _dot(jacobian[:3], rates), height, _dot(jacobian[3:], rates)


def _dot(row: Iterable[float], column: Iterable[float]) -> float:
    return sum(a * b for a, b in zip(row, column, strict=True))


def _stages(
    step_s: float, way: float, speed: float, end_speed: float, end_acceleration: float
) -> tuple[float, float]:
    """Return start and middle acceleration of a step that covers `way` and ends at `end_speed`."""
    travel = 6.0 * (way / step_s - speed) / step_s
    change = 6.0 * (end_speed - speed) / step_s
    middle = 0.5 * (change - end_acceleration - travel)
    return travel - 2.0 * middle, middle


def _readable(name: str, values: Iterable[float]) -> str:
    if name == EXTENSION:
        return " .. ".join(f"{v:.2f} m" for v in values)
    return " .. ".join(f"{math.degrees(v):.1f} deg" for v in values)
