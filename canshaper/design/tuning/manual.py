"""The paper's manual rule (section 3): two poles from the damping of the sway alone."""

from canshaper.design.tuning.formulation import FASTEST_RAD_S, POLE_DISTANCE, SLOWEST_RAD_S
from canshaper.design.tuning.optimal import Tuning
from canshaper.errors import DesignError
from canshaper.shaping.shapers.gff import denominator_from_poles
from canshaper.shaping.sway import SwayMode

# "Slightly less than two times the first pole."
SECOND_TO_FIRST = 1.9


def manual(mode: SwayMode) -> Tuning:
    """Setting by the rule: first pole at five times the real part of the sway pole.

    Raises:
        DesignError: the sway is damped so little or so much that the poles are outside what a
            deployment may have.
    """
    first = POLE_DISTANCE * mode.pole.real
    poles = first, SECOND_TO_FIRST * first
    if -first < SLOWEST_RAD_S or -poles[1] > FASTEST_RAD_S:
        ratio = SLOWEST_RAD_S / POLE_DISTANCE / mode.omega_rad_s
        raise DesignError(
            f"poles of the manual rule: expected {SLOWEST_RAD_S:g} to {FASTEST_RAD_S:g} rad/s"
            f" (damping ratio {ratio:.3g} or more), got {-first:.3g} and {-poles[1]:.3g} rad/s from"
            f" a damping ratio of {mode.damping_ratio:.3g}; the optimal method needs no damping"
        )
    a1, a2 = denominator_from_poles(poles)
    return Tuning(poles, None, a1, a2, "manual")
