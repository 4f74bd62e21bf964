"""Calls of a sensed sway to its parts, and its use of their answers."""

import pytest

from canshaper.shaping.states import Trust
from canshaper.shaping.sway import SwayMode, SwayModel, swing_over
from tests.shaping.sensed_parts import (
    FULL_SPEED_M_S,
    LOST_S,
    SCALE,
    TICK_S,
    Parts,
    named,
)
from tests.shaping.sensed_rig import MODE as RIG_MODE
from tests.shaping.sensed_rig import SCALE as RIG_SCALE
from tests.shaping.sensed_rig import TICK_S as RIG_TICK_S
from tests.shaping.sensed_rig import Rig


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> Parts:
    return Parts(monkeypatch)


def test_nothing_is_fed_back_before_the_first_measurement(parts: Parts) -> None:
    assert parts.sensed.weight == 0.0
    parts.measure(None)
    assert parts.sensed.weight == 0.0
    assert (parts.sway.free_angle, parts.sway.free_rate) == (0.0, 0.0)


@pytest.mark.parametrize(("second", "most"), [(None, 1.0), (SwayMode(9.0, 0.05), 0.75)])
def test_next_to_a_second_mode_not_all_of_the_swing_is_fed_back(
    monkeypatch: pytest.MonkeyPatch, second: SwayMode | None, most: float
) -> None:
    parts = Parts(monkeypatch, second).trusted()
    for _ in range(60):
        parts.measure()
    assert parts.sensed.weight == most


def test_the_model_gets_the_swing_by_weight_and_scale(parts: Parts) -> None:
    parts.trusted()
    parts.observer.free.angle, parts.observer.free.rate = 0.03, -0.2
    parts.sensed.weight = 0.5 - TICK_S / 0.6
    parts.measure()
    assert parts.sensed.weight == pytest.approx(0.5)
    free = (parts.sway.free_angle, parts.sway.free_rate)
    assert free == pytest.approx((0.5 * 0.03 / SCALE, 0.5 * -0.2 / SCALE))


@pytest.mark.parametrize(("state", "fade_s"), [(Trust.CONTACT, 0.1), (Trust.WRONG_SIGN, 0.6)])
def test_at_a_contact_the_swing_fades_faster(parts: Parts, state: Trust, fade_s: float) -> None:
    parts.begun()
    parts.sensed.state, parts.sensed.weight = state, 1.0
    parts.measure(None)
    assert parts.sensed.weight == pytest.approx(1.0 - TICK_S / fade_s)


def test_after_a_loss_the_swing_swings_on_by_the_mode() -> None:
    rig = Rig().trusted()
    rig.real.angle += 0.03
    rig.run(0.3)

    def swing() -> tuple[float, float]:
        part = RIG_SCALE / rig.sensed.weight
        return rig.model.free_angle * part, rig.model.free_rate * part

    rig.run(0.12, None)
    assert rig.sensed.state is Trust.LOST
    angle, rate = swing()
    ticks = 10
    rig.run(ticks * RIG_TICK_S, None)
    by = swing_over(RIG_MODE, ticks * RIG_TICK_S)
    expected = angle + by[0] * angle + by[1] * rate, rate + by[2] * angle + by[3] * rate
    assert swing() == pytest.approx(expected, rel=1e-9)
    assert abs(expected[0] - angle) > 1e-3


def test_without_weight_nothing_has_to_swing_on(parts: Parts) -> None:
    parts.begun()
    assert not named(parts.step(), "swing")


def test_a_length_is_estimated_from_the_speed_of_the_tip(parts: Parts) -> None:
    parts.begun()
    parts.observer.late.speed = 0.5
    parts.observer.free.offset = 0.004
    (seen,) = named(parts.measure(0.02), "length")
    assert seen == [0.02, 0.004, pytest.approx(0.5 * FULL_SPEED_M_S), True, True]
    (seen,) = named(parts.measure(-0.02, commanded=False), "length")
    assert seen == [-0.02, 0.004, pytest.approx(0.5 * FULL_SPEED_M_S), False, True]


def test_after_a_retune_observer_and_speed_are_those_of_the_new_mode(parts: Parts) -> None:
    parts.begun()
    parts.observer.late.speed = 0.5
    other = SwayModel(SwayMode(2.4, 0.05), TICK_S)
    parts.calls.clear()
    parts.sensed.retune(other)
    assert named(parts.calls, "retune") == [[other]]
    # Of a mode that swings so much less at a speed, the same swing is so much more speed.
    ((_, _, speed_m_s, *_),) = named(parts.measure(), "length")
    assert speed_m_s == pytest.approx(0.5 * FULL_SPEED_M_S * (2.86 / 2.4) ** 2)


@pytest.mark.parametrize(
    ("state", "free"),
    [(Trust.UNPROVED, True), (Trust.TRUSTED, True), (Trust.CONTACT, False), (Trust.STUCK, False)],
)
def test_a_length_counts_only_of_a_grapple_that_hangs_free(
    parts: Parts, state: Trust, free: bool
) -> None:
    parts.begun()
    parts.sensed.state = state
    ((*_, seen),) = named(parts.measure(), "length")
    assert seen is free


def test_a_sensor_is_lost_once_the_time_is_over(parts: Parts) -> None:
    parts.begun()
    ticks = round(LOST_S / TICK_S)
    for _ in range(ticks):
        parts.step()
    parts.measure(None)
    assert parts.sensed.state is Trust.UNPROVED
    parts.step()
    parts.measure(None)
    assert parts.sensed.state is Trust.LOST


def test_before_the_first_measurement_that_time_begins_with_the_program(parts: Parts) -> None:
    parts.sensed.restart()
    parts.measure(None)
    assert parts.sensed.state is not Trust.LOST


@pytest.mark.parametrize(
    ("commanded", "damps", "weight", "compared"),
    [
        (True, False, 0.0, True),
        (False, False, 0.5, False),
        (False, True, 0.0, False),
        (False, True, 0.5, True),
        (False, True, 1.0, True),
    ],
)
def test_only_motion_of_the_axis_or_damping_says_something_about_the_sensor(
    parts: Parts, commanded: bool, damps: bool, weight: float, compared: bool
) -> None:
    parts.begun()
    parts.sensed.weight = weight
    calls = parts.measure(commanded=commanded, damps=damps)
    assert len(named(calls, "evidence.add")) == len(named(calls, "check")) == compared
    # A standstill counts within one motion only.
    assert len(named(calls, "standstill.clear")) == (not compared)
    assert len(named(calls, "correct")) == 1


def test_what_another_axis_has_shown_is_no_proof_without_it(parts: Parts) -> None:
    parts.begun()
    assert named(parts.measure(commanded=False, damps=True, other=0.1), "evidence.add")
    calls = parts.measure()
    assert calls.index(("evidence.clear",)) < calls.index(("evidence.add", (0.0, 0.0, 0.0, 0.0)))
    assert not named(parts.measure(), "evidence.clear")
    parts.measure(commanded=False, damps=True, other=0.1)
    parts.sensed.state = Trust.TRUSTED  # and what has proved it counts on
    assert not named(parts.measure(), "evidence.clear")


def test_one_that_is_doubted_is_not_proved_by_another_axis(parts: Parts) -> None:
    parts.begun()
    parts.evidence.shows = Trust.CONTACT
    parts.measure()
    assert not named(parts.measure(commanded=False, damps=True, other=0.1), "evidence.add")


def test_by_default_an_axis_that_is_not_commanded_does_not_damp(parts: Parts) -> None:
    parts.begun()
    parts.sensed.weight = 0.5
    parts.calls.clear()
    parts.sensed.measure(0.01, SCALE, commanded=False)
    assert not named(parts.calls, "evidence.add")


def test_a_step_adds_nothing_by_default(parts: Parts) -> None:
    assert named(parts.step(0.3, 0.4), "step") == [[0.3, 0.0]]
    parts.calls.clear()
    parts.sensed.step(0.3, 0.4, 0.1)
    assert named(parts.calls, "step") == [[0.3, 0.1]]


@pytest.mark.parametrize(
    ("command", "active"), [(0.0, False), (0.3, True), (-0.3, True), (1.0, True)]
)
def test_a_standstill_is_judged_by_the_command_of_the_tick_before(
    parts: Parts, command: float, active: bool
) -> None:
    parts.begun()
    parts.step(0.5, command)
    assert named(parts.measure(), "check") == [[active]]


@pytest.mark.parametrize(("commanded", "own"), [(True, 0.7), (False, 0.0)])
def test_what_another_axis_makes_this_one_do_is_not_restless(
    parts: Parts, commanded: bool, own: float
) -> None:
    parts.measure(commanded=commanded)
    assert named(parts.step(0.7, 0.2), "moved") == [[own, 0.2]]


def test_a_restless_one_begins_again_at_rest(parts: Parts) -> None:
    parts.trusted()
    parts.restlessness.shows = True
    parts.step()
    assert parts.sensed.state is Trust.RESTLESS
    calls = parts.measure()
    assert not named(calls, "errors")
    assert not named(calls, "begin")
    assert named(parts.measure(commanded=False), "begin") == [[0.01, SCALE]]


def test_after_a_restart_the_observer_begins_again(parts: Parts) -> None:
    parts.trusted()
    parts.sensed.weight = 0.5
    parts.sway.free_angle = parts.sway.free_rate = 0.1
    parts.calls.clear()
    parts.sensed.restart()
    assert parts.calls[0] == ("restart",)
    assert parts.sensed.weight == parts.sway.free_angle == parts.sway.free_rate == 0.0
    calls = parts.measure()
    assert named(calls, "begin") == [[0.01, SCALE]]
    assert not named(calls, "errors")


def test_with_the_first_measurement_all_begins_again(parts: Parts) -> None:
    calls = parts.measure(commanded=False)
    assert [name for name, *_ in calls] == ["begin", "evidence.clear", "standstill.clear"]
