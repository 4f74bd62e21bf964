"""What is thought of a sway sensor, and what of it reaches the filter."""

import math

import pytest

from canshaper.shaping.sensed import FADE_S
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput, State, Trust
from canshaper.shaping.sway import SwayMode
from tests.shaping.sensed_rig import MODE, SCALE, TICK_S, Rig


def test_without_motion_nothing_is_proved() -> None:
    rig = Rig()
    assert rig.sensed.state is Trust.NO_DATA
    rig.real.angle = 0.2
    rig.run(20.0)
    assert rig.sensed.state is Trust.UNPROVED
    assert not rig.fed_back()


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


def test_silence_is_a_loss_and_the_swing_fades() -> None:
    rig = Rig().trusted()
    rig.real.angle += 0.03
    rig.run(0.3)
    rig.run(0.06, None)
    assert rig.sensed.state is Trust.TRUSTED
    rig.run(0.04, None)
    assert rig.sensed.state is Trust.LOST
    assert rig.fed_back()
    before = rig.sensed.weight
    rig.run(0.1, None)
    assert rig.sensed.weight == pytest.approx(before - 0.1 / FADE_S)
    rig.run(FADE_S, None)
    assert not rig.fed_back()
    rig.run(0.02)
    assert rig.sensed.state is Trust.UNPROVED  # it has to be proved again


def test_a_value_that_stands_still_while_the_grapple_swings_is_stuck() -> None:
    rig = Rig(damps=False).trusted()
    rig.real.rate += 0.2
    rig.run(0.7)
    rig.run(0.3, rig.angle)
    assert rig.sensed.state is Trust.STUCK


def test_a_value_that_stands_still_with_the_grapple_is_none() -> None:
    rig = Rig(offset_rad=0.02).trusted()
    rig.command = 0.0
    rig.run(6.0)
    rig.real.angle = rig.real.rate = 0.0
    rig.model.angle = rig.model.rate = 0.0
    rig.run(5.0)
    assert rig.sensed.state is not Trust.STUCK


def test_a_jump_is_latched_until_rest() -> None:
    rig = Rig().trusted()
    rig.run(0.02, rig.angle + math.radians(4.0))
    assert rig.sensed.state is Trust.JUMP
    rig.run(3.0)
    assert rig.sensed.state is Trust.JUMP
    assert not rig.fed_back()
    rig.command = 0.0
    rig.run(2.0)
    rig.command = -0.8
    rig.run(1.0)
    assert rig.sensed.state is Trust.TRUSTED


def test_a_sign_that_turns_while_all_else_is_right() -> None:
    rig = Rig().trusted()
    rig.command = 0.0
    rig.run(5.0)
    rig.command = -0.8
    for _ in range(60):
        rig.run(TICK_S, -rig.angle)
    assert rig.sensed.state in (Trust.WRONG_SIGN, Trust.CONTACT, Trust.JUMP)
    rig.run(FADE_S, -rig.angle)
    assert not rig.fed_back()


def test_a_grapple_that_is_pushed_all_the_time_is_no_pendulum() -> None:
    rig = Rig().trusted()
    for tick in range(30):
        rig.run(TICK_S, rig.angle + math.radians(tick))
    assert rig.sensed.state is Trust.CONTACT
    rig.run(FADE_S)
    assert not rig.fed_back()


@pytest.mark.parametrize(("offset_deg", "state"), [(2.0, Trust.TRUSTED), (5.0, Trust.OFFSET)])
def test_an_offset_within_its_range_is_found(offset_deg: float, state: Trust) -> None:
    rig = Rig(offset_rad=math.radians(offset_deg))
    rig.run(8.0)
    rig.command = 0.8
    rig.run(1.5)
    assert rig.sensed.state is state


def test_a_command_that_goes_to_and_fro_is_restless() -> None:
    rig = Rig().trusted()
    for tick in range(100):
        rig.sensed.measure(rig.angle, SCALE, commanded=True)
        rig.sensed.step(0.3 * (-1.0) ** tick, 0.8)
    assert rig.sensed.state is Trust.RESTLESS


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
        missing.real.step(missing.axis.sent)
    missing.run(0.02)
    assert missing.sensed.state in (Trust.TRUSTED, Trust.LOST)


def test_no_number_is_a_jump() -> None:
    rig = Rig().trusted()
    rig.run(0.02, math.nan)
    assert rig.sensed.state is Trust.JUMP
    assert math.isfinite(rig.model.free_angle)
