"""Two-axis motion on real frames: near-far moves for slew, and only while it may."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.controller.events import MotionEvent, StateEvent
from canshaper.shaping.axis import Axis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.off import Off
from canshaper.shaping.states import Reason, State
from tests.rigs.forwarder import Rig

TICK_S = 0.02
FULL_SPEED_RAD_S = 0.5
FIXED = "slew: slew, near_far: near_far, radius_m: 3.0, max_pct: 25"
TIP = "bus: crane, message: TipPosition, signal: Radius, timeout_ms: 100"
MEASURED = f"slew: slew, near_far: near_far, radius: {{ {TIP} }}"
NEAR_JOYSTICK = "command: { joystick: left, signal: NearFar, neutral_pct: 2 }"


Make = Callable[..., Rig]


def moving_as_one(make: Make, text: str = FIXED, **changes: dict[str, str]) -> Rig:
    section = f"motion: {{ crane: {{ {text} }} }}\naxes:\n"
    return make({"axes:\n": section, **changes.get("yaml", {})}, changes.get("dbc"))


# Near-far on the joystick that the slew joystick is not on, in place of lift.
LIFT_OF_RIGHT = {
    "signal: Lift,": "signal: Rotate,",
    NEAR_JOYSTICK: NEAR_JOYSTICK.replace("left", "right").replace("NearFar", "Lift"),
}


def by_two_joysticks(make: Make) -> Rig:
    """With compensation, and the two joysticks on two joysticks."""
    return moving_as_one(make, yaml=LIFT_OF_RIGHT)


def near_far(rig: Rig, ticks: int, **raw: int) -> list[float]:
    """Velocity of near-far, fraction of full speed, tick by tick."""
    sent = []
    for _ in range(ticks):
        rig.run(1, **raw)
        sent.append(rig.controller.axes["near_far"].axis.sent)
    return sent


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
        assert slew.axis.sent - slew.axis.applied == pytest.approx(slew.added, abs=1e-12)
        lead = sway.angle * FULL_SPEED_RAD_S
        speed = sway.rate * FULL_SPEED_RAD_S
        missing = math.atan2(lead, 1.0 - (speed / sway.mode.omega_rad_s) ** 2) - lead
        # At the end of the tick; the filter's own step in it is not known before.
        assert added == pytest.approx(missing, abs=3e-4)
        most = max(most, abs(missing))
    assert most > 1.5e-3


@pytest.mark.parametrize("command", [1000, -1000])
def test_it_moves_in_whichever_way_the_crane_slews(changed_rig: Make, command: int) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    assert sum(near_far(rig, 150, Slew=command)) * TICK_S < -0.08


def test_without_compensation_nothing_moves(changed_rig: Make) -> None:
    rig = changed_rig()
    rig.run(3)
    assert set(near_far(rig, 200, Slew=1000)) == {0.0}


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


def test_bypass_switches_it_off(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3, AntiSwayOff=1)
    assert set(near_far(rig, 200, Slew=1000, AntiSwayOff=1)) == {0.0}
    assert rig.state("near_far") is State.READY
    assert rig.state() is State.BYPASS_ON


def test_a_slew_whose_anti_sway_is_off_asks_nothing_of_another_joystick(changed_rig: Make) -> None:
    rig = by_two_joysticks(changed_rig)
    for i in range(200):
        left = rig.joystick("JoystickLeft", AntiSwayOff=1, Slew=1000 if i > 2 else 0)
        rig.receive(left, rig.joystick("JoystickRight"))
        assert rig.tick()["NearFarCommand"]["Velocity"] == 0
    assert (rig.state(), rig.state("near_far")) == (State.BYPASS_ON, State.READY)


def test_a_swing_left_by_the_bypass_moves_nothing_for_longer_than_the_tail(
    changed_rig: Make,
) -> None:
    """Anti-sway comes back while the crane runs out: the grapple swings on, the tip may not."""
    rig = moving_as_one(changed_rig)
    rig.run(3, AntiSwayOff=1)
    rig.run(100, Slew=1000, AntiSwayOff=1)
    rig.run(3, AntiSwayOff=1)
    rig.run(1)
    assert rig.state() is State.ACTIVE
    near_far(rig, 115)  # tail_s and the fall from full speed
    assert set(near_far(rig, 200)) == {0.0}
    assert (rig.state(), rig.state("near_far")) == (State.READY, State.READY)


def test_anti_sway_on_in_full_slew_does_not_twitch(changed_rig: Make) -> None:
    """What the tip would have done under compensation is not made up for at a stroke."""
    rig = moving_as_one(changed_rig)
    rig.run(3, AntiSwayOff=1)
    rig.run(2000, Slew=1000, AntiSwayOff=1)  # until the swing of the start has died away
    assert max(map(abs, near_far(rig, 5, Slew=1000))) <= 0.02


def test_a_joystick_that_is_not_enabled_is_not_moved_for_slew(changed_rig: Make) -> None:
    rig = by_two_joysticks(changed_rig)
    for enable, state in ((0, State.NEUTRAL_WAIT), (1, State.NEUTRAL_WAIT), (1, State.ACTIVE)):
        lift = 500 if (enable, state) == (1, State.NEUTRAL_WAIT) else 0  # enabled, but held out
        for i in range(120):
            left = rig.joystick("JoystickLeft", Slew=1000 if i > 2 else 0)
            rig.receive(left, rig.joystick("JoystickRight", Enable=enable, Lift=lift))
            sent = rig.tick()
            if state is State.NEUTRAL_WAIT:
                assert sent["NearFarCommand"]["Velocity"] == 0
        assert rig.state() is State.ACTIVE
        assert rig.state("near_far") is state


def test_a_lost_joystick_of_near_far_stops_the_compensation(changed_rig: Make) -> None:
    rig = by_two_joysticks(changed_rig)
    rig.run(3)
    sent = near_far(rig, 40, Slew=1000)
    assert sent[-1] < -0.05
    after = []
    for _ in range(120):
        rig.receive(rig.joystick("JoystickLeft", Slew=1000))
        rig.tick()
        after.append(rig.controller.axes["near_far"].axis.sent)
    assert rig.state() is State.ACTIVE
    # five ticks of timeout, then at the fall rate to neutral
    assert not any(after[5 + math.ceil(0.25 / 0.1) :])
    assert rig.state("near_far") is State.NEUTRAL_WAIT


def test_enable_released_is_neutral_for_both_in_the_same_tick(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    assert near_far(rig, 40, Slew=1000)[-1] < -0.05
    sent = rig.run(1, Slew=1000, Enable=0)
    assert sent["SlewCommand"]["Velocity"] == sent["NearFarCommand"]["Velocity"] == 0
    assert (rig.state(), rig.state("near_far")) == (State.TRIPPED, State.TRIPPED)
    rig.run(50, Enable=0)
    assert set(near_far(rig, 100, Slew=1000)) == {0.0}  # and it takes a neutral joystick to go on


def test_a_released_enable_of_slew_alone_ends_it_in_the_same_tick(changed_rig: Make) -> None:
    slow = LIFT_OF_RIGHT | {"fall_per_s: 5": "fall_per_s: 1"}  # by the rate it would take longer
    rig = moving_as_one(changed_rig, yaml=slow)
    rig.run(3)
    assert near_far(rig, 40, Slew=1000)[-1] < -0.05
    for _ in range(20):
        rig.receive(
            rig.joystick("JoystickLeft", Slew=1000, Enable=0), rig.joystick("JoystickRight")
        )
        assert rig.tick()["NearFarCommand"]["Velocity"] == 0
        assert rig.state() is State.TRIPPED
    assert rig.state("near_far") is State.READY


def test_a_released_enable_of_slew_leaves_the_operators_own_part(changed_rig: Make) -> None:
    rig, plain = by_two_joysticks(changed_rig), changed_rig(LIFT_OF_RIGHT)
    for one in (rig, plain):
        for tick in range(60):
            slew = 1000 if tick > 2 and one is rig else 0
            one.receive(one.joystick("JoystickLeft", Slew=slew))
            one.receive(one.joystick("JoystickRight", Lift=400 if tick > 2 else 0))
            one.tick()
    for one in (rig, plain):
        one.receive(one.joystick("JoystickLeft", Enable=0), one.joystick("JoystickRight", Lift=400))
        one.tick()
    sent = [one.controller.axes["near_far"].axis.sent for one in (rig, plain)]
    assert sent[0] == pytest.approx(sent[1], abs=0.02)
    assert sent[1] > 0.2


def test_a_lost_joystick_of_slew_ends_it_in_the_fade(changed_rig: Make) -> None:
    """The shaped stop of slew goes on; near-far has an operator who did not ask for it."""
    rig = by_two_joysticks(changed_rig)
    rig.run(3)
    assert near_far(rig, 40, Slew=1000)[-1] < -0.05
    after = []
    for _ in range(30):
        rig.receive(rig.joystick("JoystickRight"))
        rig.tick()
        after.append(rig.controller.axes["near_far"].axis.sent)
    assert rig.state() is State.STOPPING
    assert not any(after[5 + 15 :])
    assert rig.state("near_far") is State.READY


@pytest.mark.parametrize("slew_ticks", [20, 30, 60, 100])
def test_near_far_that_becomes_ready_while_slew_moves_does_not_twitch(
    changed_rig: Make, slew_ticks: int
) -> None:
    """What it has missed of the path is not made up for: it begins with what is still to come."""
    rig, sent = by_two_joysticks(changed_rig), []
    for tick in range(slew_ticks + 150):
        moves = 1000 if 3 <= tick < slew_ticks + 40 else 0
        rig.receive(rig.joystick(Slew=moves))
        if tick >= slew_ticks:
            rig.receive(rig.joystick("JoystickRight"))
        rig.tick()
        sent.append(rig.controller.axes["near_far"].axis.sent)
    assert not any(sent[: slew_ticks + 1])
    assert max(map(abs, sent)) > 0.03  # it does take part
    begin = sent[slew_ticks : slew_ticks + 12]
    assert max(abs(b - a) for a, b in itertools.pairwise(begin)) < 0.05
    signs = [s > 0 for s in begin if s]
    assert sum(a != b for a, b in itertools.pairwise(signs)) <= 1


@pytest.mark.parametrize("sign", [1, -1])
def test_it_never_runs_against_a_joystick_that_is_held(changed_rig: Make, sign: int) -> None:
    """Slewing to and fro; the near-far joystick is held out a little, then pulled in."""
    rig = moving_as_one(changed_rig)
    rig.run(3)
    for tick in range(400):
        held = sign * (40 if tick < 200 else -40)
        slew = 1000 if tick // 60 % 2 else -1000
        before = rig.controller.axes["near_far"].axis.sent
        sent = near_far(rig, 1, Slew=slew, NearFar=held)[0]
        if tick in range(200, 210) and before * held < 0:
            continue  # the reversal itself, by the rate
        assert sent * held >= 0.0


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


def test_a_stalled_loop_trips_both(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    near_far(rig, 40, Slew=1000)
    rig.controller.stalled()
    assert not any(near_far(rig, 1, Slew=1000))
    assert (rig.reason(), rig.reason("near_far")) == ("LOOP_STALLED", "LOOP_STALLED")


# -- with a measured radius ------------------------------------------------------------------------


def slewing(rig: Rig, ticks: int, radius_raw: int | None) -> list[float]:
    """Slew in full motion, with or without a frame of the radius each tick."""
    sent = []
    message = rig.message("TipPosition")
    for _ in range(ticks):
        if radius_raw is not None:
            raw = {"SlewAngle": 0, "Radius": radius_raw, "Height": 0}
            data = message.encode(raw, scaling=False, strict=False)
            rig.receive(Frame("crane", message.frame_id, False, data))
        sent += near_far(rig, 1, Slew=1000)
    return sent


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


# -- slew alone, missed ticks, a measurement -------------------------------------------------------


def test_without_near_far_slew_keeps_its_part(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig, "slew: slew")
    rig.run(3)
    assert set(near_far(rig, 60, Slew=1000)) == {0.0}
    slew = rig.controller.axes["slew"]
    assert slew.axis.sent - slew.axis.applied == pytest.approx(slew.added, abs=1e-12)
    assert slew.added != 0.0
    rig.controller.motions[0].adjust()
    rig.run(1, Slew=1000)
    assert slew.added != 0.0


def test_missed_ticks_are_no_way_that_is_lost(changed_rig: Make) -> None:
    """What was held in them is taken back: the tip is where it would be without."""
    ways = []
    for missed in (0, 3):
        rig = moving_as_one(changed_rig)
        rig.run(3)
        way = sum(near_far(rig, 40, Slew=1000))
        sent = rig.controller.axes["near_far"].axis.sent
        rig.tick(missed=missed)
        way += missed * sent
        way += sum(near_far(rig, 200, Slew=1000))
        ways.append(way * TICK_S)
    assert ways[1] == pytest.approx(ways[0], abs=0.01)


def test_only_a_deadline_that_was_missed_is_counted(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3, Slew=1000)
    counters = rig.controller.counters
    assert counters.last_fault is FrameFault.NONE
    rig.tick(missed=2)
    assert counters.last_fault is FrameFault.MISSED_DEADLINE
    assert counters.values["MissedDeadlines"] == 2


def test_an_axis_that_is_measured_is_alone(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    runner = rig.controller.axes["near_far"]
    runner.isolate(rig.controller.joysticks["left"])
    assert set(near_far(rig, 60, Slew=1000)) == {0.0}
    assert runner.added == 0.0
    other = Axis(TICK_S, OutputLimits(), sway=None, shaper=Off())
    runner.isolate(rig.controller.joysticks["left"], other)
    rig.run(60, Slew=1000)
    assert runner.axis is other
    assert other.state is State.READY


def test_the_controller_has_the_motions_that_are_bound(changed_rig: Make) -> None:
    deployment = moving_as_one(changed_rig).controller.deployment
    assert len(Controller(deployment).motions) == 1
    assert Controller(replace(deployment, motions={})).motions == []


# -- what the log says of it -----------------------------------------------------------------------


def said(rig: Rig) -> list[str]:
    """What the log says of the motion, since this was asked last."""
    texts = [event.text for event in rig.controller.events if isinstance(event, MotionEvent)]
    rig.controller.events.clear()
    return texts


TOGETHER = "motion=crane axes=together"
SINGLE = "motion=crane axes=single"


def test_the_log_says_once_why_the_axes_move_singly_and_once_that_they_no_longer_do(
    changed_rig: Make,
) -> None:
    rig = by_two_joysticks(changed_rig)
    rig.run(50)
    assert said(rig) == [TOGETHER]
    rig.run(50, Slew=1000)
    rig.run(50, Slew=1000, AntiSwayOff=1)
    assert said(rig) == [f"{SINGLE} slew=BYPASS_ON"]
    rig.run(50, Slew=1000)
    assert said(rig) == [TOGETHER]
    for _ in range(50):  # released on the other joystick
        rig.receive(rig.joystick("JoystickLeft"), rig.joystick("JoystickRight", Enable=0))
        rig.tick()
    assert said(rig) == [f"{SINGLE} near_far=TRIPPED"]
    rig.run(50)
    assert said(rig) == [TOGETHER]


def test_a_trip_that_becomes_another_state_is_the_same_cause(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig).moving()
    said(rig)
    rig.run(50, Enable=0)
    rig.run(1, Slew=500)  # reset by the press, but held out: it waits for neutral
    rig.run(50, Slew=500)
    assert said(rig) == [f"{SINGLE} slew=TRIPPED"]


def test_the_log_says_that_the_radius_is_lost(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig, MEASURED)
    rig.run(50)
    assert said(rig) == [f"{SINGLE} radius=lost"]
    slewing(rig, 50, 3000)
    assert said(rig) == [TOGETHER]
    slewing(rig, 50, None)  # carried on by the model, as long as the motion lasts
    assert said(rig) == [f"{SINGLE} radius=lost"]
    slewing(rig, 50, 3000)
    assert said(rig) == [TOGETHER]


def test_at_the_start_the_axes_wait_without_a_word(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    for _ in range(50):
        rig.tick()
    assert said(rig) == []
