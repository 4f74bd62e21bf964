"""Left is as right: whatever is done to an axis, the mirror image of it gives the mirror image."""

import random

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput, Reason, State
from canshaper.shaping.sway import SwayMode, SwayModel

TICK_S = 0.02
MODE = SwayMode(2.86, 0.05)
LIMITS = [
    OutputLimits(tail_s=1.0),
    OutputLimits(tail_s=1.0, allow_reverse=True, rise_per_s=3.0, fall_per_s=6.0),
    OutputLimits(tail_s=0.5, allow_faster=True, minimum=0.1, deadband=0.05, maximum=0.8),
]


def axis_with(limits: OutputLimits) -> ShapedAxis:
    model = SwayModel(MODE, TICK_S)
    return ShapedAxis(TICK_S, limits, sway=model, shaper=Gff(model, (-5.655, -4.112)))


def busy(seed: int) -> list[tuple[CommandInput, float]]:
    """Strokes, rests, bypass and lost frames, with velocities asked by another axis."""
    source = random.Random(seed)
    inputs: list[tuple[CommandInput, float]] = [(CommandInput(), 0.0)] * 2
    while len(inputs) < 1500:
        joystick = CommandInput(
            source.choice([0.0, 0.0, 1.0, 0.02, source.uniform(-1.0, 1.0)]),
            fault=Reason.JOYSTICK_TIMEOUT if source.random() < 0.05 else None,
            bypass=source.random() < 0.1,
        )
        added = source.choice([0.0, 0.0, source.uniform(-0.3, 0.3)])
        inputs += [(joystick, added)] * source.randint(1, 60)
    return inputs


@pytest.mark.parametrize("limits", LIMITS, ids=["default", "reverse", "faster"])
@pytest.mark.parametrize("seed", range(3))
def test_the_mirror_image_of_a_drive(limits: OutputLimits, seed: int) -> None:
    one, other = axis_with(limits), axis_with(limits)
    moved = set()
    for joystick, added in busy(seed):
        changed = one.tick(joystick, added)
        assert other.tick(joystick._replace(command=-joystick.command), -added) == changed
        assert (other.output.steps, other.output.setpoint, other.output.applied) == (
            -one.output.steps,
            -one.output.setpoint,
            -one.output.applied,
        )
        assert (other.output.commanded, other.neutral) == (one.output.commanded, one.neutral)
        moved.add(one.output.steps > 0)
    assert moved == {True, False}


class Pausing:
    """Gives the command, nothing for a while after it, and a last push: as a swing may ask it."""

    def __init__(self, sign: float) -> None:
        self._push = 0.4 * sign
        self._released = 0

    def step(self, command: float) -> float:
        self._released = 0 if command else self._released + 1
        return self._push if self._released > 30 else command


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_axis_at_rest_in_the_middle_of_its_run_on_is_not_done(sign: float) -> None:
    """The filter rests, but may ask for more: the tail decides, not the moment."""
    axis = ShapedAxis(TICK_S, OutputLimits(tail_s=1.0), sway=None, shaper=Pausing(sign))
    for joystick in [CommandInput(), *[CommandInput(sign)] * 20]:
        axis.tick(joystick)
    sent = []
    for _ in range(50):
        axis.tick(CommandInput())
        assert (axis.state, axis.output.commanded, axis.neutral) == (State.ACTIVE, True, False)
        sent.append(axis.output.setpoint)
    assert sent[25] == 0.0
    assert sent[-1] == pytest.approx(0.4 * sign, abs=0.01)
    for _ in range(20):
        axis.tick(CommandInput())
    assert (axis.state, axis.reason, axis.output.commanded) == (State.READY, Reason.AT_REST, False)
    assert axis.neutral


def test_a_stopping_axis_is_not_neutral_and_a_tripped_one_is() -> None:
    axis = axis_with(LIMITS[0])
    for joystick in [
        CommandInput(),
        *[CommandInput(1.0)] * 20,
        CommandInput(fault=Reason.JOYSTICK_TIMEOUT),
    ]:
        axis.tick(joystick)
    assert (axis.state, axis.neutral) == (State.STOPPING, False)
    axis.tick(CommandInput(trip=Reason.SEND_FAILED))
    assert (axis.state, axis.neutral) == (State.TRIPPED, True)
