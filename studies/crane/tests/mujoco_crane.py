"""The crane of a CraneConfig as a MuJoCo model, driven through prescribed joint motions.

The model is built from drawings, not from the DH table: boxes hinged to boxes, the hinges about z
and y. MuJoCo does all mechanics, the joints of the boom included.

How the boom follows its motion exactly: each driven joint carries a rotor of 1e14 kg m^2 (MuJoCo's
"armature": inertia about that joint alone) and is pushed by 1e14 times the commanded acceleration.
Weight of the boom and pull of the grapple, some 1e5 N m, change its acceleration by 1e-9, and in
20 s its angle by 2e-7; the test looks at what is left. The push is set in MuJoCo's control
callback, which its Runge-Kutta integrator calls at every stage, so the whole is of fourth order.
A servo of finite stiffness would lag, and writing positions into the state would not tell the
grapple of the acceleration.

The joint "level" between telescope and grapple takes out the boom's inclination: in the paper the
axis of theta5 is horizontal in every pose.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

from studies.crane.config import CraneConfig
from studies.crane.kinematics import Array
from studies.crane.tests.motion import Motion

ROTOR = 1e14
DRIVEN = 5  # slew, lift, knuckle, extension, level


def model_of(crane: CraneConfig) -> mujoco.MjModel:
    """Pillar, main boom, outer boom, telescope, levelled tip, link, grapple."""
    joints, grapple = crane.joints, crane.grapple
    pillar, lift, knuckle, telescope = joints.slew, joints.lift, joints.knuckle, joints.extension
    assert knuckle.theta_deg == -90.0  # so that 0 is in line with the main boom
    # Masses of the boom are those of a real one; with the rotors they do not matter.
    xml = f"""
    <mujoco>
      <compiler angle="radian" balanceinertia="false"/>
      <option gravity="0 0 -9.81" integrator="RK4"><flag contact="disable"/></option>
      <default><default class="driven"><joint armature="{ROTOR}"/></default></default>
      <worldbody><body pos="0 0 {pillar.d_m}">
        <inertial pos="0 0 -0.5" mass="500" diaginertia="40 40 40"/>
        <joint class="driven" axis="0 0 1"/>
        <body pos="{lift.a_m} 0 0">
          <inertial pos="1.8 0 0" mass="450" diaginertia="10 500 500"/>
          <joint class="driven" axis="0 -1 0"/>
          <body pos="{knuckle.a_m} 0 0">
            <inertial pos="1.0 0 0" mass="250" diaginertia="5 150 150"/>
            <joint class="driven" axis="0 -1 0"/>
            <body pos="{telescope.d_m} 0 {-telescope.a_m}">
              <inertial pos="-1.0 0 0" mass="150" diaginertia="3 80 80"/>
              <joint class="driven" type="slide" axis="1 0 0"/>
              <body>
                <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
                <joint class="driven" axis="0 -1 0"/>
                <body>
                  <inertial pos="0 0 {-grapple.l1_m}" mass="{grapple.m1_kg}"
                            diaginertia="1e-6 1e-6 1e-6"/>
                  <joint axis="1 0 0" damping="{grapple.c5_n_m_s_rad}"/>
                  <body pos="0 0 {-grapple.l1_m}">
                    <inertial pos="0 0 {-grapple.l2_m}" mass="{grapple.m2_kg}"
                              diaginertia="1e-6 1e-6 1e-6"/>
                    <joint axis="0 1 0" damping="{grapple.c6_n_m_s_rad}"/>
                  </body>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body></worldbody>
    </mujoco>"""
    return mujoco.MjModel.from_xml_string(xml)


def with_level(q: Array) -> Array:
    """Joint vector (or its derivative, last axis 4) with the joint "level" behind it."""
    return np.concatenate([q, -(q[..., 1:2] + q[..., 2:3])], axis=-1)


@contextmanager
def pushed(acceleration: Array, half_step_s: float) -> Iterator[None]:
    """MuJoCo's driven joints get these accelerations, one row for every half step."""

    def push(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        row = acceleration[round(data.time / half_step_s)]
        data.qfrc_applied[:DRIVEN] = ROTOR * row

    mujoco.set_mjcb_control(push)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(None)


def accelerations(model: mujoco.MjModel, motion: Motion, sway: Array, rate: Array) -> Array:
    """(theta5'', theta6'') that MuJoCo finds in one state."""
    q, q_d, q_dd = motion
    data = mujoco.MjData(model)
    data.qpos[:] = [*with_level(q), *sway]
    data.qvel[:] = [*with_level(q_d), *rate]
    data.qfrc_applied[:DRIVEN] = ROTOR * with_level(q_dd)
    mujoco.mj_forward(model, data)
    return np.array(data.qacc[DRIVEN:])


def simulate(
    model: mujoco.MjModel, step_s: float, motion: Motion, sway: Array
) -> tuple[Array, Array]:
    """Sway over a motion that is given at every half step, from rest at the angles `sway`.

    Returns:
        sway angles and boom joints of MuJoCo, one row for every full step.
    """
    q, q_d, q_dd = motion
    model.opt.timestep = step_s
    data = mujoco.MjData(model)
    data.qpos[:] = [*with_level(q[0]), *sway]
    data.qvel[:DRIVEN] = with_level(q_d[0])
    swings, boom = [np.array(data.qpos[DRIVEN:])], [np.array(data.qpos[:4])]
    with pushed(with_level(q_dd), step_s / 2.0):
        for _ in range((len(q) - 1) // 2):
            mujoco.mj_step(model, data)
            swings.append(np.array(data.qpos[DRIVEN:]))
            boom.append(np.array(data.qpos[:4]))
    assert math.isclose(data.time, step_s * (len(q) - 1) / 2.0, rel_tol=1e-9)
    return np.array(swings), np.array(boom)
