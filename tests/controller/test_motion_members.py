"""Knowledge that a two-axis motion has of its axes: held velocity, next tick, room to move."""

from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from tests.controller.motion_rig import Make, moving_as_one, near_far
from tests.rigs.files import machine_file

TICK_S = 0.02


def member(controller: Controller) -> Any:
    """Near-far as its motion has it."""
    return controller.motions[0]._near_far


@pytest.mark.parametrize(
    ("cycle_ms", "deadlines", "held_s", "ahead_s"),
    [
        (20, (4, 5), 0.0, 0.0),
        (20, (4, 8), 0.06, 0.0),
        (60, (2, 3), 0.0, 0.0),
        (60, (3, 4), 0.0, 0.04),
        (60, (4, 5), 0.0, 0.02),
        (60, (3, 7), 0.0, 0.0),
        (60, (3, 9), 0.06, 0.0),
        (60, (3, 12), 0.12, 0.0),
    ],
)
def test_periods_that_were_missed_are_held_and_the_next_is_awaited(
    changed_rig: Make,
    cycle_ms: int,
    deadlines: tuple[int, int],
    held_s: float,
    ahead_s: float,
) -> None:
    cycles = {"BO_ 513 20;": f"BO_ 513 {cycle_ms};"}
    controller = moving_as_one(changed_rig, dbc=cycles).controller
    one = member(controller)
    one.moving.added, one.moving.ahead_s = 0.5, 9.0
    one.update(TICK_S, *deadlines)
    assert one.moving.reached == pytest.approx(0.5 * one.moving.full_speed * held_s)
    assert one.moving.ahead_s == pytest.approx(ahead_s)


@pytest.mark.parametrize("use", ["damp", "watch"])
def test_with_a_sensor_that_damps_it_may_go_as_far_again(use: str, tmp_path: Any) -> None:
    file = machine_file(tmp_path, "forwarder-sensor", ("use: damp", f"use: {use}"))
    controller = Controller(load_deployment(file))
    (motion,) = controller.deployment.config.motion.values()
    times = 2.0 if use == "damp" else 1.0
    assert member(controller).moving.farthest == times * motion.max_path_m


def test_while_one_is_measured_nothing_is_added_to_the_other(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    near_far(rig, 40, Slew=1000)
    slew, moved = (rig.controller.axes[name] for name in ("slew", "near_far"))
    assert slew.added and moved.added
    moved.isolate(rig.controller.joysticks["left"])
    assert moved.added == 0.0
    rig.run(1, Slew=1000)
    assert slew.added == 0.0


def test_a_trip_of_another_axis_is_none_of_theirs(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    rig.run(40, Slew=1000, Lift=1000)
    before = rig.controller.axes["near_far"].added
    rig.controller.send_failed(Frame("crane", 514, False, bytes(2)))
    rig.run(1, Slew=1000, Lift=1000)
    assert rig.reason("lift") == "SEND_FAILED"
    assert abs(rig.controller.axes["near_far"].added) > 0.9 * abs(before) > 0.0


def test_a_trip_of_slew_is_the_end_of_what_it_added_to_near_far(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    near_far(rig, 40, Slew=1000, NearFar=300)
    control = rig.controller.axes["near_far"]
    assert control.added
    rig.controller.send_failed(Frame("crane", 512, False, bytes(2)))
    for _ in range(5):
        rig.run(1, Slew=1000, NearFar=300)
        assert control.added == 0.0
    assert rig.reason() == "SEND_FAILED"
