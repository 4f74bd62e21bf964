"""Frames of a crane, and what the page is shown of them."""

import math
import time
from typing import Any

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.valve_messages import Counters
from canshaper.shaping.reasons import REASON_TEXTS, STATE_TEXTS
from canshaper.shaping.states import Reason, State
from canshaper.studio.view import SILENT_S, CraneView
from canshaper.studio.words import FAULTS, Events, fault_words, reason_words, state_words
from canshaper_sim.crane import CraneParameters
from canshaper_sim.grapple import Sway
from canshaper_sim.hand import Hand, Held
from canshaper_sim.plant import PlantNode
from tests.rigs.files import CONFIG, read
from tests.rigs.j1939 import bjm
from tests.rigs.reports import report
from tests.rigs.sent import status_frame

FILES = ["forwarder", "forwarder-joints", "j1939-forwarder", "j1939-profiles", "canopen-forwarder"]


class Watched:
    """A view and what it reported."""

    def __init__(self, name: str = "forwarder") -> None:
        self.deployment = read(CONFIG / f"{name}.yaml")
        self.reported: list[tuple[str, str]] = []
        self.view = CraneView(
            self.deployment, lambda text, level: self.reported.append((text, level))
        )

    def receive(self, frames: list[Frame], now_s: float = 0.0) -> dict[str, Any]:
        for frame in frames:
            self.view.receive(frame, now_s)
        return self.view.values(now_s)

    def status(
        self, state: State, reason: Reason, sway_deg: float = 0.0, axis: str = "slew"
    ) -> Frame:
        codec = self.deployment.axes[axis].status
        assert codec
        return status_frame(codec, report(state, reason, sway_deg=sway_deg))

    def valve(self, axis: str, steps: int) -> Frame:
        bound = self.deployment.axes[axis]
        return bound.valve.message.sender().frame({bound.config.valve.signal: steps})

    def sway(self, across_deg: float, along_deg: float = 0.0) -> list[Frame]:
        sway = Sway(math.radians(across_deg), math.radians(along_deg))
        return PlantNode(self.deployment, sway=sway).feedback()


@pytest.fixture
def watched() -> Watched:
    return Watched()


@pytest.mark.parametrize("name", [*FILES, "two-cranes"])
def test_joysticks_of_every_kind_of_joystick(name: str) -> None:
    watched = Watched(name)
    joysticks = dict(zip(watched.deployment.axes, (0.5, -0.25, 1.0, -0.75), strict=False))
    shown = watched.receive(Hand(watched.deployment).frames(0, Held(joysticks)))
    given = {axis: values["joystick"] for axis, values in shown["axes"].items()}
    assert given == pytest.approx({axis: joysticks.get(axis, 0.0) for axis in given}, abs=0.005)


@pytest.mark.parametrize("name", FILES)
def test_pose_and_joints_are_those_of_the_crane(name: str) -> None:
    watched = Watched(name)
    crane = CraneParameters()
    shown = watched.receive(PlantNode(watched.deployment).feedback())
    assert shown["crane"]
    assert shown["pose"] == pytest.approx((0.0, crane.start_radius_m, crane.start_height_m))
    if name != "forwarder-joints":
        assert shown["joints"] is None
        return
    lift, knuckle = crane.joints.boom.angles(3.0, 4.0, crane.joints.start_extension_m)
    expected = math.degrees(lift), math.degrees(knuckle), crane.joints.start_extension_m
    assert shown["joints"] == pytest.approx(expected, abs=0.01)


def test_the_valve_is_shown_as_the_speed_that_results(watched: Watched) -> None:
    """5 % of dead band: 5 % command gives nothing, full command full speed."""
    for steps, speed in ((0, 0.0), (6, 0.0), (-125, -1.0), (125, 1.0), (66, (0.528 - 0.05) / 0.95)):
        shown = watched.receive([watched.valve("near_far", steps)])
        assert shown["axes"]["near_far"]["valve"] == pytest.approx(speed, abs=1e-4)
        assert shown["axes"]["slew"]["valve"] is None


def test_states_are_words_and_changes_are_events(watched: Watched) -> None:
    shown = watched.receive([watched.status(State.NEUTRAL_WAIT, Reason.ENABLE_OFF)])
    assert shown["axes"]["slew"]["state"] == "waiting for neutral"
    assert shown["axes"]["slew"]["reason"] == "enable is off"
    assert watched.reported == []
    watched.receive([watched.status(State.READY, Reason.JOYSTICK_NEUTRAL)] * 3)
    watched.receive([watched.status(State.STOPPING, Reason.JOYSTICK_TIMEOUT)])
    watched.receive([watched.status(State.TRIPPED, Reason.ENABLE_LOST)])
    assert watched.reported == [
        ("slew: ready — joystick in neutral", "info"),
        ("slew: stopping — no joystick message", "warn"),
        ("slew: tripped: neutral — enable released in motion", "bad"),
    ]


def test_swing_is_the_largest_sway_of_the_last_period(watched: Watched) -> None:
    watched.receive(watched.sway(6.0, 8.0), 0.0)
    assert watched.receive(watched.sway(-3.0), 1.0)["swing"] == pytest.approx(10.0, abs=0.02)
    shown = watched.receive(watched.sway(1.0), 2.4)  # a period, of 2.36 s, later
    assert shown["swing"] == pytest.approx(3.0, abs=0.02)
    assert shown["sway"] == pytest.approx((1.0, 0.0), abs=0.01)


def joystick(watched: Watched, slew: float) -> Frame:
    return next(iter(Hand(watched.deployment).frames(0, Held({"slew": slew}))))


def test_still_after_is_the_time_from_the_release_to_the_last_swing(watched: Watched) -> None:
    watched.receive([watched.valve("slew", 40)], 1.0)
    assert watched.receive([joystick(watched, 0.5), *watched.sway(6.0)], 1.0)["still"] is None
    shown = watched.receive([joystick(watched, 0.0), *watched.sway(6.0)], 2.0)
    assert (shown["still"], shown["swings"]) == (0.0, True)
    shown = watched.receive(watched.sway(2.5), 3.5)
    assert (shown["still"], shown["swings"]) == (1.5, True)
    shown = watched.receive(watched.sway(1.5), 6.0)  # longer than a period of 2.36 s
    assert (shown["still"], shown["swings"]) == (1.5, False)
    assert watched.receive([joystick(watched, -0.5)], 7.0)["still"] is None
    watched.receive([joystick(watched, 0.0)], 8.0)
    assert watched.receive(watched.sway(0.1), 9.0)["still"] == 0.0


def test_a_press_that_moves_nothing_has_no_time(watched: Watched) -> None:
    """As in NEUTRAL_WAIT: nothing hung still after 0.0 s, since nothing drove."""
    pressed, let_go = (joystick(watched, slew) for slew in (0.5, 0.0))
    closed = watched.valve("slew", 0)
    watched.receive([closed, pressed], 1.0)
    assert watched.receive([let_go], 2.0)["still"] is None
    watched.receive([pressed, watched.valve("slew", 40), pressed], 3.0)
    watched.receive([closed, pressed], 4.0)
    assert watched.receive([let_go], 5.0)["still"] == 0.0


def test_without_a_measured_sway_that_of_the_models_is_shown(watched: Watched) -> None:
    """Its lag is counted positive; across the boom the grapple then hangs to the other side."""
    moves = State.ACTIVE, Reason.JOYSTICK_MOVED
    frames = [watched.status(*moves, 4.0), watched.status(*moves, 3.0, "near_far")]
    shown = watched.receive(frames)
    assert not shown["measured"]
    assert shown["sway"] == pytest.approx((-4.0, 3.0))
    assert shown["swing"] == pytest.approx(5.0)
    assert watched.receive(watched.sway(1.0))["measured"]


def test_a_silent_daemon_is_reported_and_its_states_are_cleared(watched: Watched) -> None:
    watched.receive([watched.status(State.READY, Reason.JOYSTICK_NEUTRAL)], 0.0)
    watched.view.report_lateness(120)
    watched.view.check(0.0)
    watched.view.check(SILENT_S - 0.01)
    assert watched.view.values(0.1)["late_us"] == 120
    watched.view.check(SILENT_S)
    watched.view.check(SILENT_S + 1.0)
    shown = watched.view.values(SILENT_S + 1.0)
    assert not shown["daemon"] and shown["late_us"] is None
    assert shown["axes"]["slew"]["state"] is None
    watched.receive([watched.status(State.NEUTRAL_WAIT, Reason.START)], 2.0)
    watched.view.check(2.0)
    assert [level for _, level in watched.reported] == ["info", "bad", "info"]


def test_a_silent_crane_is_reported_and_its_sway_is_measured_no_more(watched: Watched) -> None:
    watched.receive(watched.sway(20.0), 0.0)
    watched.view.check(0.0)
    assert watched.view.values(0.0)["measured"]
    watched.view.check(SILENT_S)
    shown = watched.view.values(SILENT_S)
    assert not shown["crane"] and not shown["measured"]
    assert shown["sway"] is shown["swing"] is None
    assert shown["pose"] is not None
    assert [level for _, level in watched.reported] == ["bad"]


def test_faults_are_reported_once(watched: Watched) -> None:
    codec = watched.deployment.status
    assert codec
    counters = Counters()
    counters.add(FrameFault.COUNTER_JUMP)
    frame = status_frame(codec, {"LastFault": int(counters.last_fault), **counters.values})
    shown = watched.receive([frame, frame])
    assert shown["fault"] == "counter jump"
    assert watched.reported == [("fault: counter jump", "warn")]


def test_frames_of_another_length_are_passed_over(watched: Watched) -> None:
    frames = [
        *Hand(watched.deployment).frames(0, Held({"slew": 1.0})),
        watched.status(State.READY, Reason.JOYSTICK_NEUTRAL),
        watched.valve("slew", 50),
        *watched.sway(5.0),
    ]
    for frame in frames:
        for length in range(len(frame.data)):
            watched.receive([frame._replace(data=frame.data[:length])])
    for frame in frames[:2]:  # of joysticks
        watched.receive([frame._replace(data=frame.data + b"\0")])
    shown, nothing = watched.view.values(0.0), Watched().view.values(0.0)
    del shown["sources"]["SlewStatus"], nothing["sources"]["SlewStatus"]  # counted by its id alone
    assert shown == nothing
    assert not shown["daemon"] and not shown["crane"]
    assert shown["pose"] is shown["sway"] is shown["swing"] is None
    assert {axis["level"] for axis in shown["axes"].values()} == {"off"}


def test_every_state_reason_and_fault_has_words() -> None:
    assert STATE_TEXTS.keys() == {*State} and REASON_TEXTS.keys() == {*Reason}
    assert FAULTS.keys() == {*FrameFault}
    assert state_words(15) == "state 15"
    assert reason_words(99) == "reason 99"
    assert fault_words(99) == "fault 99" and fault_words(0) == ""


@pytest.mark.parametrize("priority", [3, 6])
def test_a_joystick_of_j1939_is_seen_at_every_priority_and_one_at_a_time(priority: int) -> None:
    watched = Watched("j1939-forwarder")
    watched.receive([bjm("BJM1", s, priority, X=x) for s, x in ((0x33, 100.0), (0x34, -100.0))])
    assert watched.view.axes["slew"].joystick == pytest.approx(1.0)


def test_the_set_in_force_says_which_profile() -> None:
    watched = Watched("j1939-profiles")
    codec = watched.deployment.axes["slew"].status
    assert codec
    for number, name in enumerate(["normal", "quick", "fine", None]):
        one = report(State.READY, Reason.JOYSTICK_NEUTRAL, active_set=number)
        axes = watched.receive([status_frame(codec, one)])["axes"]
        assert axes["slew"]["profile"] == name
        assert axes["near_far"]["profile"] is axes["lift"]["profile"] is None


def test_frames_a_second_and_age_of_each_source(watched: Watched) -> None:
    shown = watched.view.values(0.0)["sources"]
    assert shown["joystick left"] == {"per_s": 0, "age_s": None}
    for tick in range(100):  # two seconds, the joystick at 50 and the valve at 25 frames a second
        watched.receive(Hand(watched.deployment).frames(0, Held()), 0.02 * tick)
        if tick % 2:
            watched.receive([watched.valve("slew", 10)], 0.02 * tick)
    shown = watched.view.values(1.99)["sources"]
    name = watched.deployment.axes["slew"].valve_message.name
    assert shown["joystick left"] == {"per_s": 50, "age_s": pytest.approx(0.01)}
    assert shown[name] == {"per_s": 25, "age_s": pytest.approx(0.01)}
    assert shown["TipPosition"]["age_s"] is None
    gone = watched.view.values(9.0)["sources"]
    assert gone[name] == {"per_s": 0, "age_s": pytest.approx(7.02)}


def test_a_joystick_position_that_is_old_is_shown_no_more(watched: Watched) -> None:
    watched.receive(Hand(watched.deployment).frames(0, Held({"slew": 0.5})), 1.0)
    for age_s, position in ((SILENT_S - 0.01, 0.5), (SILENT_S, None)):
        watched.view.check(1.0 + age_s)
        axis = watched.view.values(1.0 + age_s)["axes"]["slew"]
        assert axis["joystick"] == (position and pytest.approx(position, abs=0.005))


def test_an_event_has_the_clock_of_the_charts() -> None:
    """Only the page reads it: it draws its mark on the time axis."""
    events, before_s = Events(), time.monotonic()
    events.add("page", "something")
    ((*_, clock_s),) = events.since(0)
    assert before_s <= float(clock_s) <= time.monotonic()
