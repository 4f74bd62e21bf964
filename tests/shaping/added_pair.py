"""An axis that may be added to, and one to compare."""

from collections.abc import Callable

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.states import CommandInput
from canshaper.shaping.transfer import Off

TICK_S = 0.05
# So fine that rounding does not hide what is added.
STEPS = 1_000_000
SLACK = 1e-4
LARGEST, TIME_S = 0.25, 1.5


def pair(limits: OutputLimits, shaper: Callable[[], Shaper] = Off) -> tuple[ShapedAxis, ShapedAxis]:
    """An axis that may be added to, and one to which nothing is added."""
    one, plain = (
        ShapedAxis(TICK_S, limits, sway=None, shaper=shaper(), grid_steps=STEPS) for _ in range(2)
    )
    one.allow_added(LARGEST, TIME_S)
    one.tick(CommandInput())
    plain.tick(CommandInput())
    return one, plain


def run(
    axis: ShapedAxis, ticks: int, joystick: float | CommandInput = 0.0, added: float = 0.0
) -> None:
    """So many ticks with one input."""
    for _ in range(ticks):
        axis.tick(CommandInput(joystick) if isinstance(joystick, float) else joystick, added)
