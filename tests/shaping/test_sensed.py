"""Trust in a sway sensor, and its effect on the filter."""

import math
from unittest.mock import Mock

import pytest

from canshaper.shaping.sensed import FADE_S
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput, State, Trust
from canshaper.shaping.sway import SwayMode
from tests.shaping.sensed_rig import MODE, SCALE, Rig


def test_motion_proves_it_and_its_weight_comes_in() -> None:
    rig = Rig().run(1.0)
    rig.real.angle += 0.03
    rig.command = 0.8
    rig.run(0.6)
    assert rig.sensed.state is Trust.TRUSTED
    assert 0.0 < rig.sensed.weight < 1.0
    assert rig.fed_back()
    rig.run(FADE_S)
    assert rig.sensed.weight == 1.0


def test_watched_only_nothing_is_fed_back() -> None:
    rig = Rig(damps=False)
    rig.real.angle = 0.05
    rig.trusted()
    assert not rig.fed_back()


def test_after_an_invalid_output_nothing_is_fed_back() -> None:
    rig = Rig().trusted()
    rig.real.angle += 0.03
    rig.run(0.3)
    assert rig.fed_back()
    rig.axis.tick(CommandInput(command=math.nan, enabled=True))
    assert rig.axis.state is State.TRIPPED
    assert not rig.fed_back()
    assert rig.sensed.state is Trust.UNPROVED


def test_a_retune_takes_the_free_swing_over() -> None:
    rig = Rig().trusted()
    rig.real.angle += 0.03
    rig.run(0.3)
    before = rig.model.free_angle * MODE.angle_per_speed_rad
    other = SwayMode(2.4, 0.05)
    rig.axis.retune(other, lambda sway: Gff(sway, (-5.0, -4.0)))
    sway = rig.axis.sway
    assert sway is not None
    assert sway.free_angle * other.angle_per_speed_rad == pytest.approx(before)
    rig.sensed.measure(None, SCALE, commanded=True)
    assert sway.free_angle != 0.0


def test_missed_ticks_pass_for_the_observer_too() -> None:
    rig, missing = Rig().trusted(), Rig().trusted()
    rig.run(0.2)
    missing.axis.hold(10)
    for _ in range(10):
        missing.real.step(missing.axis.output.setpoint)
    missing.run(0.02)
    assert missing.sensed.state in (Trust.TRUSTED, Trust.LOST)


def test_it_gets_what_is_added_and_a_retune() -> None:
    rig = Rig().trusted()
    rig.axis.allow_added(0.25, 5.0)
    rig.axis.sensed = sensed = Mock(wraps=rig.sensed, weight=1.0)
    for added in (0.05, -0.05):
        rig.axis.tick(CommandInput(command=0.8, enabled=True), added)
    applied, command, path = sensed.step.call_args.args
    assert (applied, command) == (rig.axis.output.applied, rig.axis.demand)
    assert path == pytest.approx(rig.axis.output.setpoint - rig.axis.output.applied) != 0.0
    rig.axis.retune(SwayMode(2.4, 0.05), lambda sway: Gff(sway, (-5.0, -4.0)))
    sensed.retune.assert_called_once_with(rig.axis.sway)
