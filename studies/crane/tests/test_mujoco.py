"""The judge no one here wrote: the same crane in MuJoCo, joint by joint."""

import mujoco
import numpy as np
import pytest

from studies.crane.config import CraneConfig
from studies.crane.dynamics import SwayDynamics
from studies.crane.kinematics import Kinematics
from studies.crane.tests.motion import random_motion, swing
from studies.crane.tests.mujoco_crane import accelerations, model_of, simulate

STEP_S = 0.005
TIMES = np.arange(0.0, 20.0 + 1e-9, STEP_S / 2.0)


@pytest.fixture(scope="module")
def judge(crane: CraneConfig) -> mujoco.MjModel:
    return model_of(crane)


def test_tip_and_masses_are_in_the_same_places(
    judge: mujoco.MjModel, kinematics: Kinematics, dynamics: SwayDynamics
) -> None:
    """Eq. 1-3 and A1, A2 against a model built from drawings."""
    random = np.random.default_rng(1)
    data = mujoco.MjData(judge)
    for _ in range(50):
        q = random.uniform(kinematics.lower_limits, kinematics.upper_limits)
        sway = random.uniform(-1.2, 1.2, 2)
        data.qpos[:] = [*q, -(q[1] + q[2]), *sway]
        mujoco.mj_forward(judge, data)
        assert data.xpos[5] == pytest.approx(kinematics.tip_m(q), abs=1e-12)
        masses = np.asarray(dynamics.positions(sway, kinematics.cylindrical_tip(q)).full())
        assert data.xipos[-2:] == pytest.approx(masses.T, abs=1e-12)


def test_accelerations_at_random_states(
    judge: mujoco.MjModel, kinematics: Kinematics, dynamics: SwayDynamics
) -> None:
    random = np.random.default_rng(2)
    of_joints = dynamics.driven_by(kinematics)
    for _ in range(200):
        full = kinematics.full_speeds
        q = random.uniform(kinematics.lower_limits, kinematics.upper_limits)
        q_d, q_dd = random.uniform(-1, 1, 4) * full, random.uniform(-4, 4, 4) * full
        sway, rate = random.uniform(-1.0, 1.0, 2), random.uniform(-1.5, 1.5, 2)
        expected = accelerations(judge, (q, q_d, q_dd), sway, rate)
        got = of_joints(sway, rate, q, q_d, q_dd).full().ravel()
        # The rest is the small inertia of MuJoCo's masses, 1e-6 kg m^2 of some 400.
        assert got == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_sway_of_twenty_seconds_of_random_driving(
    judge: mujoco.MjModel, kinematics: Kinematics, dynamics: SwayDynamics, seed: int
) -> None:
    motion = random_motion(kinematics, seed, TIMES)
    start = np.array([0.1, -0.2])
    expected, boom = simulate(judge, STEP_S, motion, start)
    assert boom == pytest.approx(motion[0][::2], abs=1e-6)  # MuJoCo's boom did as commanded
    got = swing(dynamics.driven_by(kinematics), STEP_S, motion, start)[:, :2]
    peak = np.abs(expected).max(axis=0)
    assert (peak > np.radians(10.0)).all()
    # 1 % would do; they agree to 2e-7 rad.
    assert np.abs(got - expected).max() < 1e-6


def test_the_judge_would_see_a_wrong_term(
    judge: mujoco.MjModel, kinematics: Kinematics, crane: CraneConfig
) -> None:
    """One centimetre of l1 is found out by more than the 1 % asked for."""
    motion = random_motion(kinematics, 0, TIMES)
    start = np.array([0.1, -0.2])
    expected, _ = simulate(judge, STEP_S, motion, start)
    wrong = SwayDynamics(crane.grapple.model_copy(update={"l1_m": crane.grapple.l1_m + 0.01}))
    got = swing(wrong.driven_by(kinematics), STEP_S, motion, start)[:, :2]
    assert np.abs(got - expected)[:, 0].max() > 0.01 * np.abs(expected)[:, 0].max()
