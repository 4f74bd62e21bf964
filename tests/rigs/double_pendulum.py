"""A long log in the grapple: two bodies in the plane of the boom, below a tip that accelerates.

The link hangs from the tip, grapple and log from the link. Lagrange's equations of the plane double
pendulum, nonlinear, with modal damping; no code is shared with canshaper or its simulator.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, eigvalsh
from scipy.optimize import least_squares

G_M_S2 = 9.81
LINK_KG, LOG_KG = 60.0, 500.0
DAMPING_RATIO = 0.04
STEPS = 5

Vector = NDArray[np.float64]


def _matrices(link_m: float, below_m: float, gyration_m: float) -> tuple[Vector, Vector]:
    """Mass and stiffness about rest; angles against the vertical."""
    coupling = LOG_KG * link_m * below_m
    mass = [
        [(LINK_KG / 3.0 + LOG_KG) * link_m**2, coupling],
        [coupling, LOG_KG * (below_m**2 + gyration_m**2)],
    ]
    pull = [(0.5 * LINK_KG + LOG_KG) * link_m, LOG_KG * below_m]
    return np.array(mass), G_M_S2 * np.diag(pull)


class DoublePendulum:
    """One with these natural frequencies, at rest.

    Args:
        first, second: rad/s.
    """

    def __init__(self, first: float, second: float) -> None:
        def errors(sizes: Vector) -> list[float]:
            mass, stiffness = _matrices(*sizes)
            slow, quick = np.sqrt(eigvalsh(stiffness, mass))
            return [slow - first, quick - second, 0.3 * (sizes[2] - 0.5)]

        bounds = ((0.15, 0.3, 0.1), (1.2, 1.6, 1.5))
        fit = least_squares(errors, (0.35, 0.7, 0.5), bounds=bounds)
        assert max(abs(one) for one in fit.fun[:2]) < 0.05, "no link and log swing like that"
        self.mass, self.stiffness = _matrices(*fit.x)
        squares, shapes = eigh(self.stiffness, self.mass)
        modal = np.diag(shapes.T @ self.mass @ shapes)
        inverse = np.linalg.inv(shapes)
        damping = np.diag(2.0 * DAMPING_RATIO * np.sqrt(squares) * modal)
        self.damping = inverse.T @ damping @ inverse
        self.state = np.zeros(4)  # angles of link and log, and their rates

    @property
    def angle(self) -> float:
        """Of the log, rad; positive towards the pillar, as the simulator's."""
        return -float(self.state[1])

    @property
    def rate(self) -> float:
        """Of that."""
        return -float(self.state[3])

    def step(self, acceleration: float, step_s: float) -> None:
        """Let the tip accelerate outwards for so long, m/s^2 (Runge-Kutta)."""
        h, state = step_s, self.state
        a = self._slope(state, acceleration)
        b = self._slope(state + 0.5 * h * a, acceleration)
        c = self._slope(state + 0.5 * h * b, acceleration)
        d = self._slope(state + h * c, acceleration)
        self.state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)

    def _slope(self, state: Vector, acceleration: float) -> Vector:
        angles, rates = state[:2], state[2:]
        apart = angles[0] - angles[1]
        coupling = self.mass[0, 1]
        mass = self.mass + (math.cos(apart) - 1.0) * coupling * np.array([[0.0, 1.0], [1.0, 0.0]])
        spun = coupling * math.sin(apart) * np.array([rates[1] ** 2, -(rates[0] ** 2)])
        pulled = np.diag(self.stiffness) * (np.sin(angles) + acceleration / G_M_S2 * np.cos(angles))
        return np.concatenate((rates, np.linalg.solve(mass, -spun - pulled - self.damping @ rates)))
