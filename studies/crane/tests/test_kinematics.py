"""Eq. 1-3: places and speeds of the tip."""

import math

import numpy as np
import pytest

from studies.crane.config import CraneConfig
from studies.crane.kinematics import Array, Kinematics, evaluate, link_transform


@pytest.fixture(scope="module")
def poses(kinematics: Kinematics) -> Array:
    random = np.random.default_rng(3)
    return random.uniform(kinematics.lower_limits, kinematics.upper_limits, (50, 4))


def equation_3(crane: CraneConfig, q: Array) -> Array:
    """Tip as Eq. 3 prints it."""
    joints = crane.joints
    d1, a2, a3, a4 = joints.slew.d_m, joints.lift.a_m, joints.knuckle.a_m, joints.extension.a_m
    theta1, theta2 = q[0], q[1]
    bend = theta2 + q[2] + math.radians(joints.knuckle.theta_deg)
    d4 = joints.extension.d_m + q[3]
    radius = a2 - d4 * math.sin(bend) + a4 * math.cos(bend) + a3 * math.cos(theta2)
    height = d1 + d4 * math.cos(bend) + a4 * math.sin(bend) + a3 * math.sin(theta2)
    return np.array([math.cos(theta1) * radius, math.sin(theta1) * radius, height])


def test_tip_is_equation_3(crane: CraneConfig, kinematics: Kinematics, poses: Array) -> None:
    for q in poses:
        assert kinematics.tip_m(q) == pytest.approx(equation_3(crane, q), abs=1e-12)


def test_classical_form_of_equation_1_does_not_give_equation_3(crane: CraneConfig) -> None:
    """Rot z, trans z, trans x, rot x: the other Denavit-Hartenberg convention."""
    q = np.array([0.3, 0.5, -0.7, 1.0])
    pose = np.eye(4)
    for i, name in enumerate(("slew", "lift", "knuckle", "extension")):
        row = getattr(crane.joints, name)
        theta = math.radians(row.theta_deg) + (q[i] if i < 3 else 0.0)
        alone = np.array(link_transform(0.0, 0.0, row.d_m + (q[i] if i == 3 else 0.0), theta))
        pose = pose @ alone @ np.array(link_transform(row.a_m, row.alpha_deg, 0.0, 0.0))
    assert np.linalg.norm(pose[:3, 3] - equation_3(crane, q)) > 1.0


def test_frames_are_rigid_and_in_order(kinematics: Kinematics, poses: Array) -> None:
    for q in poses[:5]:
        frames = [np.asarray(f.full()) for f in kinematics.frames.call([q])]
        assert len(frames) == 4
        for frame in frames:
            assert frame[:3, :3] @ frame[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
            assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
        # Pillar top, main boom pin, knuckle, tip.
        assert frames[0][:3, 3] == pytest.approx([0.0, 0.0, kinematics.joints.slew.d_m])
        boom = np.linalg.norm(frames[2][:3, 3] - frames[1][:3, 3])
        assert boom == pytest.approx(kinematics.joints.knuckle.a_m)
        assert frames[3][:3, 3] == pytest.approx(kinematics.tip_m(q))


def test_the_shipped_crane_has_the_reach_it_claims(kinematics: Kinematics) -> None:
    straight = np.array([0.0, 0.0, 0.0, kinematics.upper_limits[3]])
    assert kinematics.cylindrical_tip(straight)[1] == pytest.approx(9.6, abs=0.05)


def test_cylindrical_tip_is_the_tip(kinematics: Kinematics, poses: Array) -> None:
    for q in poses:
        theta1, x, z = kinematics.cylindrical_tip(q)
        tip = [x * math.cos(theta1), x * math.sin(theta1), z]
        assert kinematics.tip_m(q) == pytest.approx(tip, abs=1e-12)


def test_jacobians_against_finite_differences(kinematics: Kinematics, poses: Array) -> None:
    h = 1e-6
    for q in poses[:20]:
        for place, jacobian in (
            (kinematics.tip, kinematics.tip_jacobian),
            (kinematics.cylindrical, kinematics.cylindrical_jacobian),
        ):
            columns = [
                (evaluate(place, q + h * e) - evaluate(place, q - h * e)) / (2.0 * h)
                for e in np.eye(4)
            ]
            assert evaluate(jacobian, q) == pytest.approx(np.array(columns).T, abs=1e-8)


def test_speeds_along_a_motion(kinematics: Kinematics, poses: Array) -> None:
    """First and second derivatives of the tip against differences along q(t)."""
    h = 1e-4
    random = np.random.default_rng(4)
    for q in poses[:20]:
        q_d, q_dd = random.uniform(-0.5, 0.5, 4), random.uniform(-1.0, 1.0, 4)
        before, now, after = (
            kinematics.cylindrical_tip(q + q_d * t + 0.5 * q_dd * t**2) for t in (-h, 0.0, h)
        )
        place, speed, change = (
            np.asarray(v.full()).ravel() for v in kinematics.cylindrical_motion.call([q, q_d, q_dd])
        )
        assert place == pytest.approx(now, abs=1e-12)
        assert speed == pytest.approx((after - before) / (2.0 * h), abs=1e-6)
        assert speed == pytest.approx(kinematics.cylindrical_speed(q, q_d), abs=1e-12)
        assert change == pytest.approx((after - 2.0 * now + before) / h**2, abs=1e-5)
        assert kinematics.tip_velocity_m_s(q, q_d) == pytest.approx(kinematics.jacobian(q) @ q_d)
