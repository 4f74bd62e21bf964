"""Does a valve do what it is sent? Its feedback against the commands."""

import pytest

from canshaper.shaping.states import State
from tests.rigs.j1939 import BROADCAST, DM1, Rig, avef, bjm, ids

FOLLOWING = "axis=slew valve=following"
NOT = "axis=slew valve=not-following"
LOST = "axis=slew valve=lost"


@pytest.fixture
def rig() -> Rig:
    return Rig().claimed()


def run(rig: Rig, ticks: int, left: float, opening: float | None, **options: int) -> list[str]:
    """Slew commanded, and a valve that stands so far open; what was reported of it."""
    rig.events.clear()
    for i in range(ticks):
        reported = [] if opening is None or i % 5 else [avef(0, opening, **options)]
        rig.tick(bjm("BJM1", X=left), bjm("BJM2"), *reported)
    return [e.split(" feedback")[0] for e in rig.events if "axis=slew valve" in e]


def test_a_valve_that_follows_is_reported_once(rig: Rig) -> None:
    assert run(rig, 100, 0.0, 0.0) == [FOLLOWING]


@pytest.mark.parametrize("opening", [60.0, -60.0])
def test_a_valve_that_stands_open_without_a_command(rig: Rig, opening: float) -> None:
    run(rig, 50, 0.0, 0.0)
    assert run(rig, 50, 0.0, opening) == [NOT]
    assert rig.fault == "NOT_FOLLOWING"
    assert f"feedback_pct={opening:.0f} command_pct=0" in rig.events[-1]
    assert run(rig, 50, 0.0, 0.0) == [FOLLOWING]


def test_a_valve_that_goes_the_other_way_or_not_at_all(rig: Rig) -> None:
    run(rig, 50, 0.0, 0.0)
    assert run(rig, 150, 100.0, 0.0) == [NOT]
    assert rig.state() is State.ACTIVE  # it is reported, and does not stop the axis
    assert NOT in run(rig, 10, 100.0, -80.0) or run(rig, 50, 100.0, -80.0) == []


def test_a_valve_may_take_its_time_to_settle(rig: Rig) -> None:
    run(rig, 50, 0.0, 0.0)
    assert run(rig, 20, 60.0, 0.0) == []  # 400 ms of 500
    run(rig, 100, 60.0, 60.0)
    assert run(rig, 20, 0.0, 60.0) == []


def test_silence_is_reported_and_the_way_back(rig: Rig) -> None:
    run(rig, 50, 0.0, 0.0)
    assert run(rig, 10, 0.0, None) == []
    assert run(rig, 10, 0.0, None) == [LOST]
    assert rig.fault == "FEEDBACK_LOST"
    assert run(rig, 5, 0.0, 0.0) == [FOLLOWING]


def test_a_valve_that_never_sent_is_reported_after_its_timeout() -> None:
    rig = Rig()
    assert LOST in run(rig, 40, 0.0, None)


@pytest.mark.parametrize("code", [251 - 125, 254 - 125, 255 - 125])
def test_codes_that_are_no_flow_are_silence(rig: Rig, code: int) -> None:
    run(rig, 50, 0.0, 0.0)
    assert run(rig, 30, 0.0, code) == [LOST]
    assert rig.controller.counters.values["InvalidSignals"] > 0


def test_one_valve_from_two_addresses(rig: Rig) -> None:
    run(rig, 50, 0.0, 0.0)
    rig.tick(bjm("BJM1"), bjm("BJM2"), avef(0, 90.0, 0x81))
    assert rig.fault == "SECOND_SENDER"
    assert run(rig, 5, 0.0, 0.0) == []


def test_the_other_nodes_are_informed_which_valve_does_not_follow(rig: Rig) -> None:
    run(rig, 50, 0.0, 0.0)
    for number in (1, 2):
        rig.receive(avef(number, 0.0))
    sent = []
    for i in range(60):
        reported = [avef(n, 60.0 if n == 0 else 0.0) for n in range(3)] if i % 5 == 0 else []
        sent += rig.tick(bjm("BJM1"), bjm("BJM2"), *reported)
    single = [f.data for f in sent if f.can_id == DM1]
    assert single, ids(sent).count(BROADCAST)
    # SPN of the first axis' valve, FMI 7: mechanical system not responding
    assert single[-1][:5] == bytes((0x04, 0xFF, 0x01, 0xF0, 0xE7))


def test_without_an_address_a_valve_that_closes_by_itself_is_following(rig: Rig) -> None:
    run(rig, 50, 0.0, 0.0)
    run(rig, 60, 100.0, None)
    rig.tick(rig.claim(-1))
    assert run(rig, 100, 100.0, 0.0) == [FOLLOWING]
