"""A boom that luffs: what it adds to its own commands, and when it adds nothing."""

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.moving_axis import MovingAxis
from canshaper.shaping.output import OutputStage
from canshaper.shaping.states import CommandInput, Reason
from canshaper.shaping.sway import SwayModel
from canshaper.shaping.transfer import Off
from canshaper.shaping.two_axis_motion import TwoAxisMotion
from tests.shaping.two_axes import NEAR_FAR, TICK_S, slewing

RAD_S, HEIGHT_M = 0.2, 2.0


def luffing(*, commanded: bool = True) -> tuple[TwoAxisMotion, MovingAxis, MovingAxis, MovingAxis]:
    """Slew and luffing commanded, the boom in a swing of a third of a second."""
    motion, slew, near_far = slewing()
    sway = SwayModel(NEAR_FAR, TICK_S)
    boom = MovingAxis(RAD_S, TICK_S, sway, applied=1.0, commanded=commanded, able=True)
    for _ in range(16):
        sway.step(1.0)
    motion.luffing, motion.height_m = boom, HEIGHT_M
    return motion, slew, near_far, boom


def test_the_boom_adds_what_its_arc_needs() -> None:
    motion, _, near_far, boom = luffing()
    for _ in range(200):  # of one moment, until all of it is added
        motion.step(TICK_S, 4.0)
    lead, _, speed, _ = boom.path(TICK_S)
    arc = 4.0 / HEIGHT_M * (speed**2 / boom.stiffness - 0.5 * lead**2)
    assert boom.reached == pytest.approx(arc, rel=1e-3)

    near_far.sway, near_far.applied, near_far.commanded = boom.sway, 1.0, True
    for _ in range(200):
        motion.step(TICK_S, 4.0)
    out, _, out_rate, _ = near_far.path(TICK_S)
    arc += (2.0 * speed * out_rate / boom.stiffness - lead * out) / 4.0
    assert boom.reached == pytest.approx(arc, rel=1e-3)


def test_the_boom_turns_slew_by_its_acceleration_of_coriolis() -> None:
    motion, slew, _, boom = luffing()
    still, alone, _ = slewing()
    boom.sway.angle, boom.sway.rate, boom.applied = 0.0, -0.5, 0.5  # in steady motion
    for one, axis in ((motion, slew), (still, alone)):
        axis.sway.rate, axis.applied = -0.5, 0.5
        for _ in range(200):
            one.step(TICK_S, None, 4.0)
    speed = boom.path(TICK_S)[2]
    turn = slew.path(TICK_S)[2]
    angle = 2.0 * -HEIGHT_M * speed * turn / (4.0 * slew.stiffness)
    assert slew.reached - alone.reached == pytest.approx(angle, rel=0.1)


def test_it_adds_nothing_where_it_is_not_commanded_or_no_radius_was_known() -> None:
    motion, _, _, boom = luffing(commanded=False)
    motion.step(TICK_S, 4.0)
    assert boom.added == 0.0
    motion, _, _, boom = luffing()
    motion.step(TICK_S, None)
    assert boom.added == 0.0
    assert boom.joins  # what was not added until then is not made up for
    motion.step(TICK_S, 4.0)
    assert boom.added == 0.0
    assert boom.reached != 0.0
    motion.stop()
    motion.step(TICK_S, 4.0)
    assert (boom.added, boom.reached) != (0.0, 0.0)
    boom.able = False
    for _ in range(12):
        motion.step(TICK_S, 4.0)
    assert (boom.added, boom.reached) == (0.0, 0.0)


def test_a_jump_of_the_radius_is_followed_within_a_second() -> None:
    motion, _, _, boom = luffing()
    for _ in range(200):
        motion.step(TICK_S, 4.0)
    before = boom.reached
    motion.step(TICK_S, 8.0)
    assert boom.reached == pytest.approx(before * 1.02, rel=1e-3)


@pytest.mark.parametrize("path", [0.5, -0.5])
def test_luffing_adds_in_the_range_of_its_demands(path: float) -> None:
    stage = OutputStage(OutputLimits(rise_per_s=5.0, fall_per_s=5.0), 125, TICK_S, spreads=False)
    for _ in range(20):
        stage.drive(0.8, 0.8, 0.6, path, 0.0, sensor_damps=False)
    assert stage.output.setpoint == pytest.approx(0.8 if path > 0.0 else 0.1, abs=0.008)
    assert stage.output.applied == pytest.approx(stage.output.setpoint - path)
    for _ in range(20):
        stage.drive(-0.8, -0.8, 0.0, path, 0.0, sensor_damps=False)
    assert stage.output.setpoint == pytest.approx(0.0 if path > 0.0 else -0.5, abs=0.008)


def test_an_axis_that_bends_takes_it_while_it_is_shaped_only() -> None:
    """Not in bypass, not in a stop: there it is what it would be without."""
    one, plain = (
        ShapedAxis(TICK_S, OutputLimits(rise_per_s=5.0), sway=None, shaper=Off()) for _ in range(2)
    )
    one.bends = True
    for axis in (one, plain):
        axis.tick(CommandInput())
    for command, added, bypass, differs in (
        (0.8, -0.3, False, True),
        (0.8, -0.3, True, False),
        (0.8, -0.3, False, True),
    ):
        for _ in range(30):
            one.tick(CommandInput(command, bypass=bypass), added)
            plain.tick(CommandInput(command, bypass=bypass))
        assert (abs(one.output.setpoint - plain.output.setpoint) > 0.1) is differs
    for _ in range(40):
        for axis in (one, plain):
            axis.tick(CommandInput(fault=Reason.JOYSTICK_TIMEOUT), -0.3)
    assert one.output.setpoint == plain.output.setpoint == 0.0
