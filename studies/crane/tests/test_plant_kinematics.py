"""The plant's plain kinematics are those of the CasADi model."""

import numpy as np
import pytest

from canshaper_sim.kinematics import Boom
from studies.crane.config import CraneConfig
from studies.crane.kinematics import Kinematics


def test_tip_and_jacobian_agree(crane: CraneConfig, kinematics: Kinematics) -> None:
    joints = crane.joints
    boom = Boom(
        pillar_m=joints.slew.d_m,
        pillar_offset_m=joints.lift.a_m,
        main_boom_m=joints.knuckle.a_m,
        knuckle_offset_m=joints.extension.a_m,
        outer_boom_m=joints.extension.d_m,
    )
    source = np.random.default_rng(7)
    for _ in range(100):
        q = source.uniform(kinematics.lower_limits, kinematics.upper_limits)
        _, lift, knuckle, extension = q
        _, radius, height = kinematics.cylindrical_tip(q)
        r, z = boom.tip(lift, knuckle, extension)
        if radius < 0.3:  # behind the pillar the cylindrical angle turns round
            continue
        assert (r, z) == pytest.approx((radius, height), abs=1e-12)
        mine = boom.jacobian(lift, knuckle, extension)
        for i, (by_r, by_z) in enumerate(
            (
                (mine.r_lift, mine.z_lift),
                (mine.r_knuckle, mine.z_knuckle),
                (mine.r_extension, mine.z_extension),
            )
        ):
            rate = np.eye(4)[i + 1]
            _, radius_rate, height_rate = kinematics.cylindrical_speed(q, rate)
            assert (by_r, by_z) == pytest.approx((radius_rate, height_rate), abs=1e-12)
