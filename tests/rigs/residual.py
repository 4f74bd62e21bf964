"""Swing that an impulse shaper leaves, by the definition."""

import cmath
from collections.abc import Sequence

from canshaper.shaping.sway import SwayMode


def residual_left(taps: Sequence[float], mode: SwayMode, tick_s: float) -> float:
    """Fraction of the swing that a bare shaper leaves in a mode."""
    step = cmath.exp(-mode.pole * tick_s)
    return abs(sum(tap * step**k for k, tap in enumerate(taps)))
