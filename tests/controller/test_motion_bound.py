"""How much of near-far's speed the radial compensation may take."""

import random
from collections import deque
from collections.abc import Callable

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.off import Off
from canshaper.shaping.states import CommandInput
from tests.rigs.forwarder import Rig

MOTION = "motion: {{ crane: {{ slew: slew, near_far: near_far, radius_m: 6.0, max_pct: {} }} }}\n"


@pytest.mark.parametrize("max_pct", [2, 3.5])
def test_it_is_bounded_as_configured(changed_rig: Callable[..., Rig], max_pct: float) -> None:
    rig = changed_rig({"axes:\n": MOTION.format(max_pct) + "axes:\n"})
    rig.run(3)
    sent = []
    for tick in range(300):
        rig.run(1, Slew=1000 if tick < 150 else 0)
        sent.append(rig.controller.axes["near_far"].axis.sent)
    step = 1 / 125 / 0.95  # rounding does not pass the bound
    assert -max_pct / 100.0 <= min(sent) <= -max_pct / 100.0 + step  # inwards
    assert max_pct / 100.0 - step <= max(sent) <= max_pct / 100.0  # and back


@pytest.mark.parametrize("seed", range(40))
def test_the_quantisation_error_adds_one_step_of_the_frame_and_no_more(seed: int) -> None:
    """Joystick and compensation jump about; rates and rounding leave an error behind."""
    chance = random.Random(seed)
    most, steps = chance.choice([0.02, 0.05, 0.25]), 125
    limits = OutputLimits(
        maximum=chance.choice([0.5, 1.0]),
        rise_per_s=chance.choice([1.0, 5.0, 20.0]),
        fall_per_s=chance.choice([1.0, 5.0, 20.0]),
        deadband=chance.choice([0.0, 0.05]),
    )
    axis = ShapedAxis(0.02, limits, sway=None, shaper=Off(), grid_steps=steps)
    axis.allow_added(most, 3600.0)
    axis.tick(CommandInput())
    command = added = 0.0
    recent: deque[float] = deque([0.0], maxlen=round(limits.tail_s / 0.02) + 1)
    for _ in range(200):
        if chance.random() < 0.05:
            command = chance.choice([0.0, 0.0, 0.05, -0.05, 0.3, -0.3, 1.0, -1.0])
        if chance.random() < 0.05:
            added = chance.uniform(-most, most)
        before = axis.sent
        axis.tick(CommandInput(command), added)
        recent.append(command)
        # One step is paid, half of one is rounding; from outside it comes back by the rates.
        room = 1.6 / steps / (1.0 - limits.deadband)
        high, low = max(0.0, *recent) + most + room, min(0.0, *recent) - most - room
        assert axis.sent <= max(high, before)
        assert axis.sent >= min(low, before)
