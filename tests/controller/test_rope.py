"""An axis whose filter follows a rope: the length that counts, known, lost and jumped."""

from itertools import pairwise
from pathlib import Path

import pytest

from canshaper.shaping.states import State
from canshaper.shaping.sway import SwayMode
from tests.rigs.overhead import OverheadRig, changed

LOST = "length=lost"
LARGEST_STEP = 2.0 * 0.02 * 100.0 + 0.02  # the rise of the file, percent in a tick


def period_s(rig: OverheadRig) -> float:
    sway = rig.controller.axes["bridge"].axis.sway
    assert sway is not None
    return sway.mode.period_s


def of_rope(length_m: float) -> float:
    return SwayMode.from_length(length_m, 0.005).period_s


def test_the_swing_is_that_of_the_measured_rope() -> None:
    rig = OverheadRig()
    rig.run(3)
    assert period_s(rig) == pytest.approx(of_rope(5.0))
    rig.rope_m = 5.2
    rig.run(1)
    assert period_s(rig) == pytest.approx(of_rope(5.2))
    assert rig.news() == []


def test_an_offset_is_added(tmp_path: Path) -> None:
    rig = OverheadRig(changed(tmp_path, ("lowest_m: 1.5,", "offset_m: 1, lowest_m: 1.5,")))
    rig.run(3)
    assert period_s(rig) == pytest.approx(of_rope(6.0))


def test_before_the_first_length_the_longest_rope_holds() -> None:
    rig = OverheadRig()
    rig.rope_m = None
    assert period_s(rig) == pytest.approx(of_rope(30.0))
    rig.run(2)
    assert rig.news() == [f"axis=bridge {LOST}"]


@pytest.mark.parametrize(("lost", "length_m"), [("longest", 30.0), ("hold", 5.0)])
@pytest.mark.parametrize("rope_m", [None, 0.5, 2.0, 8.0])
def test_a_length_that_is_lost_or_jumps_in_motion_is_told_and_makes_no_jump(
    tmp_path: Path, lost: str, length_m: float, rope_m: float | None
) -> None:
    rig = OverheadRig(changed(tmp_path, ("highest_m: 30", f"highest_m: 30, lost: {lost}")))
    rig.run(3)
    speeds = rig.run(60, Bridge=100)
    rig.rope_m = rope_m
    speeds += rig.run(40, Bridge=100)
    state = "lost" if rope_m is None else "jumped"
    assert rig.news() == [f"axis=bridge length={state}"]
    now = period_s(rig)
    assert now > of_rope(5.5) if lost == "longest" else now == pytest.approx(of_rope(5.0))
    if rope_m is not None:
        speeds += rig.run(80, Bridge=100)
        assert rig.news()[1:] == ["axis=bridge length=known"]
    steps = [abs(b - a) for a, b in pairwise(speeds)]
    assert max(steps) <= LARGEST_STEP
    assert max(speeds) <= 100.0
    assert length_m


def test_neutral_stops_and_waits(tmp_path: Path) -> None:
    rig = OverheadRig(changed(tmp_path, ("highest_m: 30", "highest_m: 30, lost: neutral")))
    rig.rope_m = None
    rig.run(3)
    axis = rig.controller.axes["bridge"].axis
    assert (axis.state, axis.reason.name) == (State.NEUTRAL_WAIT, "LENGTH_LOST")
    rig.rope_m = 5.0
    rig.run(3)
    assert rig.run(60, Bridge=100)[-1] > 20.0
    rig.rope_m = None
    rig.run(20, Bridge=100)
    assert (axis.state, axis.reason.name) == (State.STOPPING, "LENGTH_LOST")
    assert rig.run(400, Bridge=100)[-1] == 0.0


def test_a_hoist_in_motion_is_followed() -> None:
    rig = OverheadRig()
    rig.run(3)
    speeds = rig.run(20, Bridge=100)
    for _ in range(150):
        assert rig.rope_m is not None
        rig.rope_m = round(rig.rope_m + 0.01, 3)
        speeds.append(rig.tick(Bridge=100, Hoist=-100)["Bridge"])
    assert period_s(rig) == pytest.approx(of_rope(6.5))
    assert max(abs(b - a) for a, b in pairwise(speeds)) <= LARGEST_STEP
    assert rig.news() == []


def test_what_drives_the_valve_for_a_measurement_follows_no_rope() -> None:
    rig = OverheadRig()
    rig.run(3)
    control = rig.controller.axes["bridge"]
    own, joystick = control.axis, rig.controller.joysticks["left"]
    control.isolate(joystick, rig.controller.axes["hoist"].axis)
    rig.rope_m = 5.2
    rig.run(2)
    assert own.sway is not None
    assert own.sway.mode.period_s == pytest.approx(of_rope(5.2))
    assert control.axis.sway is None
