"""An axis, and short pushes of its joystick."""

import math

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.states import CommandInput, State
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off

TICK_S = 0.02
MODE = SwayMode.from_period(2.356, 0.038)
LIMITS = OutputLimits(deadband=0.05, tail_s=2.2, reversal_s=5.0)
# Three heaps and a floor between them, as ``canshaper robust`` makes them: 1.8 s.
TAPS = [0.1, 0.1, 0.1, *[0.0044] * 40, 0.1, 0.1, 0.048, *[0.0044] * 40, 0.1]


class Ruleless:
    """A shaper of which an axis does not know that it spreads."""

    def __init__(self, shaper: Shaper) -> None:
        self.step = shaper.step


def axis_with(
    limits: OutputLimits = LIMITS, steps: int = 125, shaper: str = "robust", **changes: float
) -> ShapedAxis:
    """An axis in READY."""
    sway = SwayModel(MODE, TICK_S)
    total = math.fsum(TAPS)
    fir = Fir([tap / total for tap in TAPS])
    robust = LimitAware(sway, fir, 5.0)
    shapers: dict[str, Shaper] = {
        "robust": robust,
        "ruleless": Ruleless(robust),
        "gff": Gff(sway, (-5.655, -4.112)),
        "off": Off(),
    }
    axis = ShapedAxis(
        TICK_S, limits, sway=sway, shaper=shapers[shaper], grid_steps=steps, **changes
    )
    axis.tick(CommandInput())
    axis.tick(CommandInput())
    assert axis.state is State.READY
    return axis


def tapped(axis: ShapedAxis, level: float, duration_s: float, rest_s: float = 3.5) -> list[float]:
    """Setpoints at a tap."""
    held = round(duration_s / TICK_S)
    sent = []
    for tick in range(held + round(rest_s / TICK_S)):
        axis.tick(CommandInput(level if tick < held else 0.0))
        sent.append(axis.output.setpoint)
    return sent
