"""Sway with the tip's speeds as input and without their derivatives: paper Eq. 10, nonlinear.

The accelerations of the tip enter the equations of motion linearly,

    sway'' = f(sway, sway', x, u) + W(sway, x) u'        u = (theta1', x', z')

and W, of Eq. 10 the rows (a5 a6 a7) and (b5 b6 b7), depends on positions only. With
w = sway' - W u as state instead of sway', the derivative u' drops out:

    w' = f(sway, w + W u, x, u) - (dW/dt) u

This is an identity, not an approximation: it holds for any angle and any slew speed. f and W are
derived by CasADi; Appendix B's printed a_i and b_i are not used.
"""

from typing import Any, Final

import casadi as ca

from studies.crane.config import GrappleData
from studies.crane.dynamics import parameter_values, sway_equations
from studies.crane.kinematics import Array, Vector, evaluate

STATES: Final = ("theta5", "w5", "theta6", "w6", "theta1", "x", "z")
INPUTS: Final = ("theta1_rate", "x_rate", "z_rate")
OUTPUTS: Final = ("theta5_rate", "theta6_rate")


class SwayStateSpace:
    """Eq. 10 for one grapple: state (theta5, w5, theta6, w6, theta1, x, z), rad, rad/s, m.

    Input u = (theta1' rad/s, x' m/s, z' m/s), output (theta5', theta6') in rad/s as in Eq. 11.

    Attributes:
        derivative: state, u -> state'.
        output: state, u -> (theta5', theta6').
        state: sway, rate, tip, u -> state.
        input_gain: sway, tip -> W, 2 x 3 (Appendix B, corrected).
    """

    def __init__(self, grapple: GrappleData) -> None:
        self.grapple = grapple
        e = sway_equations()
        acceleration = ca.substitute(e.acceleration, e.parameters, ca.SX(parameter_values(grapple)))
        gain = ca.jacobian(acceleration, e.tip_acceleration)
        rest = ca.substitute(acceleration, e.tip_acceleration, ca.SX.zeros(3))

        w = ca.SX.sym("w", 2)
        u = e.tip_rate
        rate = w + gain @ u
        # u' does not appear in it: W depends on positions only, and their derivatives are rates.
        gain_change = ca.jtimes(gain @ u, e.sway, rate) + ca.jtimes(gain @ u, e.tip, u)
        w_change = ca.substitute(rest, e.rate, rate) - gain_change

        state = ca.vertcat(e.sway[0], w[0], e.sway[1], w[1], e.tip)
        change = ca.vertcat(rate[0], w_change[0], rate[1], w_change[1], u)
        self.derivative = ca.Function("derivative", [state, u], [change])
        self.output = ca.Function("output", [state, u], [rate])
        self.input_gain = ca.Function("input_gain", [e.sway, e.tip], [gain])
        start = e.rate - gain @ u
        self.state = ca.Function(
            "state",
            [e.sway, e.rate, e.tip, u],
            [ca.vertcat(e.sway[0], start[0], e.sway[1], start[1], e.tip)],
        )

    def state_of(self, sway: Vector, rate: Vector, tip: Vector, tip_rate: Vector) -> Array:
        """State for angles (rad), rates (rad/s), tip (theta1, x, z) and its speeds."""
        return evaluate(self.state, sway, rate, tip, tip_rate)

    def derivative_of(self, state: Vector, tip_rate: Vector) -> Array:
        """state' for tip speeds u; a jump of u is allowed."""
        return evaluate(self.derivative, state, tip_rate)

    def rates_of(self, state: Vector, tip_rate: Vector) -> Array:
        """(theta5', theta6') in rad/s."""
        return evaluate(self.output, state, tip_rate)

    def jacobians(self) -> Any:
        """CasADi function: state, u -> A (7 x 7), B (7 x 3), C (2 x 7), D (2 x 3)."""
        state, u = ca.SX.sym("state", 7), ca.SX.sym("u", 3)
        change = self.derivative(state, u)
        output = self.output(state, u)
        return ca.Function(
            "jacobians",
            [state, u],
            [
                ca.jacobian(change, state),
                ca.jacobian(change, u),
                ca.jacobian(output, state),
                ca.jacobian(output, u),
            ],
        )
