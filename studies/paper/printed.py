"""Numbers that the paper prints, and what it leaves to the reader.

"Optimal sway motion reduction in forestry cranes", Frontiers in Robotics and AI, 2024; sections in
brackets. As printed: a corrigendum exists, which is not taken into account.
"""

import math
from typing import Final

from canshaper.shaping.shapers.gff import poles_from_denominator
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode

# [4.1, 4.2] denominators of the two optimal filters, s and s^2, and their poles, rad/s
DENOMINATORS: Final = {"slew": (0.42, 0.043), "near_far": (0.708, 0.12)}
POLES: Final = {"slew": (-4.1253, -5.6307), "near_far": (-2.3424, -3.5576)}
RADIUS_M: Final = 3.0  # [3] of the linearisation; also where the strokes are driven
# Pole pairs of figures 3 and 4. The text names -3, -3 and "close to" and "far from the imaginary
# axis"; the others stand for these words.
LADDER: Final = ((-2.0, -2.0), (-3.0, -3.0), (-5.0, -5.0), (-10.0, -10.0))
# Pendulum (length in m, damping ratio) for which the printed poles are the optimum of Eq. 14-15
# with Q on the deviation, Ts = 20 ms, N = 50. Fitted to that end: they show that the printed
# numbers are possible, not that they are right.
FITTED: Final = {
    "slew": SwayMode(math.sqrt(GRAVITY_M_S2 / 0.31831), 0.148617),
    "near_far": SwayMode(math.sqrt(GRAVITY_M_S2 / 1.15625), 0.160840),
}


def optimal_poles(axis: str) -> tuple[float, float]:
    """Poles of the printed a1 and a2 of an axis, rad/s; they are what the figures are driven with.

    The printed poles differ from them by up to 0.5 %, because a1 and a2 are rounded.
    """
    return poles_from_denominator(*DENOMINATORS[axis])
