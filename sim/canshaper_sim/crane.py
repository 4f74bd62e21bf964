"""The simulated crane: valves move the boom tip, the grapple hangs from it and swings.

There are four booms. `TipBoom` moves the tip directly in cylindrical coordinates about the pillar
(slew angle theta1, radius x, height z), one valve a coordinate; `JointBoom` moves the joints, and
the tip by their kinematics; `OverheadBoom` moves a trolley and a rope; `RopedBoom` moves a boom
with a rope at its tip. All booms follow their valves exactly. By default the pump delivers all the
oil that the valves demand and no boom bends, as in the paper.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple, cast

from canshaper_sim.actuator import Actuator, EndParameters
from canshaper_sim.axes import (
    BRIDGE,
    EXTENSION,
    HOIST,
    KNUCKLE,
    LIFT,
    LIFT_CYLINDER,
    NEAR_FAR,
    ON_ROPE,
    OVERHEAD,
    ROTATOR,
    SLEW,
    TROLLEY,
)
from canshaper_sim.axes import TIP_AXES as AXES
from canshaper_sim.bend import Bend, BendParameters
from canshaper_sim.carrier import Carrier, CarrierParameters
from canshaper_sim.contact import ContactParameters
from canshaper_sim.grapple import Grapple, Sway, TipMotion, accelerations, advance, new_tuple
from canshaper_sim.joints import JointBoom, JointParameters
from canshaper_sim.log import LogParameters, SecondSwing
from canshaper_sim.luffing import LuffingParameters
from canshaper_sim.overhead import OverheadBoom, OverheadParameters
from canshaper_sim.pump import Pump, PumpParameters
from canshaper_sim.ranges import check_ranges
from canshaper_sim.rotator import Rotator, RotatorParameters
from canshaper_sim.surroundings import Surroundings
from canshaper_sim.sway_sensor import SwaySensorParameters
from canshaper_sim.tip_boom import CraneBoom, TipBoom
from canshaper_sim.tip_controller import TipControllerParameters
from canshaper_sim.tower import TowerParameters
from canshaper_sim.valve import ValveParameters
from canshaper_sim.wind import Wind, WindParameters

__all__ = [
    "AXES",
    "LIFT",
    "NEAR_FAR",
    "SLEW",
    "Crane",
    "CraneParameters",
    "CraneState",
    "RopeCrane",
    "joint_crane",
]

# Longest internal step. Free of stops, driven runs agree with 0.5 ms steps within 4e-7 rad (1e-8
# without dead time), where a stop is met within 5e-4 rad; 20 ms steps would do 3e-6 and 1e-3 rad.
INTERNAL_STEP_S: Final = 0.010

_HORIZONTAL: Final = math.pi / 2.0

# Names of the full speeds, in the parameters of the crane, of its joints or of its kind.
FULL_SPEEDS: Final = {
    SLEW: "slew_full_speed_rad_s",
    NEAR_FAR: "near_far_full_speed_m_s",
    LIFT: "lift_full_speed_m_s",
    LIFT_CYLINDER: "lift_cylinder_full_speed_rad_s",
    KNUCKLE: "knuckle_full_speed_rad_s",
    EXTENSION: "extension_full_speed_m_s",
    BRIDGE: "bridge_full_speed_m_s",
    TROLLEY: "trolley_full_speed_m_s",
    HOIST: "hoist_full_speed_m_s",
}

# name -> (lowest, highest) value that still describes a forestry or loader crane.
_ALLOWED = {
    "slew_full_speed_rad_s": (0.01, 3.0),
    "near_far_full_speed_m_s": (0.01, 5.0),
    "lift_full_speed_m_s": (0.01, 5.0),
    "radius_min_m": (0.0, 30.0),
    "radius_max_m": (0.0, 30.0),
    "height_min_m": (-20.0, 30.0),
    "height_max_m": (-20.0, 30.0),
    "slew_min_rad": (-math.inf, 1000.0),
    "slew_max_rad": (-1000.0, math.inf),
    "pump_flow": (0.1, math.inf),
}


@dataclass(frozen=True, slots=True)
class CraneParameters:
    """Grapple, valves, full speeds, end stops, start pose and surroundings of one crane.

    Also its sway sensors, its pump, how its boom bends, and which log the grapple grips. Full speed
    is the speed of the tip (slew: the rate of theta1) when the valve lets full flow through.
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
    slew_min_rad: float = -math.inf  # for a tip moved directly; else joints.slew_min_deg
    slew_max_rad: float = math.inf
    start_theta1_rad: float = 0.0
    start_radius_m: float = 3.0
    start_height_m: float = 4.0
    # The boom of a crane driven by its joints, and the controller that drives them by the tip.
    joints: JointParameters = field(default_factory=JointParameters)
    tip_controller: TipControllerParameters = field(default_factory=TipControllerParameters)
    sway_sensor: SwaySensorParameters = field(default_factory=SwaySensorParameters)
    boom: BendParameters = field(default_factory=BendParameters)
    contact: ContactParameters = field(default_factory=ContactParameters)
    log: LogParameters = field(default_factory=LogParameters)
    pump_flow: float = math.inf  # most that the pump delivers, full axis flows
    pump: PumpParameters = field(default_factory=PumpParameters)
    ends: EndParameters = field(default_factory=EndParameters)
    carrier: CarrierParameters = field(default_factory=CarrierParameters)
    wind: WindParameters = field(default_factory=WindParameters)
    rotator: RotatorParameters = field(default_factory=RotatorParameters)
    overhead: OverheadParameters = field(default_factory=OverheadParameters)
    tower: TowerParameters = field(default_factory=TowerParameters)
    luffing: LuffingParameters = field(default_factory=LuffingParameters)

    def __post_init__(self) -> None:
        start = {
            "start_theta1_rad": (max(-1000.0, self.slew_min_rad), min(1000.0, self.slew_max_rad)),
            "start_radius_m": (self.radius_min_m, self.radius_max_m),
            "start_height_m": (self.height_min_m, self.height_max_m),
        }
        check_ranges("crane", self, _ALLOWED | start)

    def full_speeds(self, kind: str) -> dict[str, float]:
        """Return axis -> full speed, rad/s or m/s, for all axes a crane of this kind may have."""
        owners = (getattr(self, kind),) if kind in ON_ROPE else (self, self.joints)
        named = [(axis, name, one) for axis, name in FULL_SPEEDS.items() for one in owners]
        return {axis: getattr(one, name) for axis, name, one in named if hasattr(one, name)}

    def tip_boom(self) -> TipBoom:
        """Return the boom whose tip the valves move directly, in the start pose."""
        reach_m = self.radius_min_m, self.radius_max_m
        height_m = self.height_min_m, self.height_max_m
        slew_rad_s, near_far_m_s = self.slew_full_speed_rad_s, self.near_far_full_speed_m_s
        turn_rad = self.slew_min_rad, self.slew_max_rad
        lift_m_s, ends = self.lift_full_speed_m_s, self.ends
        return TipBoom(
            Actuator(self.slew, slew_rad_s, self.start_theta1_rad, *turn_rad, ends=ends),
            Actuator(self.near_far, near_far_m_s, self.start_radius_m, *reach_m, ends=ends),
            Actuator(self.lift, lift_m_s, self.start_height_m, *height_m, ends=ends),
        )


class CraneState(NamedTuple):
    """Pose, tip speeds and sway at one instant; rad, m, and their rates per second."""

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


class Crane:
    """Crane and grapple in motion: call `step` with the valve frames' values, read `state`."""

    __slots__ = (
        "_accelerations",
        "_axes",
        "_bend",
        "_empty_kg",
        "_pump",
        "_second",
        "_sway",
        "_time_s",
        "_uncompensated",
        "around",
        "boom",
        "parameters",
        "swung_over",
    )

    def __init__(
        self,
        parameters: CraneParameters | None = None,
        sway: Sway | None = None,
        boom: CraneBoom | None = None,
    ) -> None:
        """Stand in the start pose, valves closed.

        Args:
            parameters: the crane (default: the nominal one).
            sway: the initial sway, from where the grapple hangs still (default: none).
            boom: the boom that carries the grapple (default: a `TipBoom` of the parameters).
        """
        p = self.parameters = parameters or CraneParameters()
        self.boom = boom or p.tip_boom()
        self._axes = self.boom.axes
        self._bend = Bend(p.boom) if p.boom.frequency_hz else None
        self._pump = Pump(p.pump_flow, p.pump, self._axes) if p.pump_flow < math.inf else None
        # The flow of these valves depends on the load in the grapple.
        valves = [axis.valve for axis in self._axes.values()]
        self._uncompensated = [v for v in valves if v.parameters.load or v.parameters.load_per_t]
        self._empty_kg = p.grapple.m2_kg
        self.around = Surroundings(
            p.contact if p.contact.ground_m > -math.inf else None,
            None if p.carrier.level else Carrier(p.carrier, p.grapple.g_m_s2),
            Wind(p.wind) if p.wind.speed_m_s or p.wind.gust_m_s else None,
            Rotator(p.rotator, p.log) if p.log.length_m or p.log.off_centre_m else None,
        )
        self._accelerations = accelerations if self.around.none else self.around.accelerations
        self._sway = sway or Sway()
        if not self.around.none:
            theta1, radius_m, height_m, *_ = self.boom.pose
            tip = TipMotion(radius_m, 0.0, 0.0, 0.0, 0.0, 0.0, theta1, height_m)
            self.around.settle(p.grapple, tip)
            theta5, theta6, *rates = self._sway
            rest5, rest6 = self.rest_rad
            self._sway = Sway(theta5 + rest5, theta6 + rest6, *rates)
        self._second: SecondSwing | None = None
        self._time_s = 0.0
        # Set for good once a joint has passed 90 deg: the grapple is above the horizontal, where a
        # real one falls into its rotator and the numbers mean nothing any more.
        self.swung_over = False

    @property
    def state(self) -> CraneState:
        """Present state: the tip of the bent boom; with a long log the sum of both swings."""
        pose = self.boom.pose
        if bend := self._bend:
            ahead, faster = zip(bend.slew, bend.radius, bend.height, strict=True)
            pose = (
                pose[0] + ahead[0],
                pose[1] + ahead[1],
                pose[2] + ahead[2],
                pose[3] + faster[0],
                pose[4] + faster[1],
                pose[5] + faster[2],
            )
        sway = self._second.shown(self._sway) if self._second else self._sway
        return new_tuple(CraneState, (self._time_s, *pose, *sway))

    @property
    def rest_rad(self) -> tuple[float, float]:
        """(theta5, theta6) at which the grapple would hang still in the present pose and wind."""
        if self.around.none:
            return 0.0, 0.0
        return self.around.rest(self.parameters.grapple, *self.boom.pose[:2])

    @property
    def axes_at_stop(self) -> tuple[str, ...]:
        """The axes that an end stop holds at present."""
        return tuple(name for name, axis in self._axes.items() if axis.at_stop)

    @property
    def gripped_kg(self) -> float:
        """Mass in kg of the load that the grapple holds at present."""
        return self.parameters.grapple.m2_kg - self._empty_kg

    def speed(self, axis: str) -> float:
        """Return the speed of an axis of this crane, rad/s or m/s; KeyError for another."""
        return self._axes[axis].speed

    def opening(self, axis: str) -> float:
        """Return the flow through the valve of an axis, fraction of full flow; 0 without a valve.

        It exceeds 1 where a load helps, or a cylinder is faster in the negative direction.
        """
        moved = self._axes.get(axis)
        return moved.valve.speed if moved else 0.0

    def pick_up(self, loaded: Grapple) -> None:
        """Replace the grapple by this one, which includes its load; the sway angles stay."""
        self.parameters = replace(self.parameters, grapple=loaded)

    def step(self, dt_s: float, commands: Mapping[str, float]) -> None:
        """Hold the commands (axis -> value of its valve frame, -1 .. 1) for dt_s seconds.

        An axis not in `commands` keeps its last command, as a valve between two frames does. Any
        crane takes a command of `rotator`; without a long or askew log it moves nothing. Raises
        ValueError for dt_s <= 0, an unknown axis or a command that is not finite.
        """
        if not 0.0 < dt_s < math.inf:
            raise ValueError(f"crane: dt_s: expected a positive value, got {dt_s}")
        for name, command in commands.items():
            if name != ROTATOR:
                self._axis(name).valve.set_command(command)
            elif self.around.rotator:  # the rotator matters only to a log
                self.around.rotator.axis.valve.set_command(command)
        # The smallest number of equal steps; the margin forgives rounding of dt_s.
        count = math.ceil(dt_s / INTERNAL_STEP_S - 1e-9)
        step_s = dt_s / count
        for _ in range(count):
            self._advance(step_s)
        self._time_s += dt_s
        if self.parameters.log.gripped(self._time_s):
            self._grip(self.parameters.log)
        if abs(self._sway.theta5_rad) > _HORIZONTAL or abs(self._sway.theta6_rad) > _HORIZONTAL:
            self.swung_over = True

    def _axis(self, name: str) -> Actuator:
        """Return an axis by name; raise ValueError for an unknown one."""
        if axis := self._axes.get(name):
            return axis
        raise ValueError(f"crane: axis: expected one of {', '.join(self._axes)}, got {name!r}")

    def _advance(self, step_s: float) -> None:
        """Advance the crane by one internal step."""
        grapple = self.parameters.grapple
        for valve in self._uncompensated:
            valve.meet(valve.parameters.against(self.gripped_kg))
        if self._pump:
            self._pump.advance(step_s)
        tips = self.boom.advance(step_s)
        if self._bend:
            tips = self._bend.advance(step_s, tips)
        self.around.advance(step_s, grapple, self._sway, tips[1])
        if self._second:
            push = self.around.pushes(grapple, tips[1].slew_rad, tips[1].radius_m)[1]
            self._second.advance(step_s, tips, push)
        self._sway = advance(grapple, self._sway, step_s, tips, self._accelerations)

    def _grip(self, log: LogParameters) -> None:
        """Grip this log; a crane grips once."""
        grapple = self.parameters.grapple
        if log.second_period_s:
            self._second = SecondSwing(log, grapple.g_m_s2, self._sway)
        self.pick_up(log.loaded(grapple))
        if self.around.rotator:
            self.around.rotator.grip(self.parameters.grapple)
        self.parameters = replace(self.parameters, log=LogParameters())


def joint_crane(parameters: CraneParameters | None = None, sway: Sway | None = None) -> Crane:
    """Return a crane driven joint by joint, its tip at the start pose of the parameters.

    Raises:
        DesignError: a joint would start outside its range.
        ValueError: the joints do not reach the start pose.
    """
    p = parameters or CraneParameters()
    start = (p.start_theta1_rad, p.start_radius_m, p.start_height_m)
    return Crane(p, sway, JointBoom(p.joints, p.slew, p.slew_full_speed_rad_s, start, p.ends))


class RopeCrane(Crane):
    """A crane whose load hangs from a rope; its kind is overhead, tower or luffing.

    It stands level and without wind: only the parameters of its kind, the end stops and the sway
    sensor apply.
    """

    __slots__ = ("_rope",)

    def __init__(
        self,
        parameters: CraneParameters | None = None,
        sway: Sway | None = None,
        kind: str = OVERHEAD,
    ) -> None:
        p = parameters or CraneParameters()
        self._rope: OverheadBoom = getattr(p, kind).boom(p.ends)
        self._rope.swing(sway or Sway())
        own: Any = {kind: getattr(p, kind)}
        known = CraneParameters(ends=p.ends, sway_sensor=p.sway_sensor, **own)
        super().__init__(known, sway, cast("CraneBoom", self._rope))

    def _advance(self, step_s: float) -> None:
        self._rope.advance(step_s)
        self._sway = Sway(*self._rope.angles)
