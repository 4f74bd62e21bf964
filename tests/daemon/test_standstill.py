"""When a loop has stood still: by the time since its last tick, not by deadlines it has missed."""

import re

import pytest

from canshaper.gate import loop
from canshaper.gate.cycle import Standstill, longest_gap_ns
from canshaper.gate.loop import run_at_deadlines
from canshaper.shaping.states import State
from tests.rigs.emergency import DBC, LAST, STOP
from tests.rigs.files import ROOT
from tests.rigs.forwarder import PATIENT
from tests.rigs.standing import MS, Machine, Make

T_MS = 150


@pytest.mark.parametrize("tick_ms", [1, 20, 50])
@pytest.mark.parametrize("over_ms", [0, 1])
def test_a_gap_of_an_age_limit_goes_on_and_one_beyond_it_is_a_standstill(
    changed_rig: Make, tick_ms: int, over_ms: int
) -> None:
    """No matter how many deadlines lie in it."""
    machine = Machine(changed_rig, tick_ms, joysticks_ms=T_MS, valve_ms=600).moving()
    gap_ns = (T_MS + over_ms) * MS
    machine.tick(gap_ns, gap_ns // machine.tick_ns - 1)
    assert (machine.rig.reason() == "LOOP_STALLED") is bool(over_ms)
    assert (machine.commanded() == 0) is bool(over_ms)


@pytest.mark.parametrize("tick_ms", [1, 20, 50])
@pytest.mark.parametrize("period", [1, 3])
@pytest.mark.parametrize("over_ms", [0, 1])
def test_of_a_valve_with_a_slow_message_less_is_left(
    changed_rig: Make, tick_ms: int, period: int, over_ms: int
) -> None:
    """It has waited for all ticks but one of its period when the loop begins to stand still."""
    machine = Machine(changed_rig, tick_ms, period_ticks=period, joysticks_ms=599, valve_ms=600)
    limit_ms = 599 if period == 1 else 600 - 2 * tick_ms
    machine.moving()
    gap_ms = limit_ms + over_ms
    machine.tick(gap_ms * MS, gap_ms // tick_ms - 1)
    for _ in range(period - 1):  # its turn comes
        machine.tick(machine.tick_ns)
    assert (machine.rig.state() is State.TRIPPED) is bool(over_ms)
    assert (machine.commanded() == 0) is bool(over_ms)


def test_an_emergency_stop_has_an_age_limit_too(changed_rig: Make) -> None:
    assert longest_gap_ns(changed_rig(PATIENT).deployment) == 600 * MS
    assert longest_gap_ns(changed_rig({LAST: STOP + LAST}, DBC).deployment) == 60 * MS


def test_the_first_tick_has_none_before_it(changed_rig: Make) -> None:
    machine = Machine(changed_rig, 20, joysticks_ms=100, valve_ms=200)
    assert not machine.standstill.over(10**12)
    machine.tick(10**12)
    assert machine.standstill.over(2 * 10**12)  # there is one before the next


def test_another_deployment_goes_on_from_the_last_tick(changed_rig: Make) -> None:
    deployment = changed_rig().deployment
    before = Standstill(deployment)
    before.last_ns = 500 * MS
    after = Standstill(deployment, before=before)
    assert not after.over(600 * MS)
    assert after.over(600 * MS + 1)


@pytest.mark.parametrize(("held_ms", "trips"), [(80, False), (81, True), (85, True), (120, True)])
def test_a_loop_that_is_held_up_in_its_sleep_trips_by_the_time_that_was(
    changed_rig: Make, monkeypatch: pytest.MonkeyPatch, held_ms: int, trips: bool
) -> None:
    """After a tick at 0 it is stopped just before the one at 20 ms; T is 100 ms."""
    machine = Machine(changed_rig, 20, joysticks_ms=100, valve_ms=200).moving()
    began_ns, calls = machine.now_ns, []

    class Sleeper:
        def sleep(self, seconds: float) -> None:
            machine.now_ns += round(seconds * 1e9) + held_ms * MS

    def body(now_ns: int, missed: int, _late_ns: int) -> bool:
        calls.append(now_ns - began_ns)
        machine.tick(0, missed)
        return len(calls) < 2

    monkeypatch.setattr(loop, "time", Sleeper())
    monkeypatch.setattr(loop, "boottime_ns", lambda: machine.now_ns)
    run_at_deadlines(20 * MS, body)
    assert calls == [0, (20 + held_ms) * MS]
    assert (machine.rig.reason() == "LOOP_STALLED") is trips
    assert (machine.commanded() == 0) is trips


# -- the clock -------------------------------------------------------------------------------------


CLOCKED = ("bus", "inputs", "protocols", "controller", "daemon", "commissioning")


def test_no_loop_has_a_clock_that_stands_still_in_a_suspend() -> None:
    """Times that are compared with that of a tick are of its clock."""
    monotonic = re.compile(r"monotonic_ns\(\)|= time\.monotonic_ns\b")
    own = {"raw.py", "gateway.py", "notify.py"}  # of bus and service manager, which ask themselves
    rooms = [ROOT / "canshaper" / name for name in CLOCKED]
    files = [file for room in rooms for file in room.rglob("*.py")]
    assert {"loop.py", "joysticks.py", "run.py", "daemon.py"} < {file.name for file in files}
    for file in files:
        assert file.name in own or not monotonic.search(file.read_text("utf-8")), file
