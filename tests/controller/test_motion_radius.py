"""Two-axis motion with a measured radius: in proportion to it, and without it."""

import pytest

from canshaper.codec.frame import Frame
from canshaper.shaping.states import State
from tests.controller.motion_rig import MEASURED, Make, moving_as_one, near_far, slewing


def test_a_measured_radius_compensates_in_proportion(changed_rig: Make) -> None:
    inwards = []
    for radius_raw in (2000, 4000):
        rig = moving_as_one(changed_rig, MEASURED)
        rig.run(3)
        inwards.append(sum(slewing(rig, 200, radius_raw)))
        assert rig.count("UnknownId") == rig.count("InvalidSignals") == 0
    assert inwards[0] < -3.0
    assert inwards[1] / inwards[0] == pytest.approx(2.0, rel=0.15)  # limited by max_pct


def test_near_far_waits_for_the_first_radius_and_goes_on_without_the_next(
    changed_rig: Make,
) -> None:
    rig = moving_as_one(changed_rig, MEASURED)
    rig.run(3)
    assert set(slewing(rig, 30, None)) == {0.0}
    assert any(slewing(rig, 10, 3000))
    # carried on by the model, as long as the motion lasts
    assert any(slewing(rig, 60, None)[10:])
    assert (rig.state(), rig.state("near_far")) == (State.ACTIVE, State.ACTIVE)
    near_far(rig, 200)
    assert set(slewing(rig, 60, None)) == {0.0}
    assert rig.state("near_far") is State.READY


def test_a_radius_out_of_range_is_counted_and_compensates_nothing(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig, MEASURED)
    rig.run(3)
    assert set(slewing(rig, 50, 60_001)) == {0.0}
    assert rig.count("InvalidSignals") == 50


def test_after_a_stall_a_radius_counts_no_more(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig, MEASURED)
    rig.run(3)
    message = rig.message("TipPosition")
    data = message.encode({"SlewAngle": 0, "Radius": 3000, "Height": 0}, scaling=False)
    rig.receive(Frame("crane", message.frame_id, False, data))
    rig.controller.stalled()
    rig.run(2)
    assert set(slewing(rig, 4, None)) == {0.0}
