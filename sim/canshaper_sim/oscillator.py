"""A damped swing about a place that is constant during a step, solved exactly."""

import math

State = tuple[float, float]
"""Deflection and its rate."""


def swing_over(omega: float, ratio: float, step_s: float) -> tuple[float, float, float, float]:
    """Return the transition matrix of (deflection, rate) over a step, row by row.

    omega is the undamped frequency in rad/s, ratio the damping ratio below 1.
    """
    damped = omega * math.sqrt(1.0 - ratio**2)
    fade = math.exp(-ratio * omega * step_s)
    cosine = fade * math.cos(damped * step_s)
    sine = fade * math.sin(damped * step_s) / damped
    slow = ratio * omega * sine
    return cosine + slow, sine, -omega * omega * sine, cosine - slow


def moved(by: tuple[float, float, float, float], state: State, about: float) -> State:
    """Return the state after a step of `swing_over`, for a swing about the place `about`."""
    off = state[0] - about
    return about + by[0] * off + by[1] * state[1], by[2] * off + by[3] * state[1]
