"""When a loop has stood still: by the time since its last tick, not by deadlines it has missed."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.can.frame import Frame
from canshaper.service import loop
from canshaper.service.controller import Controller
from canshaper.service.exchange import exchange, take
from canshaper.service.gateway import InLine
from canshaper.service.loop import run_at_deadlines
from canshaper.service.standstill import LEAST_LEAVE_NS, Standstill, longest_gap_ns
from canshaper.shaping.states import State
from tests.service.conftest import ROOT, Rig
from tests.service.emergency import DBC, LAST, STOP
from tests.service.gateway_rig import GatewayRig
from tests.service.test_exchange import PATIENT, Waiting

Make = Callable[..., Rig]
MS = 1_000_000
T_MS = 150


class Machine:
    """The shipped machine at another tick, on a clock of the test's.

    Attributes:
        now_ns: the clock.
        hold_up_ns: the process is held up for so long before the next frame of a valve leaves.
    """

    def __init__(
        self, make: Make, tick_ms: int, *, period_ticks: int = 1, levers_ms: int, valve_ms: int
    ) -> None:
        def cycle(can_id: int, before_ms: int, cycle_ms: int) -> tuple[str, str]:
            name = f"BO_ {can_id} "
            return f"{name}{before_ms};", f"{name}{cycle_ms};"

        levers, valves = (0x110, 0x111), (0x200, 0x201, 0x202)
        dbc = dict(cycle(can_id, 20, tick_ms) for can_id in levers)
        dbc |= dict(cycle(can_id, 20, tick_ms * period_ticks) for can_id in valves)
        yaml = {
            "tick_ms: 20 ": f"tick_ms: {tick_ms} ",
            "timeout_ms: 100 #": f"timeout_ms: {levers_ms} #",
            "timeout_ms: 100\n": f"timeout_ms: {levers_ms}\n",
            "timeout_ms: 600": f"timeout_ms: {valve_ms}",
        }
        self.rig = make(yaml, dbc)
        self.tick_ns, self.period = tick_ms * MS, period_ticks
        self.now_ns = self.hold_up_ns = self.slew = 0
        self.standstill = Standstill(self.rig.deployment)
        self.standstill.clock = self._clock
        self.port = Waiting()

    def _clock(self) -> int:
        self.now_ns += self.hold_up_ns
        self.hold_up_ns = 0
        return self.now_ns

    def tick(self, gap_ns: int, missed: int = 0) -> None:
        """One tick so long after the one before, with both joysticks out."""
        self.now_ns += gap_ns
        self.port.queue = [self.rig.lever(Slew=self.slew), self.rig.lever("LeverRight")]
        exchange(self.rig.controller, {"crane": self.port}, self.now_ns, missed, self.standstill)

    def moving(self) -> "Machine":
        for slew, ticks in ((0, 3), (900, round(1e9 / self.tick_ns))):
            self.slew = slew
            for _ in range(ticks * self.period):
                self.tick(self.tick_ns)
        assert self.told() > 50
        return self

    def told(self) -> int:
        """Velocity in the last frame of the slew valve."""
        return next(f.data[0] for f in reversed(self.port.sent) if f.can_id == 0x200)


@pytest.mark.parametrize("tick_ms", [1, 20, 50])
@pytest.mark.parametrize("over_ms", [0, 1])
def test_a_gap_of_an_age_limit_goes_on_and_one_beyond_it_is_a_standstill(
    changed_rig: Make, tick_ms: int, over_ms: int
) -> None:
    """No matter how many deadlines lie in it."""
    machine = Machine(changed_rig, tick_ms, levers_ms=T_MS, valve_ms=600).moving()
    gap_ns = (T_MS + over_ms) * MS
    machine.tick(gap_ns, gap_ns // machine.tick_ns - 1)
    assert (machine.rig.reason() == "LOOP_STALLED") is bool(over_ms)
    assert (machine.told() == 0) is bool(over_ms)


@pytest.mark.parametrize("tick_ms", [1, 20, 50])
@pytest.mark.parametrize("period", [1, 3])
@pytest.mark.parametrize("over_ms", [0, 1])
def test_of_a_valve_with_a_slow_message_less_is_left(
    changed_rig: Make, tick_ms: int, period: int, over_ms: int
) -> None:
    """It has waited for all ticks but one of its period when the loop begins to stand still."""
    machine = Machine(changed_rig, tick_ms, period_ticks=period, levers_ms=599, valve_ms=600)
    limit_ms = 599 if period == 1 else 600 - 2 * tick_ms
    machine.moving()
    gap_ms = limit_ms + over_ms
    machine.tick(gap_ms * MS, gap_ms // tick_ms - 1)
    for _ in range(period - 1):  # its turn comes
        machine.tick(machine.tick_ns)
    assert (machine.rig.state() is State.TRIPPED) is bool(over_ms)
    assert (machine.told() == 0) is bool(over_ms)


def test_an_emergency_stop_has_an_age_limit_too(changed_rig: Make) -> None:
    assert longest_gap_ns(changed_rig(PATIENT).deployment) == 600 * MS
    assert longest_gap_ns(changed_rig({LAST: STOP + LAST}, DBC).deployment) == 60 * MS


def test_the_first_tick_has_none_before_it(changed_rig: Make) -> None:
    machine = Machine(changed_rig, 20, levers_ms=100, valve_ms=200)
    machine.slew = 0
    machine.tick(10**12)
    assert not machine.rig.controller.axes["slew"].lost


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
    machine = Machine(changed_rig, 20, levers_ms=100, valve_ms=200).moving()
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
    assert (machine.told() == 0) is trips


# -- between the last look at the clock and the socket ---------------------------------------------


@pytest.mark.parametrize(("held_ms", "leaves"), [(20, True), (21, False), (80, False)])
def test_a_frame_from_before_a_stop_does_not_leave_after_it(
    changed_rig: Make, held_ms: int, leaves: bool
) -> None:
    """The process is stopped between computing and sending, for more than a tick."""
    machine = Machine(changed_rig, 20, levers_ms=100, valve_ms=200).moving()
    before = len(valves(machine.port))
    machine.hold_up_ns = held_ms * MS
    machine.tick(20 * MS)
    slew = [f for f in valves(machine.port)[before:] if f.can_id == 0x200]
    assert len(slew) == leaves
    last_ns = machine.now_ns - held_ms * MS
    assert machine.standstill.last_ns == (last_ns if leaves else last_ns - 20 * MS)
    # The other valves are in neutral: theirs leave at any time.
    assert machine.port.sent[-1].can_id != 0x200


@pytest.mark.parametrize(("held_ms", "trips"), [(80, False), (81, True), (3_600_000, True)])
def test_the_tick_after_such_a_stop_sees_how_long_the_valve_has_waited(
    changed_rig: Make, held_ms: int, trips: bool
) -> None:
    """From the last tick whose frames all left; also where the machine was suspended meanwhile."""
    machine = Machine(changed_rig, 20, levers_ms=100, valve_ms=200).moving()
    machine.hold_up_ns = held_ms * MS
    machine.tick(20 * MS)
    machine.tick(0, 3)
    assert (machine.rig.reason() == "LOOP_STALLED") is trips
    assert (machine.told() == 0) is trips


def test_neutral_leaves_at_any_time_and_asks_for_no_clock(changed_rig: Make) -> None:
    machine = Machine(changed_rig, 20, levers_ms=100, valve_ms=200)
    machine.slew = 0

    def never() -> int:
        raise AssertionError("a clock is read for a frame that moves nothing")

    machine.standstill.clock = never
    for _ in range(10):
        machine.tick(20 * MS)
    assert len(valves(machine.port)) == 30


def test_a_moving_frame_asks_once(changed_rig: Make) -> None:
    """Status and the frames of the service ask for none."""
    machine = Machine(changed_rig, 20, levers_ms=100, valve_ms=200).moving()
    asked = []
    machine.standstill.clock = lambda: asked.append(1) or machine.now_ns  # type: ignore[func-returns-value]
    before = len(valves(machine.port))
    for _ in range(30):
        machine.tick(20 * MS)
    assert len(asked) <= len(valves(machine.port)) - before


def test_a_short_tick_leaves_some_milliseconds(changed_rig: Make) -> None:
    machine = Machine(changed_rig, 1, levers_ms=100, valve_ms=200).moving()
    for held_ns, leaves in ((LEAST_LEAVE_NS, 1), (LEAST_LEAVE_NS + 1, 0)):
        before = len([f for f in machine.port.sent if f.can_id == 0x200])
        machine.hold_up_ns = held_ns
        machine.tick(MS)
        assert len([f for f in machine.port.sent if f.can_id == 0x200]) == before + leaves


def test_a_late_tick_has_less_time_to_send(changed_rig: Make) -> None:
    """95 ms after the one before, and T is 100 ms: 5 ms are left."""
    machine = Machine(changed_rig, 20, levers_ms=100, valve_ms=200).moving()
    for held_ms, leaves in ((5, 1), (6, 0)):
        before = len([f for f in machine.port.sent if f.can_id == 0x200])
        machine.hold_up_ns = held_ms * MS
        machine.standstill.last_ns = machine.now_ns
        machine.tick(95 * MS, 3)
        assert len([f for f in machine.port.sent if f.can_id == 0x200]) == before + leaves


def valves(port: Waiting) -> list[Frame]:
    return [f for f in port.sent if 0x200 <= f.can_id <= 0x202]


# -- in a gateway ----------------------------------------------------------------------------------


class InGateway:
    """A gateway in motion, whose clock jumps after a joystick frame was taken."""

    def __init__(self, folder: Path, slew: int = 1000) -> None:
        self.rig = GatewayRig(folder, yaml=(("interface: socketcan", "interface: virtual"),))
        self.slew = slew
        if slew:
            self.rig.moving()
        else:
            self.rig.run(5)
        self.levers, self.machine = Waiting(), Waiting()
        self.ports = {"levers": self.levers, "machine": self.machine}
        self.standstill = Standstill(self.rig.deployment)
        self.last_ns = self.rig.now_ns - 20 * MS
        self.standstill.last_ns = self.last_ns
        self.now_ns = self.last_ns

    def taken(self, after_ms: int, held_ms: int) -> int:
        """Frames that leave of one that is taken so long after the tick, when it is held up."""
        self.now_ns = self.last_ns + after_ms * MS
        self.standstill.clock = lambda: self.now_ns + held_ms * MS
        self.levers.queue = [self.rig.lever(Slew=self.slew)]
        assert not self.standstill.over(self.now_ns)
        take(self.rig.controller, self.ports, self.now_ns, self.standstill)
        assert self.levers.queue == []
        return len(self.machine.sent)


@pytest.mark.parametrize(
    ("after_ms", "held_ms", "leaves"),
    [(10, 0, 1), (10, 20, 1), (10, 21, 0), (95, 5, 1), (95, 6, 0)],
)
def test_a_joystick_frame_with_velocities_from_before_a_stop_does_not_pass_after_it(
    tmp_path: Path, after_ms: int, held_ms: int, leaves: int
) -> None:
    assert InGateway(tmp_path).taken(after_ms, held_ms) == leaves


def test_a_joystick_frame_without_motion_passes_at_any_time(tmp_path: Path) -> None:
    assert InGateway(tmp_path, slew=0).taken(10, 90) == 1


def test_after_a_stop_in_a_gateway_its_axes_trip_and_neutral_leaves(tmp_path: Path) -> None:
    gateway = InGateway(tmp_path)
    assert gateway.taken(10, 91) == 0
    gateway.now_ns += 91 * MS
    gateway.standstill.clock = lambda: gateway.now_ns
    controller: Controller = gateway.rig.controller
    exchange(controller, gateway.ports, gateway.now_ns, 3, gateway.standstill)
    (own,) = (f for f in gateway.machine.sent if f.can_id == 0x110)
    values = gateway.rig.decoded(own)
    assert (values["Slew"], values["Enable"]) == (0, 0)
    assert controller.axes["slew"].axis.reason.name == "LOOP_STALLED"


def test_between_two_ticks_of_a_gateway_a_standstill_is_left_to_the_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gateway = InGateway(tmp_path)
    gateway.levers.queue = [gateway.rig.lever(Slew=1000)]
    times = iter((0, 0, 101 * MS))
    gateway.standstill.clock = lambda: gateway.last_ns + next(times)
    monkeypatch.setattr("canshaper.service.gateway.select.select", lambda *_: ([1], [], []))
    line = InLine(gateway.rig.deployment, lambda _fault: None)
    line.wait(0.2, gateway.rig.controller, gateway.ports, gateway.standstill)
    assert len(gateway.levers.queue) == 1
    assert gateway.machine.sent == []


# -- the clock -------------------------------------------------------------------------------------


def test_no_loop_has_a_clock_that_stands_still_in_a_suspend() -> None:
    """What is compared with the time of a tick has to be of the same clock."""
    monotonic = re.compile(r"monotonic_ns\(\)|= time\.monotonic_ns\b")
    own = {"raw.py", "gateway.py", "notify.py"}  # of bus and service manager, which ask themselves
    for room in ("service", "doctor", "calibration", "can"):
        for file in (ROOT / "canshaper" / room).glob("*.py"):
            assert file.name in own or not monotonic.search(file.read_text("utf-8")), file
