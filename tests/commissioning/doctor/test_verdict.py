"""Measurements against the tick: every limit from both sides."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from canshaper.commissioning.doctor.measure import Run
from canshaper.commissioning.doctor.verdict import (
    IDLE,
    LOADED,
    Finding,
    Level,
    fit,
    measured_findings,
    waiting,
)
from canshaper.config.schema import Tick
from canshaper.machine.binding import load_deployment
from tests.commissioning.doctor.conftest import SHIPPED, TICK_NS

Make = Callable[..., Run]
DEPLOYMENT = load_deployment(SHIPPED)


def judged(runs: dict[str, Run]) -> dict[str, Finding]:
    return {f.subject: f for f in measured_findings(DEPLOYMENT, runs)}


def tail(part: float, rare: int = 2) -> list[int]:
    """A thousand times, of which so many are this part of the tick."""
    return [50_000] * (1000 - rare) + [round(part * TICK_NS)] * rare


def test_a_good_pc(run: Make) -> None:
    by_subject = judged({IDLE: run(), LOADED: run()})
    note = by_subject.pop("wait for the tick")
    assert {f.level for f in by_subject.values()} == {Level.OK}
    assert (note.level, note.remedy) == (Level.NOTE, "tick: { follow: left }")
    assert note.found == "up to 20 ms, half of that on average; it could be 0.9 ms"

    subjects = ["lateness", "deadlines", "whole tick", "joystick to valve", "axes"]
    assert list(by_subject) == ["scheduling", "memory"] + [
        f"{subject} {name}" for name in (IDLE, LOADED) for subject in subjects
    ]


@pytest.mark.parametrize(
    ("field", "subject", "good"), [("late_ns", "lateness", 0.1), ("tick_ns", "whole tick", 0.25)]
)
@pytest.mark.parametrize("name", [IDLE, LOADED])
def test_parts_of_the_tick(run: Make, name: str, field: str, subject: str, good: float) -> None:
    def level(times: list[int]) -> Level:
        return judged({name: run(**{field: times})})[f"{subject} {name}"].level

    assert level(tail(good)) is Level.OK
    assert level(tail(good + 0.001)) is Level.WARNING
    assert level(tail(0.5)) is Level.WARNING
    assert level(tail(0.501)) is Level.BAD
    assert level(tail(0.501, rare=1)) is Level.OK  # one in a thousand


@pytest.mark.parametrize(
    ("name", "missed", "level"),
    [
        (IDLE, 0, Level.OK),
        (IDLE, 1, Level.BAD),
        (LOADED, 0, Level.OK),
        (LOADED, 1, Level.WARNING),
        (LOADED, 2, Level.BAD),
    ],
)
def test_missed_deadlines(run: Make, name: str, missed: int, level: Level) -> None:
    late = [50_000] * (1000 - 2 * missed) + [21_000_000] * missed
    finding = judged({name: run(missed=missed, late_ns=late)})[f"deadlines {name}"]
    assert finding.level is level
    assert f"{missed} of 1000 missed" in finding.found


def test_remedies_begin_with_the_priority_that_was_not_there(run: Make) -> None:
    late = {"late_ns": tail(0.6), "missed": 3, "tick_ns": tail(0.6)}
    without = judged({IDLE: run(policy="Operation not permitted", **late)})
    with_it = judged({IDLE: run(**late)})
    for subject in ("lateness idle", "deadlines idle", "whole tick idle"):
        assert "measure as root" in without[subject].remedy
        assert "measure as root" not in with_it[subject].remedy
    slow = judged({IDLE: run(tick_ns=[TICK_NS] * 1000)})["whole tick idle"]
    assert "a faster processor" in slow.remedy


def test_what_was_not_permitted(run: Make) -> None:
    findings = judged({IDLE: run(policy="Operation not permitted", memory="no memory")})
    assert findings["scheduling"].level is Level.WARNING
    assert "Operation not permitted" in findings["scheduling"].found
    assert "canshaper@.service" in findings["scheduling"].remedy
    assert findings["memory"].level is Level.WARNING
    assert "no memory" in findings["memory"].found


@pytest.mark.parametrize(
    ("late_ms", "level"), [(20.0, Level.OK), (29.9, Level.OK), (30.1, Level.WARNING)]
)
def test_joystick_to_valve(run: Make, late_ms: float, level: Level) -> None:
    findings = judged({IDLE: run(joystick_ns=[round(late_ms * 1e6)] * 1000)})
    assert findings["joystick to valve idle"].level is level


def test_no_answer_is_not_fit(run: Make) -> None:
    findings = judged({IDLE: run(joystick_ns=[])})
    assert findings["joystick to valve idle"].level is Level.BAD


@pytest.mark.parametrize(
    ("changes", "level", "says"),
    [
        ({"events": [("slew", "TRIPPED", "LOOP_STALLED")]}, Level.BAD, "slew TRIPPED LOOP_STALLED"),
        ({"events": [("lift", "STOPPING", "LOOP_OVERRUN")]}, Level.BAD, "lift STOPPING"),
        (
            {"events": [("lift", "STOPPING", "JOYSTICK_TIMEOUT")] * 2},
            Level.WARNING,
            "lift STOPPING JOYSTICK_TIMEOUT (2)",
        ),
        ({"moved": ["slew", "lift"]}, Level.WARNING, "not in motion: near_far"),
        ({"events": [("slew", "READY", "AT_REST")]}, Level.OK, "all in motion"),
    ],
)
def test_axes_that_stop(run: Make, changes: dict[str, Any], level: Level, says: str) -> None:
    finding = judged({LOADED: run(**changes)})[f"axes {LOADED}"]
    assert finding.level is level
    assert says in finding.found


def test_the_verdict_is_that_of_the_worst() -> None:
    levels = (Level.OK, Level.NOTE, Level.WARNING)
    good = [Finding("x", level, "found") for level in levels]
    assert fit(good)
    assert not fit([*good, Finding("y", Level.BAD, "found")])


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"tick": Tick(follow="right")}, ["ticks follow right, but not in what is measured here"]),
        ({"tick_ms": 19}, []),
    ],
)
def test_ticks_that_follow_already_or_cannot(change: dict[str, Any], expected: list[str]) -> None:
    changed = replace(DEPLOYMENT, config=DEPLOYMENT.config.model_copy(update=change))
    assert [one.found for one in waiting(changed)] == expected
