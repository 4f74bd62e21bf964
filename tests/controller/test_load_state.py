"""The load: when it is known, which filters that means, and what the log says of it."""

import math
from itertools import pairwise

import pytest

from canshaper.codec.frame import Frame
from canshaper.shaping.sway import SwayModel
from tests.rigs.files import ROOT
from tests.rigs.forwarder import Rig

EMPTY, LOG, UNKNOWN = 1, 2, 0


@pytest.fixture
def rig() -> Rig:
    one = Rig(ROOT / "config" / "forwarder-load.yaml")
    one.run(3)
    return one


def say(rig: Rig, kg: int) -> None:
    rig.receive(Frame("crane", 0x414, False, kg.to_bytes(2, "little") + b"\0"))


def run(rig: Rig, seconds: float, kg: int | None, **joystick: int) -> None:
    """Drive with this weight on the bus, every 0.1 s; None: silence."""
    for tick in range(round(seconds / 0.02)):
        if kg is not None and tick % 5 == 0:
            say(rig, kg)
        rig.run(1, **joystick)


def sets(rig: Rig) -> list[int]:
    axes = rig.controller.axes
    return [axes[name].active_set for name in ("slew", "near_far")]


def news(rig: Rig) -> list[str]:
    return [event.text for event in rig.controller.events if "load_state" in event.text]


def test_the_weight_chooses_the_filters_of_both_axes(rig: Rig) -> None:
    assert sets(rig) == [UNKNOWN] * 2
    run(rig, 0.2, 0)
    assert sets(rig) == [EMPTY] * 2
    run(rig, 0.2, 600)
    assert sets(rig) == [LOG] * 2
    assert news(rig) == ["load_state=lost", "load_state=known"]


def test_a_new_weight_counts_in_motion_too(rig: Rig) -> None:
    run(rig, 0.2, 0)
    run(rig, 0.3, 0, Slew=1000)
    run(rig, 0.2, 600, Slew=1000)
    assert sets(rig) == [LOG] * 2


def swing_of_log(rig: Rig, seconds: float) -> float:
    """Press slew with the log's weight on the bus, and return how its pendulum swings then."""
    axis = rig.controller.axes["slew"].axis
    assert axis.sway
    log = SwayModel(rig.deployment.axes["slew"].config.gain_schedule[1].sway.mode(), 0.02)
    for kg, ticks in ((0, round(50 * seconds)), (600, 150)):
        for tick in range(ticks):
            if tick % 5 == 0:
                say(rig, kg)
            rig.run(1, Slew=1000)
            log.step(axis.output.applied)
    return math.hypot(log.angle * log.mode.omega_rad_s, log.rate + axis.output.applied)


@pytest.mark.parametrize("late_s", [0.5, 0.9])
def test_a_weight_that_comes_late_leaves_no_more_swing(rig: Rig, late_s: float) -> None:
    """The filter damps what that for an empty grapple has begun."""
    run(rig, 0.5, 0, Slew=-1000)
    run(rig, 3.0, 0)
    assert swing_of_log(rig, late_s) < 0.01


@pytest.mark.parametrize(("pressed_s", "let_go_s"), [(0.8, 0.2), (1.2, 0.0), (0.8, 1.5)])
def test_a_load_that_is_gripped_after_a_press_or_in_a_long_one_swings_on(
    rig: Rig, pressed_s: float, let_go_s: float
) -> None:
    """Nothing says that it hung there when the press began: nothing jumps."""
    run(rig, 0.2, 0)
    run(rig, pressed_s, 0, Slew=1000)
    run(rig, let_go_s, 0)
    slew, joystick = rig.controller.axes["slew"], {} if let_go_s else {"Slew": 1000}
    swing_deg = [slew.sway_deg]
    for _ in range(8):
        say(rig, 600)
        rig.run(1, **joystick)
        swing_deg.append(slew.sway_deg)
    assert sets(rig)[0] == LOG
    assert max(abs(after - before) for before, after in pairwise(swing_deg)) < 0.7


def test_one_that_is_lost_in_motion_holds_until_the_speed_is_steady(rig: Rig) -> None:
    run(rig, 0.2, 600)
    run(rig, 0.2, 600, Slew=1000)
    run(rig, 1.2, None, Slew=1000)
    assert sets(rig) == [LOG, UNKNOWN]  # the other axis rests
    assert news(rig)[2:] == ["load_state=lost"]
    run(rig, 1.4, None, Slew=1000)  # at full speed after 2.1 s
    assert sets(rig) == [UNKNOWN] * 2


def test_a_signal_that_jumps_to_and_fro_is_not_believed(rig: Rig) -> None:
    for kg in (600, 0, 600, 0):
        run(rig, 0.2, kg)
    assert sets(rig) == [UNKNOWN] * 2
    assert news(rig)[2:] == ["load_state=restless"]
    run(rig, 2.2, 600)
    assert sets(rig) == [LOG] * 2
    assert news(rig)[3:] == ["load_state=known"]


def test_two_jumps_are_a_grip_and_a_release(rig: Rig) -> None:
    for kg in (0, 600, 0):
        run(rig, 0.2, kg)
    assert sets(rig) == [EMPTY] * 2


def test_noise_of_a_weight_is_no_jump(rig: Rig) -> None:
    for kg in (600, 310, 590, 320, 600, 310):
        run(rig, 0.2, kg)
    assert news(rig) == ["load_state=lost", "load_state=known"]
