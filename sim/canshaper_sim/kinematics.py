"""Kinematics of a boom with lift, knuckle and extension in its plane, as in the paper's Eq. 1-3.

The angles are those of the modified (Craig's) Denavit-Hartenberg convention of Eq. 1, so that tip
radius and height are Eq. 3 of "Optimal sway motion reduction in forestry cranes" (2024):

    r = a2 + a3 cos(theta2) + a4 cos(theta2 + theta3) - d4 sin(theta2 + theta3)
    z = d1 + a3 sin(theta2) + a4 sin(theta2 + theta3) + d4 cos(theta2 + theta3)

theta2 is the lift angle, from the horizontal up to the main boom. theta3 is the knuckle angle less
90 deg: at knuckle angle 0 the arm is straight, at negative angles it is folded in. So the outer
boom points lift + knuckle above the horizontal, written `outer` below.
"""

import math
from typing import NamedTuple


class Jacobian(NamedTuple):
    """Derivatives of tip radius and height by lift and knuckle (m/rad) and by extension (m/m)."""

    r_lift: float
    r_knuckle: float
    r_extension: float
    z_lift: float
    z_knuckle: float
    z_extension: float


class Boom(NamedTuple):
    """Lengths of the boom in metres.

    Attributes:
        pillar_m: ground to the lift joint, d1 of Eq. 3.
        pillar_offset_m: slew axis to the lift joint, outwards, a2.
        main_boom_m: lift joint to the knuckle joint, a3.
        knuckle_offset_m: knuckle joint to the axis of the telescope, a4.
        outer_boom_m: along the telescope to the tip, telescope in: d4 less the extension.
    """

    pillar_m: float
    pillar_offset_m: float
    main_boom_m: float
    knuckle_offset_m: float
    outer_boom_m: float

    def tip(self, lift_rad: float, knuckle_rad: float, extension_m: float) -> tuple[float, float]:
        """Return (radius, height) of the tip in m (Eq. 3)."""
        outer = lift_rad + knuckle_rad
        s, c = math.sin(outer), math.cos(outer)
        d4 = self.outer_boom_m + extension_m
        a3, a4 = self.main_boom_m, self.knuckle_offset_m
        return (
            self.pillar_offset_m + a3 * math.cos(lift_rad) + a4 * s + d4 * c,
            self.pillar_m + a3 * math.sin(lift_rad) - a4 * c + d4 * s,
        )

    def jacobian(self, lift_rad: float, knuckle_rad: float, extension_m: float) -> Jacobian:
        """Return the derivatives of the tip's radius and height by lift, knuckle and extension."""
        outer = lift_rad + knuckle_rad
        s, c = math.sin(outer), math.cos(outer)
        d4 = self.outer_boom_m + extension_m
        outer_r = self.knuckle_offset_m * s + d4 * c
        outer_z = d4 * s - self.knuckle_offset_m * c
        return Jacobian(
            -self.main_boom_m * math.sin(lift_rad) - outer_z,
            -outer_z,
            c,
            self.main_boom_m * math.cos(lift_rad) + outer_r,
            outer_r,
            s,
        )

    def drift(
        self,
        joints: tuple[float, float, float],
        rates: tuple[float, float, float],
    ) -> tuple[float, float]:
        """Return the tip acceleration (radius, height), m/s^2, at constant joint rates: J' q'.

        Args:
            joints: positions of lift (rad), knuckle (rad), extension (m).
            rates: rates of lift (rad/s), knuckle (rad/s), extension (m/s).
        """
        lift, knuckle, extension = joints
        lift_rate, knuckle_rate, extension_rate = rates
        outer = lift + knuckle
        s, c = math.sin(outer), math.cos(outer)
        d4 = self.outer_boom_m + extension
        turn = lift_rate + knuckle_rate
        turn2 = turn * turn
        lift2 = self.main_boom_m * lift_rate * lift_rate
        coriolis = 2.0 * turn * extension_rate
        return (
            -lift2 * math.cos(lift) - turn2 * (self.knuckle_offset_m * s + d4 * c) - coriolis * s,
            -lift2 * math.sin(lift) - turn2 * (d4 * s - self.knuckle_offset_m * c) + coriolis * c,
        )

    def angles(self, radius_m: float, height_m: float, extension_m: float) -> tuple[float, float]:
        """Return (lift, knuckle) in rad that put the tip there; of two ways the one bent upwards.

        Raises:
            ValueError: the tip cannot reach this place.
        """
        d4 = self.outer_boom_m + extension_m
        out, up = radius_m - self.pillar_offset_m, height_m - self.pillar_m
        outer = math.hypot(self.knuckle_offset_m, d4)
        main = self.main_boom_m
        cos_fold = (out * out + up * up - main * main - outer * outer) / (2.0 * main * outer)
        if not -1.0 <= cos_fold <= 1.0:
            raise ValueError(
                f"boom: radius {radius_m} m, height {height_m} m with extension {extension_m} m"
                " is out of reach"
            )
        fold = math.acos(cos_fold)
        lift = math.atan2(up, out) + math.atan2(
            outer * math.sin(fold), main + outer * math.cos(fold)
        )
        return lift, math.atan2(self.knuckle_offset_m, d4) - fold
