"""Rehearsed faults: the reaction of the table, and no move that the joystick did not ask for."""

import random
from collections.abc import Callable

import pytest

from canshaper.commissioning.procedure import rehearsed as procedure
from canshaper.commissioning.procedure.rehearsed import GOOD, NEVER, UNDONE, Row, reaction_of
from canshaper.config.bus import REDUCED_PCT
from canshaper.daemon.rehearsal import fault, rehearsal
from canshaper.daemon.rehearsal.fault import no_more, takes_back
from canshaper.machine.binding import load_deployment
from tests.faults.judge import Violation
from tests.faults.rehearsed import HALF, Hand, Rehearsed, faults_of, held, slow_file
from tests.faults.shipped import NAMES
from tools import reactions

# Each kind once, where it is quick.
QUICK = {
    "forwarder": (
        ("silent:left", "wrong_length:left"),
        ("old_stamp:right", "frozen_counter:right", "jumping_counter:right"),
        ("one_wrong_frame:left", "frames_lost:left"),
        ("joystick_error:right", "joystick_out_of_range:right"),
        ("enable_off:left", "enable_invalid:right", "second_sender:slew"),
        ("not_sent:crane", "bus_off:crane", "error_frame:crane"),
        ("late_tick:loop", "late_ticks:loop"),
        ("standstill:loop",),
    ),
    "j1939-forwarder": (
        ("second_joystick:left", "joystick_contradictory:right"),
        ("feedback_silent:lift",),
        ("feedback_neutral:lift",),
        ("bus_back:crane", "address_taken:crane"),
    ),
    "canopen-forwarder": (
        ("emergency:slew",),
        ("heartbeat_silent:left",),
        ("status_silent:slew",),
        ("status_silent_at_rest:slew",),
        ("second_node:crane",),
    ),
    "gateway-forwarder": (("silent:right", "not_sent:machine"),),
    "canfd-forwarder": (("wrong_checksum:left",), ("frozen_counter:left", "jumping_counter:right")),
    "remote-forwarder": (("pressed:emergency_stop", "silent:emergency_stop"),),
    "ecu-forwarder": (("switch_off:seat",),),
    "forwarder-sensor": (("sensor_silent:slew",),),
}
CASES = [(name, faults) for name, several in QUICK.items() for faults in several]


def of(name: str, faults: tuple[str, ...]) -> list[str]:
    """Those of them that the machine can have."""
    return [one for one in faults if one in faults_of(name)]


def rehearsed(name: str, faults: list[str], hand: Hand = held, seed: int = 1) -> list[Row]:
    run = Rehearsed(name, faults, hand, seed)
    run.run()
    return run.verdicts()


@pytest.mark.parametrize(("name", "faults"), CASES, ids=[f"{n}: {f[0]}" for n, f in CASES])
def test_a_rehearsed_fault_has_its_reaction(name: str, faults: tuple[str, ...]) -> None:
    for one in rehearsed(name, of(name, faults)):
        assert one["verdict"] == GOOD, one


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_fault_of_every_machine_has_its_reaction(name: str) -> None:
    wrong = [one for one in rehearsed(name, list(faults_of(name))) if one["verdict"] != GOOD]
    assert not wrong


def test_every_row_is_rehearsed_somewhere_or_says_why_not() -> None:
    made = {one.claim for name in NAMES for one in faults_of(name).values()}
    claims = {claim for row in reactions.ROWS for claim in row.ids.split(", ")}
    assert made.isdisjoint(NEVER)
    assert claims - made == NEVER.keys() | {"JOYSTICK_NOT_A_NUMBER"}  # no shipped one has a float
    here = procedure.refused(load_deployment(slow_file("forwarder")))
    assert here["R3"] == NEVER["R3"]
    assert here["VALVE_FAULT"] == "no part of this machine can have it"


def test_a_rehearsal_expects_what_the_page_says() -> None:
    rows = [line.split(" | ") for line in reactions.reaction_rows()][2:]
    said = {claim: row[2] for row in rows for claim in row[0].removeprefix("| ").split(", ")}
    made = {one.claim for name in NAMES for one in faults_of(name).values()}
    assert {claim: reaction_of(claim) for claim in made} == {one: said[one] for one in made}


# -- what the person does -------------------------------------------------------------------------


def let_go(after_s: float, deflection: float = 0.0) -> Hand:
    """Hold every joystick, and let go, or pull to the other side, so long after it was made."""

    def hand(run: Rehearsed, _since_s: float) -> tuple[int, int, float]:
        phase, now_s = run.report["phase"], run.world.now_ns / 1e9
        if phase == "made" and run.made_s is None:
            run.made_s = now_s
        gone = run.made_s is not None and now_s >= run.made_s + after_s
        return 1, 0, HALF if not gone else deflection * (phase == "made")

    return hand


FAULTS = (
    *("silent:right", "frozen:right", "frozen_counter:right", "jumping_counter:right"),
    *("one_wrong_frame:right", "standstill:loop"),
)


@pytest.mark.parametrize("name", FAULTS)
def test_who_lets_go_ends_the_fault(name: str) -> None:
    run = Rehearsed("forwarder", [name], let_go(0.06))
    run.run()
    assert run.report["why"] == "the joystick was let go, or something was released"


@pytest.mark.parametrize("name", FAULTS)
def test_the_other_direction_ends_the_fault_too(name: str) -> None:
    Rehearsed("forwarder", [name], let_go(0.04, -HALF)).run()


def test_the_judge_sees_a_fault_that_hides_a_release(monkeypatch: pytest.MonkeyPatch) -> None:
    def released(run: Rehearsed, _since_s: float) -> tuple[int, int, float]:
        return int(run.report["phase"] != "made"), 0, HALF

    Rehearsed("forwarder", ["silent:right"], released).run()
    monkeypatch.setattr(rehearsal, "takes_back", lambda *_: False)
    with pytest.raises(Violation):
        Rehearsed("forwarder", ["silent:right"], released).run()


def test_what_is_let_go_in_a_frame_that_does_not_count_trips(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = Rehearsed("forwarder", ["frozen_counter:right"], let_go(0.04, -HALF))
    run.run()
    assert ["TRIPPED", "LOOP_STALLED"] in [event[2:] for event in run.report["events"]]
    monkeypatch.setattr(rehearsal.Rehearsal, "_holds_more", lambda *_: False)
    with pytest.raises(Violation):
        Rehearsed("forwarder", ["frozen_counter:right"], let_go(0.04, -HALF)).run()


def test_the_judge_sees_a_fault_that_asks_for_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rehearsal, "takes_back", lambda *_: False)
    Rehearsed("forwarder", ["frozen:right"], let_go(0.06)).run()
    for module in (rehearsal, fault):
        monkeypatch.setattr(module, "no_more", lambda *_: True)
    with pytest.raises(Violation):
        Rehearsed("forwarder", ["frozen:right"], let_go(0.06)).run()


def test_a_frame_that_asks_for_more_is_never_handed_on() -> None:
    real = {"a": 0.5, "b": -0.5, "on": 0.0}
    assert no_more({"a": 0.5, "b": -0.2, "on": 0.0}, real)
    assert no_more({}, real)
    for wrong in ({"a": 0.51}, {"a": -0.1}, {"b": -0.6}, {"b": 0.1}, {"on": 1.0}):
        assert not no_more(wrong, real)
    applied = {"a": 0.5, "on": 1.0}
    assert not takes_back({"a": 0.46, "b": 1.0, "on": 1.0}, applied)
    for less in ({"a": 0.44}, {"a": 0.0}, {"a": -1.0}, {"on": 0.0}):
        assert takes_back(less, applied)
    assert takes_back({"a": 0.0}, {"a": 0.04})  # into the neutral band


def anyhow(seed: int) -> Hand:
    """An operator who does anything, and lets his enable go now and then."""
    rng = random.Random(seed)
    state = {"until_s": 0.0, "hand": (1, 0, 0.0)}

    def hand(_run: Rehearsed, since_s: float) -> tuple[int, int, float]:
        if since_s < 1.2:
            return 1, 0, HALF if since_s > 0.1 else 0.0
        if since_s >= state["until_s"] or state["until_s"] > since_s + 1:
            state["until_s"] = since_s + rng.choice((0.02, 0.06, 0.2, 0.6))
            deflection = rng.choice((0.0, HALF, HALF, -HALF, 1.0, rng.uniform(-1, 1)))
            state["hand"] = (int(rng.random() < 0.9), 0, deflection)
        return state["hand"]

    return hand


@pytest.mark.parametrize("seed", range(2))
def test_no_operator_is_moved_otherwise_than_he_asks(seed: int) -> None:
    faults = of("forwarder", ("silent:right", "joystick_error:left", "standstill:loop"))
    rehearsed("forwarder", faults, anyhow(seed), seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", NAMES)
def test_no_operator_of_any_machine_is(name: str, seed: int) -> None:
    faults = [one for one in faults_of(name) if not one.startswith("address_taken")]
    rehearsed(name, faults, anyhow(seed), seed)


# -- its right, and its end -----------------------------------------------------------------------


def asked(act: Callable[[Rehearsed], None], fault: str = "silent:right") -> Rehearsed:
    """A rehearsal in which something is done once while it is made."""
    done: list[bool] = []

    def hand(run: Rehearsed, since_s: float) -> tuple[int, int, float]:
        if run.report["phase"] == "made" and not done:
            done.append(True)
            act(run)
        return held(run, since_s)

    run = Rehearsed("forwarder", [fault], hand)
    run.run()
    assert done
    return run


def test_there_is_one_fault_at_a_time_and_none_in_motion() -> None:
    said: list[str] = []
    asked(lambda run: said.append(run.refusal("silent:left")), "late_tick:loop")
    assert said == ["expected one fault at a time, late_tick:loop is not over"]
    said.clear()

    def moving(run: Rehearsed, since_s: float) -> tuple[int, int, float]:
        if run.report["phase"] == "over":  # and the axes go on moving
            run.report = dict(run.ask("report"))
        return 1, 0, HALF

    run = Rehearsed("forwarder", ["late_tick:loop", "silent:left"], moving)
    run.settles = False
    run.run()
    assert run.refused == "expected every axis at rest, slew is ACTIVE: let go first"


def test_an_unknown_fault_is_refused_and_so_is_full_speed() -> None:
    said: list[str] = []
    run = asked(lambda run: said.append(run.refusal("nonsense")))
    assert said[0].startswith("expected one of silent:left, ")
    assert said[0].endswith("got 'nonsense'")
    assert run.report["phase"] == "done"


def test_no_fault_at_more_than_reduced_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rehearsal, "REDUCED_PCT", REDUCED_PCT - 1)
    run = Rehearsed("forwarder", ["silent:left"])
    assert not run.run()
    assert run.refused.startswith("axes.slew.limits: expected max_pct up to 39, got 40")


def gone(run: Rehearsed) -> None:
    run.present = False


@pytest.mark.parametrize(
    ("act", "fault", "why"),
    [
        (lambda run: run.ask("end"), "error_frame:crane", "ended by its client"),
        (gone, "frozen:right", "its client is gone"),
    ],
)
def test_a_fault_ends_with_its_client_and_what_moves_trips(
    act: Callable[[Rehearsed], None], fault: str, why: str
) -> None:
    run = asked(act, fault)
    assert run.report["why"] == why
    assert {event[3] for event in run.report["events"]} == {"LOOP_STALLED"}
    assert run.report["neutral_ms"] is not None


def test_a_fault_does_not_wait_for_its_axis_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rehearsal, "ARMED_NS", 10**9)
    run = Rehearsed("forwarder", ["silent:left"], lambda *_: (1, 0, 0.0))
    run.run()
    (one,) = run.verdicts()
    assert (one["verdict"], one["happened"]) == (UNDONE, "its axis was not moved")


def test_an_emergency_that_is_real_outlives_the_rehearsed_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its client does not report the end."""
    monkeypatch.setattr(rehearsal, "ARMED_NS", 2 * 10**9)

    def hand(run: Rehearsed, since_s: float) -> tuple[int, int, float]:
        if run.report["phase"] == "made" and run.made_s is None:
            run.made_s = since_s
            for node in run.world.nodes.values():
                node.emergency(0x8003, 0x81)
        return held(run, since_s)

    first, second = rehearsed("canopen-forwarder", ["emergency:slew", "second_sender:slew"], hand)
    assert first["verdict"] == GOOD
    assert (second["verdict"], second["happened"]) == (UNDONE, "its axis was not moved")
