"""Where the boom is, and how its tip moves when the joints do: paper Eq. 1-3 in CasADi.

Joint vector q = (slew, lift, knuckle, extension) in rad, rad, rad, m. Base frame: origin at the
foot of the pillar, z upwards. The tip is (x cos theta1, x sin theta1, z); (theta1, x, z) are its
cylindrical coordinates, those in which the operator drives.

Eq. 1 is Craig's modified form: a and alpha belong to the link *before* joint i, and books number
them i-1. The paper numbers them i, as Eq. 3 shows, whose a2 is the offset of the main boom's pin
from the pillar. Rows here are the paper's; with the classical form Eq. 3 does not come out.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from studies.crane.config import Joints

JOINTS: Final = ("slew", "lift", "knuckle", "extension")

Array = NDArray[np.float64]
Vector = Sequence[float] | Array

_EXACT: Final = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), -90.0: (0.0, -1.0), 180.0: (-1.0, 0.0)}


def evaluate(function: Any, *arguments: Vector) -> Array:
    """First result of a CasADi function at numbers; columns and single numbers lose their axes."""
    return np.squeeze(np.asarray(function.call(list(arguments))[0].full(), dtype=float))


def link_transform(a: Any, alpha_deg: float, d: Any, theta: Any) -> Any:
    """Pose of frame i in frame i-1, 4 x 4 (Eq. 1, Craig's modified Denavit-Hartenberg form).

    Args:
        a: length a_(i-1) of the link before the joint, m.
        alpha_deg: its twist alpha_(i-1), deg; exact at multiples of 90.
        d: offset d_i of the joint, m.
        theta: angle theta_i of the joint, rad.
    """
    alpha = math.radians(alpha_deg)
    cos_a, sin_a = _EXACT.get(alpha_deg, (math.cos(alpha), math.sin(alpha)))
    c, s = ca.cos(theta), ca.sin(theta)
    return ca.vertcat(
        ca.horzcat(c, -s, 0, a),
        ca.horzcat(s * cos_a, c * cos_a, -sin_a, -sin_a * d),
        ca.horzcat(s * sin_a, c * sin_a, cos_a, cos_a * d),
        ca.horzcat(0, 0, 0, 1),
    )


class Kinematics:
    """Forward and differential kinematics of one crane.

    The CasADi functions are for building larger models, the methods for numbers.

    Attributes:
        frames: q -> poses T_i^0, i = 1 .. 4, of the frames of slew, lift, knuckle and tip (Eq. 2).
        tip: q -> tip (x_tip, y_tip, z_tip), m (Eq. 3).
        tip_jacobian: q -> d tip / d q, 3 x 4.
        tip_velocity: q, q' -> velocity of the tip, m/s.
        cylindrical: q -> (theta1, x, z), rad, m, m.
        cylindrical_jacobian: q -> d (theta1, x, z) / d q, 3 x 4.
        cylindrical_motion: q, q', q'' -> (theta1, x, z), its first and its second derivative.
    """

    def __init__(self, joints: Joints) -> None:
        self.joints = joints
        q, rate, acceleration = (ca.SX.sym(name, 4) for name in ("q", "q_d", "q_dd"))
        frames = []
        pose = ca.SX.eye(4)
        for i, name in enumerate(JOINTS):
            row = getattr(joints, name)
            slides = name == "extension"
            d = row.d_m + q[i] if slides else row.d_m
            theta = math.radians(row.theta_deg) + (0.0 if slides else q[i])
            pose = pose @ link_transform(row.a_m, row.alpha_deg, d, theta)
            frames.append(pose)
        tip = pose[:3, 3]
        # The boom lies in one plane (`Joints` sees to it): seen at theta1 = 0 the tip is (x, 0, z).
        start = math.radians(joints.slew.theta_deg)
        in_plane = ca.substitute(tip, q[0], -start)
        cylindrical = ca.vertcat(start + q[0], in_plane[0], in_plane[2])
        speed = ca.jtimes(cylindrical, q, rate)
        change = ca.jtimes(speed, q, rate) + ca.jtimes(speed, rate, acceleration)

        self.frames = ca.Function("frames", [q], frames)
        self.tip = ca.Function("tip", [q], [tip])
        self.tip_jacobian = ca.Function("tip_jacobian", [q], [ca.jacobian(tip, q)])
        self.tip_velocity = ca.Function("tip_velocity", [q, rate], [ca.jtimes(tip, q, rate)])
        self.cylindrical = ca.Function("cylindrical", [q], [cylindrical])
        self.cylindrical_jacobian = ca.Function(
            "cylindrical_jacobian", [q], [ca.jacobian(cylindrical, q)]
        )
        self.cylindrical_motion = ca.Function(
            "cylindrical_motion", [q, rate, acceleration], [cylindrical, speed, change]
        )

    def tip_m(self, q: Vector) -> Array:
        """Tip (x_tip, y_tip, z_tip) in the base frame, m (Eq. 3)."""
        return evaluate(self.tip, q)

    def tip_velocity_m_s(self, q: Vector, rate: Vector) -> Array:
        """Velocity of the tip in the base frame, m/s; rate is q' in rad/s and m/s."""
        return evaluate(self.tip_velocity, q, rate)

    def jacobian(self, q: Vector) -> Array:
        """d (x_tip, y_tip, z_tip) / d q, 3 x 4, m/rad and m/m."""
        return evaluate(self.tip_jacobian, q)

    def cylindrical_tip(self, q: Vector) -> Array:
        """Tip as (theta1 rad, x m, z m)."""
        return evaluate(self.cylindrical, q)

    def cylindrical_speed(self, q: Vector, rate: Vector) -> Array:
        """Tip speeds (theta1' rad/s, x' m/s, z' m/s), the input of the sway model."""
        speed: Array = evaluate(self.cylindrical_jacobian, q) @ np.asarray(rate, dtype=float)
        return speed

    @property
    def lower_limits(self) -> Array:
        """Lower end stops of q, rad and m."""
        return self._of_joints("min_deg", "min_m")

    @property
    def upper_limits(self) -> Array:
        """Upper end stops of q, rad and m."""
        return self._of_joints("max_deg", "max_m")

    @property
    def full_speeds(self) -> Array:
        """Joint speeds with the valves fully open, rad/s and m/s."""
        return self._of_joints("full_speed_deg_s", "full_speed_m_s")

    def _of_joints(self, rotary: str, sliding: str) -> Array:
        angles = [math.radians(getattr(getattr(self.joints, name), rotary)) for name in JOINTS[:3]]
        return np.array([*angles, getattr(self.joints.extension, sliding)])
