"""A sensor that is proved while only the other axis of a motion moves, and what it may not show."""

import math

import pytest

from canshaper.shaping.states import Trust
from canshaper.shaping.sway import SwayModel
from tests.shaping.sensed_rig import MODE, SCALE, TICK_S, Rig


def states(
    what: str, *, damps: bool = True, known: bool = True, swing: float = 0.1, turns: float = 1.0
) -> set[Trust]:
    """States of trust in a sensor that shows this, in four seconds in which the other axis moves.

    It ``turns`` this way; ``swing``: of a grapple that swings before, both along and across.
    """
    rig, seen = Rig(), set()
    along, across, lead = (SwayModel(MODE, TICK_S) for _ in range(3))
    along.angle = across.angle = swing
    for tick in range(200):
        velocity = turns * math.sin(math.pi * min(tick / 100, 1.0)) ** 2
        added = 0.3 * math.sin(2.0 * math.pi * min(tick / 100, 1.0))
        lead.angle += TICK_S * added  # of the tip ahead of the grapple
        across.step(velocity)
        along.step(0.0)
        value = {
            "along": SCALE * (along.angle + lead.angle),
            "across": SCALE * across.angle,
            "neither": 0.02 * math.sin(0.9 * tick),
        }[what.strip("-")]
        value = -value if what.startswith("-") else value
        other = SCALE * (across.angle - along.angle) if known else None
        rig.sensed.measure(value, SCALE, commanded=False, damps=damps, other=other)
        rig.sensed.step(0.0, 0.0, added)
        seen.add(rig.sensed.state)
    return seen


BOTH_WAYS = pytest.mark.parametrize(
    ("swing", "turns"), [(-0.1, 1.0), (0.1, 1.0), (0.1, -1.0), (0.0, -1.0)]
)


@BOTH_WAYS
def test_the_swing_that_slewing_makes_proves_it(swing: float, turns: float) -> None:
    assert states("along", swing=swing, turns=turns) == {Trust.UNPROVED, Trust.TRUSTED}


@BOTH_WAYS
@pytest.mark.parametrize("what", ["-along", "across", "-across", "neither"])
def test_swapped_or_reversed_it_is_not_proved(what: str, swing: float, turns: float) -> None:
    assert Trust.TRUSTED not in states(what, swing=swing, turns=turns)


def test_not_without_the_swing_of_the_other_axis_nor_where_none_of_it_is_damped() -> None:
    assert states("along", known=False) == {Trust.UNPROVED}
    assert states("along", damps=False) == {Trust.UNPROVED}
