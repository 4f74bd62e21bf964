"""An axis that has followed a rope sends what the axis of that length sends."""

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import KINDS, build_shaper
from canshaper.shaping.shapers.limit_aware import TABLE_STEPS
from canshaper.shaping.states import CommandInput
from canshaper.shaping.sway import SwayMode, SwayModel
from tests.shaping.test_rope import RATIO, TICK_S, parameters

LIMITS = OutputLimits(rise_per_s=2.0, fall_per_s=2.0)


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if kind.follows])
def test_an_axis_that_has_followed_is_the_one_of_that_length(kind: str) -> None:
    factor = 0.5 + 32 * 1.5 / TABLE_STEPS  # a row of the table of taps
    first, then = SwayMode.from_length(4.0, RATIO), SwayMode.from_length(4.0 * factor**2, RATIO)
    own, follows = parameters(kind, first), KINDS[kind].follows
    assert follows is not None

    def axis(mode: SwayMode, **given: object) -> ShapedAxis:
        sway = SwayModel(mode, TICK_S)
        shaper = build_shaper(kind, TICK_S, sway, valve_rate_per_s=2.0, **given)
        return ShapedAxis(TICK_S, LIMITS, sway=sway, shaper=shaper)

    one, other = axis(first, **own), axis(then, **follows(own, factor))
    one.prepare(0.5, 2.0)
    one.follow(then, factor)
    for tick in range(400):
        for each in (one, other):
            each.tick(CommandInput(0.8 if 1 <= tick < 150 else 0.0))
        assert one.output.setpoint == pytest.approx(other.output.setpoint, abs=1e-6)
    assert one.neutral
