"""Random states and smooth motions, and the CasADi model driven through them."""

from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np
from scipy.interpolate import BPoly

from studies.crane.dynamics import TipMotion
from studies.crane.kinematics import Array, Kinematics

# q, q', q''; of one instant, or one row for every instant.
Motion = tuple[Array, Array, Array]


@dataclass
class SwayStates:
    """Instants of a moving crane: sway, its rate, (theta1, x, z), first and second derivative."""

    rows: list[tuple[Array, Array, TipMotion]]

    @classmethod
    def random(cls, random: np.random.Generator, count: int) -> Self:
        """Angles within 60 deg, tip within the reach and the speeds of a forwarder crane."""
        rows = []
        for _ in range(count):
            tip = TipMotion(
                random.uniform([-np.pi, 2.0, 0.0], [np.pi, 9.0, 6.0]),
                random.uniform(-1.0, 1.0, 3) * [0.8, 1.5, 1.5],
                random.uniform(-1.0, 1.0, 3) * [1.0, 4.0, 4.0],
            )
            rows.append((random.uniform(-1.05, 1.05, 2), random.uniform(-1.5, 1.5, 2), tip))
        return cls(rows)


def random_motion(kinematics: Kinematics, seed: int, times: Array) -> Motion:
    """Each joint moves and pauses on its own, as under four levers.

    A move goes to a random place between the end stops; its speed rises and falls as a quintic's
    does (acceleration without jumps), to at most 0.9 of full speed. Moves begin and end at whole
    hundredths of a second, where jumps of the jerk do no harm to an integrator.
    """
    random = np.random.default_rng(seed)
    low, high, full = kinematics.lower_limits, kinematics.upper_limits, kinematics.full_speeds
    # A crane works in front of its pillar; the boom stays below the vertical and clear of it.
    low[1], high[1] = np.radians(0.0), np.radians(60.0)
    low[2], high[2] = np.radians(-110.0), np.radians(-20.0)
    columns = []
    for joint in range(4):
        breaks, places = [0.0], [random.uniform(low[joint], high[joint])]
        while breaks[-1] < times[-1]:
            breaks.append(round(breaks[-1] + random.uniform(0.05, 1.5), 2))
            places.append(places[-1])
            place = random.uniform(low[joint], high[joint])
            place = np.clip(place, places[-1] - 2.0 * full[joint], places[-1] + 2.0 * full[joint])
            speed = random.uniform(0.4, 0.9) * full[joint]
            move_s = max(1.0, 1.875 * abs(place - places[-1]) / speed)
            breaks.append(round(breaks[-1] + move_s + 0.005, 2))
            places.append(place)
        path = BPoly.from_derivatives(breaks, [[p, 0.0, 0.0] for p in places])
        columns.append([path(times, derivative) for derivative in range(3)])
    q, q_d, q_dd = np.array(columns).transpose(1, 2, 0)
    return q, q_d, q_dd


def integrate(slope: Any, step_s: float, inputs: Array, start: Array) -> Array:
    """States, one row for every full step, by classical Runge-Kutta steps.

    Args:
        slope: CasADi function: state, input -> state'.
        step_s: length of a step.
        inputs: one row for every half step.
        start: first state.
    """
    state = ca.SX.sym("state", len(start))
    first, middle, last = (ca.SX.sym(name, inputs.shape[1]) for name in ("i0", "i1", "i2"))
    k1 = slope(state, first)
    k2 = slope(state + 0.5 * step_s * k1, middle)
    k3 = slope(state + 0.5 * step_s * k2, middle)
    k4 = slope(state + step_s * k3, last)
    following = state + step_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    step = ca.Function("step", [state, first, middle, last], [following])
    run = step.mapaccum((len(inputs) - 1) // 2)
    states = run(start, inputs[0:-1:2].T, inputs[1::2].T, inputs[2::2].T)
    return np.vstack([start, np.asarray(states.full()).T])


def swing(acceleration: Any, step_s: float, motion: tuple[Array, ...], sway: Array) -> Array:
    """(theta5, theta6, theta5', theta6') over a motion, from rest at the angles `sway`.

    Args:
        acceleration: CasADi function: sway, rate, position, velocity, acceleration -> sway'';
            of the tip (`SwayDynamics.acceleration`) or of the joints (`SwayDynamics.driven_by`).
        step_s: length of a step.
        motion: position, velocity, acceleration at every half step.
        sway: angles at the beginning.
    """
    state, width = ca.SX.sym("state", 4), motion[0].shape[1]
    parts = [ca.SX.sym(name, width) for name in ("p", "p_d", "p_dd")]
    change = ca.vertcat(state[2:], acceleration(state[:2], state[2:], *parts))
    slope = ca.Function("slope", [state, ca.vertcat(*parts)], [change])
    return integrate(slope, step_s, np.hstack(motion), np.array([*sway, 0.0, 0.0]))
