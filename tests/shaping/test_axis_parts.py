"""What an axis tells its parts of small strokes and of a sway sensor: the parts are watched."""

from typing import Any

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput
from canshaper.shaping.sway import SwayMode
from canshaper.shaping.sway_sensor import Measured, SensorLimits, SensorTiming
from tests.shaping.observed import sensed_sway
from tests.shaping.sensed_rig import Rig
from tests.shaping.taps import axis_with, tapped

TIMING = SensorTiming(Measured.ANGLE, 0.02, 0.0, 0.0, lost_s=0.07)
LIMITS = SensorLimits(0.002, 0.05)

OUT, LET_GO = CommandInput(command=0.3, enabled=True), CommandInput(enabled=True)


class Watched:
    """A part that works as before, and what it was called with."""

    def __init__(self, part: Any) -> None:
        self._part = part
        self.calls: list[tuple[str, tuple[Any, ...]]] = []

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._part, name)
        if not callable(value):
            return value

        def called(*arguments: Any, **named: Any) -> Any:
            self.calls.append((name, arguments))
            return value(*arguments, **named)

        return called

    def with_name(self, name: str) -> list[tuple[Any, ...]]:
        return [arguments for called, arguments in self.calls if called == name]


def watched(whole: Any, part: str) -> Watched:
    watch = Watched(getattr(whole, part))
    setattr(whole, part, watch)
    return watch


@pytest.fixture
def moving() -> ShapedAxis:
    axis = axis_with()
    for joystick in [LET_GO] * 3 + [OUT] * 20:
        axis.tick(joystick)
    return axis


def test_a_stop_loses_the_travel_of_small_strokes(moving: ShapedAxis) -> None:
    small = watched(moving._stage, "_small")
    moving.tick(OUT)
    assert not small.with_name("lose")
    moving.tick(CommandInput(enabled=False))
    assert small.with_name("lose")


def test_missed_ticks_count_for_small_strokes(moving: ShapedAxis) -> None:
    small = watched(moving._stage, "_small")
    moving.hold(5)
    ((command, applied, ticks),) = small.with_name("hold")
    assert (command, applied, ticks) == (moving.command, moving.applied, 5)


def test_a_retune_loses_the_travel_of_small_strokes(moving: ShapedAxis) -> None:
    small = watched(moving._stage, "_small")
    moving.retune(SwayMode(2.4, 0.05), lambda sway: Gff(sway, (-5.0, -4.0)))
    assert small.with_name("lose")


def test_the_sensor_gets_every_tick_and_a_retune() -> None:
    rig = Rig().trusted()
    rig.axis.allow_added(0.25, 5.0)
    sensed = watched(rig.axis, "sensed")
    rig.axis.tick(CommandInput(command=0.8, enabled=True), 0.05)
    rig.axis.tick(CommandInput(command=0.8, enabled=True), -0.05)
    applied, command, added = sensed.with_name("step")[-1]
    assert (applied, command) == (rig.axis.applied, rig.axis.command)
    assert added == pytest.approx(rig.axis.sent - rig.axis.applied) != 0.0
    rig.axis.retune(SwayMode(2.4, 0.05), lambda sway: Gff(sway, (-5.0, -4.0)))
    assert sensed.with_name("retune") == [(rig.axis.sway,)]


def test_small_strokes_are_left_alone_only_while_swing_is_damped() -> None:
    plain = tapped(axis_with(), 0.1, 0.1)
    sent = {}
    for weight in (0.0, 0.5):
        axis = axis_with()
        sway = axis.sway
        assert sway is not None
        axis.sensed = sensed_sway(sway, TIMING, LIMITS, damps=True)
        sent[weight] = []
        for tick in range(len(plain)):
            axis.sensed.weight = weight
            axis.tick(CommandInput(0.1 if tick < 5 else 0.0))
            sent[weight].append(axis.sent)
    assert sent[0.0] == plain
    assert sent[0.5] != plain
