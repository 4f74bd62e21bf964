"""A machine-side tip controller: tip commands in, joint valve commands out, tick by tick.

This is the block between anti-sway filter and valves in Figure 5 of "Optimal sway motion reduction
in forestry cranes" (2024): the filter shapes the speed of the tip; the tip controller computes the
joint rates that give it. It knows what a machine maker's own controller would know: lengths, joint
positions, full speeds, the deadband of its valves and roughly their delay.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from canshaper_sim.axes import EXTENSION, JOINT_AXES, KNUCKLE, LIFT_CYLINDER, TIP_AXES
from canshaper_sim.joints import JointParameters
from canshaper_sim.ranges import check_ranges
from canshaper_sim.resolved_rates import ZERO, Bounds, ResolvedRates, Vector, less

# A rate below this is none: half a step of a usual valve frame, 1/125 of full command.
_NO_RATE = 0.004

# name -> (lowest, highest) value that makes a controller which works.
_ALLOWED = {
    "period_s": (0.001, 0.1),
    "input_deadband": (0.0, 0.5),
    "output_deadband": (0.0, 0.5),
    "lead_s": (0.0, 0.5),
    "braking_1_s": (0.2, 10.0),
    "angle_margin_deg": (0.0, 20.0),
    "extension_margin_m": (0.0, 1.0),
    "posture": (0.0, 1.0),
    "damping_m_s": (0.0, 2.0),
}


@dataclass(frozen=True, slots=True)
class TipControllerParameters:
    """Cycle, deadbands, lead, braking and posture; rates are fractions of full speed."""

    period_s: float = 0.01  # cycle of a common crane controller
    # Deadband of its command input, that of the valves it stands in for: a deployment made for tip
    # valves, whose shaper jumps over their deadband, drives the same speeds here.
    input_deadband: float = 0.05
    output_deadband: float = 0.05  # of the joint valves, jumped over
    # The pose is taken this far ahead: lag of the valves (0.1 s) and a part of their rate limit.
    lead_s: float = 0.12
    # Near a limit the rate is at most this times the way left; 1/braking_1_s is well above the lag.
    braking_1_s: float = 2.0
    angle_margin_deg: float = 0.5  # the stop is kept away from by this much
    extension_margin_m: float = 0.01
    # Fraction of full speed with which a joint at the end of its range is drawn to the middle of
    # it, while the tip moves at full speed; in proportion between.
    posture: float = 0.3
    damping_m_s: float = 0.2  # largest damping of the least squares, at a singular pose

    def __post_init__(self) -> None:
        check_ranges("tip controller", self, _ALLOWED)


class TipController:
    """Turns tip commands into joint commands: call `tick` every `period_s`."""

    __slots__ = (
        "_boom",
        "_damping_m_s",
        "_full",
        "_middles",
        "_p",
        "_ranges",
        "_rates",
        "_tip_full",
        "period_s",
    )

    def __init__(
        self,
        parameters: TipControllerParameters,
        joints: JointParameters,
        tip_full_speeds: tuple[float, float, float],
    ) -> None:
        """Control this boom; tip_full_speeds are those of slew (rad/s), near_far and lift (m/s)."""
        p = self._p = parameters
        self.period_s = p.period_s
        self._boom = joints.boom
        self._tip_full = tip_full_speeds
        self._full: Vector = (
            joints.lift_cylinder_full_speed_rad_s,
            joints.knuckle_full_speed_rad_s,
            joints.extension_full_speed_m_s,
        )
        angle = math.radians(p.angle_margin_deg)
        margins = {EXTENSION: p.extension_margin_m}
        self._ranges = {
            name: (low + margins.get(name, angle), high - margins.get(name, angle))
            for name, (low, high) in joints.ranges.items()
        }
        self._middles = [
            (0.5 * (low + high), max(0.5 * (high - low), 1e-6))
            for low, high in (self._ranges[name] for name in (LIFT_CYLINDER, KNUCKLE, EXTENSION))
        ]
        self._rates = (0.0, *ZERO)  # of the last tick, fractions of full speed

    def tick(
        self, commands: Mapping[str, float], joints: tuple[float, float, float, float]
    ) -> dict[str, float]:
        """Return the joint commands, axis -> -1 .. 1, for the tip commands of the valve frames.

        Args:
            commands: values of the valve frames of slew, near_far and lift; a missing one is 0.
            joints: measured positions: slew, lift and knuckle in rad, extension in m.
        """
        slew, near_far, lift = (self._input(commands.get(name, 0.0)) for name in TIP_AXES)
        full = (self._tip_full[0], *self._full)
        # Where the joints will be when these commands act.
        lead_s = self._p.lead_s
        ahead = [q + f * u * lead_s for q, f, u in zip(joints, full, self._rates, strict=True)]
        bounds = [
            self._bounds(name, q, f) for name, q, f in zip(JOINT_AXES, ahead, full, strict=True)
        ]
        low, high = bounds[0]
        boom = ZERO
        if near_far or lift:
            limits = Bounds(
                (bounds[1][0], bounds[2][0], bounds[3][0]),
                (bounds[1][1], bounds[2][1], bounds[3][1]),
            )
            boom = self._boom_rates(near_far, lift, (ahead[1], ahead[2], ahead[3]), limits)
        self._rates = (min(max(slew, low), high), *boom)
        return {
            name: self._output(rate) for name, rate in zip(JOINT_AXES, self._rates, strict=True)
        }

    def _boom_rates(self, near_far: float, lift: float, joints: Vector, limits: Bounds) -> Vector:
        """Return the rates of lift, knuckle and extension, fractions of full speed."""
        solver = ResolvedRates(self._boom.jacobian(*joints), self._full, self._p.damping_m_s)
        radius_speed, height_speed = self._tip_full[1] * near_far, self._tip_full[2] * lift
        rates_of_tip = solver.least_squares(radius_speed, height_speed)
        # First what the joints are fast enough for, on a straight way whatever is asked.
        scale, _ = solver.within(rates_of_tip, _FULL_SPEED)
        radius_speed, height_speed = scale * radius_speed, scale * height_speed
        rates_of_tip = (scale * rates_of_tip[0], scale * rates_of_tip[1], scale * rates_of_tip[2])
        preferred = self._posture(joints, solver.free, min(1.0, math.hypot(near_far, lift)))
        scale, rates = solver.within(rates_of_tip, limits, preferred)
        if scale < 1.0 and near_far and lift:
            # A limit stops the straight way: slide along it with each coordinate by itself.
            for part in ((radius_speed, 0.0), (0.0, height_speed)):
                rest = solver.least_squares((1.0 - scale) * part[0], (1.0 - scale) * part[1])
                _, more = solver.within(rest, less(limits, rates))
                rates = (rates[0] + more[0], rates[1] + more[1], rates[2] + more[2])
        return rates

    def _posture(self, joints: Vector, free: Vector, activity: float) -> float:
        """Return the factor of `free` that draws joints to mid-range; activity: command, 0 .. 1."""
        pull = sum(
            n * (middle - q) / half
            for n, q, (middle, half) in zip(free, joints, self._middles, strict=True)
        )
        return self._p.posture * activity * pull

    def _bounds(self, name: str, position: float, full_speed: float) -> tuple[float, float]:
        """Return lowest and highest rate, fractions of full speed, to stop before the margins."""
        low, high = self._ranges[name]
        slope = self._p.braking_1_s / full_speed
        return (
            -min(1.0, max(0.0, (position - low) * slope)),
            min(1.0, max(0.0, (high - position) * slope)),
        )

    def _input(self, command: float) -> float:
        deadband = self._p.input_deadband
        rate = min((abs(command) - deadband) / (1.0 - deadband), 1.0)
        return math.copysign(rate, command) if rate > 0.0 else 0.0

    def _output(self, rate: float) -> float:
        if abs(rate) < _NO_RATE:
            return 0.0
        deadband = self._p.output_deadband
        return math.copysign(deadband + (1.0 - deadband) * abs(rate), rate)


_FULL_SPEED = Bounds((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
