"""Two-axis motion on real frames: near-far moves for slew, within its bounds."""

import math

import pytest

from canshaper.controller.events import StateEvent
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.states import Reason, State
from canshaper.shaping.transfer import Off
from tests.controller.motion_rig import FIXED, Make, moving_as_one, near_far

TICK_S = 0.02
FULL_SPEED_RAD_S = 0.5


def test_near_far_moves_in_while_slewing_and_comes_back(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    moving = near_far(rig, 200, Slew=1000)
    inwards = sum(moving) * TICK_S  # m, at 1 m/s full speed
    # a pendulum of 1.2 m on 3 m at 0.5 rad/s hangs out by rho w^2 L / g
    assert inwards == pytest.approx(-3.0 * 0.5**2 * 1.2 / 9.81, abs=0.005)
    assert max(map(abs, moving)) <= 0.25 + 1 / 125
    assert rig.reason("near_far") == "COMPENSATING"
    stopping = near_far(rig, 250)
    # a few millimetres: half a step of the valve, and what the swing of the model leaves
    assert sum(moving + stopping) * TICK_S == pytest.approx(0.0, abs=0.01)
    assert (rig.state(), rig.state("near_far")) == (State.READY, State.READY)
    assert stopping[-1] == 0.0
    states = [e for e in rig.controller.events if isinstance(e, StateEvent)]
    transitions = [(e.axis, e.transition.reason) for e in states]
    assert transitions.count(("near_far", Reason.COMPENSATING)) == 1
    assert transitions.count(("near_far", Reason.AT_REST)) == 1


def test_a_valve_of_two_ticks_is_moved_as_far(changed_rig: Make) -> None:
    cycle = 'BA_ "GenMsgCycleTime" BO_ 513 '
    rig = moving_as_one(changed_rig, dbc={f"{cycle}20;": f"{cycle}40;"})
    rig.run(3)
    moving = near_far(rig, 200, Slew=1000)
    assert moving[0::2] == moving[1::2] or moving[1:-1:2] == moving[2::2]
    assert sum(moving) * TICK_S == pytest.approx(-3.0 * 0.5**2 * 1.2 / 9.81, abs=0.01)


def test_slew_is_given_what_the_filter_does_not_lead_by_itself(changed_rig: Make) -> None:
    """The tip stands ahead of the grapple by psi, tan psi = L / s5; the filter makes the lead L."""
    rig = moving_as_one(changed_rig)
    rig.run(3)
    slew = rig.controller.axes["slew"]
    sway = slew.axis.sway
    assert sway is not None
    added, missing, most = 0.0, 0.0, 0.0
    for tick in range(250):
        rig.run(1, Slew=1000 if tick < 125 else 0)
        added += slew.added * TICK_S * FULL_SPEED_RAD_S
        assert slew.axis.output.setpoint - slew.axis.output.applied == pytest.approx(
            slew.added, abs=1e-12
        )
        lead = sway.angle * FULL_SPEED_RAD_S
        speed = sway.rate * FULL_SPEED_RAD_S
        missing = math.atan2(lead, 1.0 - (speed / sway.mode.omega_rad_s) ** 2) - lead
        # At the end of the tick; the filter's own step in it is not known before.
        assert added == pytest.approx(missing, abs=3e-4)
        most = max(most, abs(missing))
    assert most > 1.5e-3


def test_it_adds_to_what_the_operator_asks(changed_rig: Make) -> None:
    """Never faster than asked: while the tip is to move in, a tip that runs out is slower."""
    plain, rig = changed_rig(), moving_as_one(changed_rig)
    for one in (plain, rig):
        one.run(3)
    alone = near_far(plain, 150, Slew=1000, NearFar=400)
    both = near_far(rig, 150, Slew=1000, NearFar=400)
    assert sum(both) * TICK_S < sum(alone) * TICK_S - 0.05
    assert max(both) <= 0.4
    assert min(both) >= 0.0


@pytest.mark.parametrize("path_m", [0.03, 0.06])
def test_its_way_is_bounded_as_configured(changed_rig: Make, path_m: float) -> None:
    rig = moving_as_one(changed_rig, FIXED + f", max_path_m: {path_m}")
    rig.run(3)
    way_m, ways_m = 0.0, []
    for sent in near_far(rig, 260, Slew=1000) + near_far(rig, 260):
        way_m += sent * TICK_S
        ways_m.append(way_m)
    assert min(ways_m) == pytest.approx(-path_m, abs=0.004)
    assert abs(ways_m[-1]) <= 0.01
    # In metres, whatever the full speed is: half of it, and the way is as long.
    slower = moving_as_one(
        changed_rig,
        FIXED + f", max_path_m: {path_m}",
        yaml={"full_speed_m_s: 1.0": "full_speed_m_s: 0.5"},
    )
    slower.run(3)
    assert sum(near_far(slower, 200, Slew=1000)) * TICK_S * 0.5 == pytest.approx(-path_m, abs=0.01)


def test_its_time_is_bounded_and_counted_again_after_the_run_on(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig, FIXED + ", max_s: 0.8")

    def moving_s() -> float:
        # to and fro: something is to be added all the time
        moved = [near_far(rig, 1, Slew=1000 if i // 50 % 2 else -1000)[0] for i in range(250)]
        return sum(map(bool, moved)) * TICK_S

    rig.run(3)
    assert moving_s() == pytest.approx(0.8, abs=0.1)
    near_far(rig, 150)
    assert rig.state() is State.READY
    assert moving_s() == pytest.approx(0.8, abs=0.1)


# -- slew alone, missed ticks, a measurement -------------------------------------------------------


def test_without_near_far_slew_keeps_its_part(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig, "slew: slew")
    rig.run(3)
    assert set(near_far(rig, 60, Slew=1000)) == {0.0}
    slew = rig.controller.axes["slew"]
    assert slew.axis.output.setpoint - slew.axis.output.applied == pytest.approx(
        slew.added, abs=1e-12
    )
    assert slew.added != 0.0
    rig.controller.motions[0].adjust()
    rig.run(1, Slew=1000)
    assert slew.added != 0.0


def test_missed_ticks_are_no_way_that_is_lost(changed_rig: Make) -> None:
    """The way of a held velocity is taken back: the tip is where it would be without."""
    ways = []
    for missed in (0, 3):
        rig = moving_as_one(changed_rig)
        rig.run(3)
        way = sum(near_far(rig, 40, Slew=1000))
        sent = rig.controller.axes["near_far"].axis.output.setpoint
        rig.tick(missed=missed)
        way += missed * sent
        way += sum(near_far(rig, 200, Slew=1000))
        ways.append(way * TICK_S)
    assert ways[1] == pytest.approx(ways[0], abs=0.01)


def test_an_axis_that_is_measured_is_alone(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    control = rig.controller.axes["near_far"]
    control.isolate(rig.controller.joysticks["left"])
    assert set(near_far(rig, 60, Slew=1000)) == {0.0}
    assert control.added == 0.0
    other = ShapedAxis(TICK_S, OutputLimits(), sway=None, shaper=Off())
    control.isolate(rig.controller.joysticks["left"], other)
    rig.run(60, Slew=1000)
    assert control.axis is other
    assert other.state is State.READY


@pytest.mark.parametrize("max_pct", [2, 3.5])
def test_its_speed_is_bounded_as_configured(changed_rig: Make, max_pct: float) -> None:
    rig = moving_as_one(
        changed_rig, f"slew: slew, near_far: near_far, radius_m: 6.0, max_pct: {max_pct}"
    )
    rig.run(3)
    sent = near_far(rig, 150, Slew=1000) + near_far(rig, 150)
    step = 1 / 125 / 0.95  # rounding does not pass the bound
    assert -max_pct / 100.0 <= min(sent) <= -max_pct / 100.0 + step  # inwards
    assert max_pct / 100.0 - step <= max(sent) <= max_pct / 100.0  # and back
