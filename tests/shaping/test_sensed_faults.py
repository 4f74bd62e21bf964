"""Evidence against a sensor, and the way back to trust: the parts are played."""

import math

import pytest

from canshaper.shaping.states import Trust
from canshaper.shaping.trust import LATCHED, PROVED, PROVED_AGAIN
from tests.shaping.sensed_parts import NOISE, OFFSET, SCALE, Parts, named

# Farthest jump that is none: 1.5 deg, and five times the noise.
JUMP = math.radians(1.5) + 5.0 * NOISE


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> Parts:
    return Parts(monkeypatch)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_jump_is_what_is_farther_than_the_farthest_one(parts: Parts, sign: float) -> None:
    parts.begun()
    parts.observer.error = sign * JUMP
    parts.measure()
    assert parts.sensed.state is Trust.UNPROVED
    parts.observer.error = sign * math.nextafter(JUMP, math.inf)
    parts.measure()
    assert parts.sensed.state is Trust.JUMP


def test_a_jump_counts_from_what_the_last_measurement_left(parts: Parts) -> None:
    parts.begun()
    parts.observer.left = 0.01
    parts.measure()
    parts.observer.error = 0.01 + 0.99 * JUMP
    parts.measure()
    assert parts.sensed.state is Trust.UNPROVED
    parts.observer.error = 0.01 - 1.01 * JUMP
    parts.measure()
    assert parts.sensed.state is Trust.JUMP


@pytest.mark.parametrize("error", [2.0 * JUMP, math.nan])
def test_the_observer_does_not_learn_from_a_jump(parts: Parts, error: float) -> None:
    parts.begun()
    parts.observer.error = error
    calls = parts.measure()
    assert parts.sensed.state is Trust.JUMP
    assert not named(calls, "correct")
    assert not named(calls, "evidence.add")


@pytest.mark.parametrize("proves", [False, True])
def test_it_is_trusted_once_the_evidence_proves_it(parts: Parts, proves: bool) -> None:
    parts.begun()
    parts.evidence.proves = proves
    assert named(parts.measure(), "proved") == [[PROVED]]
    assert parts.sensed.state is (Trust.TRUSTED if proves else Trust.UNPROVED)


def test_it_is_not_trusted_before_the_last_swing_has_faded(parts: Parts) -> None:
    parts.begun()
    parts.evidence.proves = True
    parts.sensed.weight = 0.01  # less than fades in a tick
    parts.measure()
    assert parts.sensed.state is Trust.UNPROVED
    assert parts.sensed.weight == 0.0
    parts.measure()
    assert parts.sensed.state is Trust.TRUSTED


def test_one_that_is_trusted_has_to_be_no_worse_than_another_idea(parts: Parts) -> None:
    parts.begun()
    assert named(parts.measure(), "fault") == [[-PROVED]]
    parts.evidence.proves = True
    parts.measure()
    assert parts.sensed.state is Trust.TRUSTED
    assert named(parts.measure(), "fault") == [[0.0]]


@pytest.mark.parametrize("fault", [Trust.WRONG_SIGN, Trust.CONTACT])
@pytest.mark.parametrize("trusted", [False, True])
def test_a_fault_that_the_evidence_shows_ends_trust(
    parts: Parts, fault: Trust, trusted: bool
) -> None:
    parts = parts.trusted() if trusted else parts.begun()
    parts.evidence.shows = fault
    calls = parts.measure()
    assert parts.sensed.state is fault
    # What speaks for the sensor counts no longer; before trust there is time to prove it still.
    assert len(named(calls, "evidence.clear")) == trusted
    # The observer goes on.
    calls = parts.measure()
    assert named(calls, "errors")
    assert not named(calls, "begin")


@pytest.mark.parametrize("fault", [Trust.STUCK, Trust.CONTACT])
def test_after_a_standstill_the_observer_begins_again(parts: Parts, fault: Trust) -> None:
    parts.trusted()
    parts.standstill.shows = fault
    parts.measure()
    assert parts.sensed.state is fault
    calls = parts.measure()
    assert named(calls, "begin") == [[0.01, SCALE]]
    assert not named(calls, "errors")


@pytest.mark.parametrize(("part", "state"), [(1.0, Trust.UNPROVED), (1.001, Trust.CONTACT)])
def test_a_lasting_error_beyond_two_full_speeds_a_second_is_a_contact(
    parts: Parts, part: float, state: Trust
) -> None:
    parts.begun()
    parts.observer.bends = part * 2.0 * SCALE
    parts.measure()
    assert parts.sensed.state is state


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("part", "state"), [(1.0, Trust.TRUSTED), (1.001, Trust.OFFSET)])
def test_an_offset_may_be_as_large_as_the_largest_one(
    parts: Parts, sign: float, part: float, state: Trust
) -> None:
    parts.begun()
    parts.evidence.proves = True
    parts.observer.free.offset = sign * part * OFFSET
    parts.measure()
    assert parts.sensed.state is state


def needed(parts: Parts, fault: Trust, *, rest: bool) -> float:
    """Evidence that restores trust after a fault, in the same motion or after the tail."""
    parts.evidence.shows = fault
    parts.measure()
    assert parts.sensed.state is fault
    parts.evidence.shows = None
    if rest:
        parts.measure(commanded=False)
    ((least,),) = named(parts.measure(), "proved")
    return least


@pytest.mark.parametrize(
    ("fault", "rest", "least"),
    [
        (Trust.WRONG_SIGN, False, PROVED_AGAIN),
        (Trust.WRONG_SIGN, True, PROVED),
        (Trust.CONTACT, False, PROVED_AGAIN),
        (Trust.CONTACT, True, PROVED_AGAIN),
    ],
)
def test_after_trust_was_lost_it_takes_more_until_rest_and_after_a_contact(
    parts: Parts, fault: Trust, rest: bool, least: float
) -> None:
    assert needed(parts.trusted(), fault, rest=rest) == least


@pytest.mark.parametrize("fault", [Trust.WRONG_SIGN, Trust.CONTACT])
def test_what_was_never_trusted_is_proved_as_before(parts: Parts, fault: Trust) -> None:
    assert needed(parts.begun(), fault, rest=False) == PROVED


def test_rest_in_trust_changes_nothing_of_what_it_takes(parts: Parts) -> None:
    parts.trusted()
    parts.measure(commanded=False)
    assert parts.sensed.state is Trust.TRUSTED
    assert named(parts.measure(), "proved") == [[PROVED]]


@pytest.mark.parametrize("state", LATCHED)
def test_a_latched_fault_stays_through_the_motion(parts: Parts, state: Trust) -> None:
    parts.sensed.state = state
    assert not named(parts.measure(), "begin")
    assert named(parts.measure(commanded=False), "begin")
    assert parts.sensed.state is state
