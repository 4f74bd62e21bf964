"""Nothing lies between the last look at the clock and the socket: late frames do not leave."""

from pathlib import Path

import pytest

from canshaper.controller.controller import Controller
from canshaper.daemon.gateway import InlineGateway
from canshaper.gate.cycle import LEAST_LEAVE_NS, Standstill, io_cycle, receive_waiting
from tests.rigs.gateway import GatewayRig
from tests.rigs.standing import MS, Machine, Make, valves
from tests.rigs.waiting import Waiting


@pytest.mark.parametrize(("held_ms", "leaves"), [(20, True), (21, False), (80, False)])
def test_a_frame_from_before_a_stop_does_not_leave_after_it(
    changed_rig: Make, held_ms: int, leaves: bool
) -> None:
    """The process is stopped between computing and sending, for more than a tick."""
    machine = Machine(changed_rig, 20, joysticks_ms=100, valve_ms=200).moving()
    before = len(valves(machine.port))
    machine.hold_up_ns = held_ms * MS
    machine.tick(20 * MS)
    slew = [f for f in valves(machine.port)[before:] if f.can_id == 0x200]
    assert len(slew) == leaves
    last_ns = machine.now_ns - held_ms * MS
    assert machine.standstill.last_ns == (last_ns if leaves else last_ns - 20 * MS)
    # The other valves are in neutral: theirs leave at any time.
    assert len(valves(machine.port)[before:]) == 2 + leaves


def test_the_receiver_sees_no_gap_in_the_counter(changed_rig: Make) -> None:
    machine = Machine(changed_rig, 20, joysticks_ms=100, valve_ms=200).moving()
    machine.hold_up_ns = 30 * MS
    machine.tick(20 * MS)
    machine.tick(0, 1)
    counts = [f.data[1] for f in machine.port.sent if f.can_id == 0x200]
    assert counts == [n % 256 for n in range(1, len(counts) + 1)]


@pytest.mark.parametrize(("held_ms", "trips"), [(80, False), (81, True), (3_600_000, True)])
def test_the_tick_after_such_a_stop_sees_how_long_the_valve_has_waited(
    changed_rig: Make, held_ms: int, trips: bool
) -> None:
    """From the last tick whose frames all left; also where the machine was suspended meanwhile."""
    machine = Machine(changed_rig, 20, joysticks_ms=100, valve_ms=200).moving()
    machine.hold_up_ns = held_ms * MS
    machine.tick(20 * MS)
    machine.tick(0, 3)
    assert (machine.rig.reason() == "LOOP_STALLED") is trips
    assert (machine.commanded() == 0) is trips


def test_neutral_leaves_at_any_time_and_asks_for_no_clock(changed_rig: Make) -> None:
    machine = Machine(changed_rig, 20, joysticks_ms=100, valve_ms=200)
    machine.slew = 0

    def never() -> int:
        raise AssertionError("a clock is read for a frame that moves nothing")

    machine.standstill.clock = never
    for _ in range(10):
        machine.tick(20 * MS)
    assert len(valves(machine.port)) == 30


def test_a_moving_frame_asks_once(changed_rig: Make) -> None:
    """Status and the frames of the service ask for none."""
    machine = Machine(changed_rig, 20, joysticks_ms=100, valve_ms=200).moving()
    calls = []
    machine.standstill.clock = lambda: calls.append(1) or machine.now_ns  # type: ignore[func-returns-value]
    before = len(valves(machine.port))
    for _ in range(30):
        machine.tick(20 * MS)
    assert len(calls) <= len(valves(machine.port)) - before


def test_a_short_tick_leaves_some_milliseconds(changed_rig: Make) -> None:
    machine = Machine(changed_rig, 1, joysticks_ms=100, valve_ms=200).moving()
    for held_ns, leaves in ((LEAST_LEAVE_NS, 1), (LEAST_LEAVE_NS + 1, 0)):
        before = len([f for f in machine.port.sent if f.can_id == 0x200])
        machine.hold_up_ns = held_ns
        machine.tick(MS)
        assert len([f for f in machine.port.sent if f.can_id == 0x200]) == before + leaves


def test_a_late_tick_has_less_time_to_send(changed_rig: Make) -> None:
    """95 ms after the one before, and T is 100 ms: 5 ms are left."""
    machine = Machine(changed_rig, 20, joysticks_ms=100, valve_ms=200).moving()
    for held_ms, leaves in ((5, 1), (6, 0)):
        before = len([f for f in machine.port.sent if f.can_id == 0x200])
        machine.hold_up_ns = held_ms * MS
        machine.standstill.last_ns = machine.now_ns
        machine.tick(95 * MS, 3)
        assert len([f for f in machine.port.sent if f.can_id == 0x200]) == before + leaves


# -- in a gateway ----------------------------------------------------------------------------------


class InGateway:
    """A gateway in motion, whose clock jumps after a joystick frame was received."""

    def __init__(self, folder: Path, slew: int = 1000) -> None:
        self.rig = GatewayRig(folder, yaml=(("interface: socketcan", "interface: virtual"),))
        self.slew = slew
        if slew:
            self.rig.moving()
        else:
            self.rig.run(5)
        self.joysticks, self.machine = Waiting(), Waiting()
        self.ports = {"joysticks": self.joysticks, "machine": self.machine}
        self.standstill = Standstill(self.rig.deployment)
        self.last_ns = self.rig.now_ns - 20 * MS
        self.standstill.last_ns = self.last_ns
        self.now_ns = self.last_ns

    def passed(self, after_ms: int, held_ms: int) -> int:
        """Frames that leave of one that is received so long after the tick, when it is held up."""
        self.now_ns = self.last_ns + after_ms * MS
        self.standstill.clock = lambda: self.now_ns + held_ms * MS
        self.joysticks.wait(self.rig.joystick(Slew=self.slew))
        assert not self.standstill.over(self.now_ns)
        receive_waiting(self.rig.controller, self.ports, self.now_ns, self.standstill)
        assert self.joysticks.queue == []
        return len(self.machine.sent)


@pytest.mark.parametrize(
    ("after_ms", "held_ms", "leaves"),
    [(10, 0, 1), (10, 20, 1), (10, 21, 0), (95, 5, 1), (95, 6, 0)],
)
def test_a_joystick_frame_with_velocities_from_before_a_stop_does_not_pass_after_it(
    tmp_path: Path, after_ms: int, held_ms: int, leaves: int
) -> None:
    assert InGateway(tmp_path).passed(after_ms, held_ms) == leaves


def test_a_joystick_frame_without_motion_passes_at_any_time(tmp_path: Path) -> None:
    assert InGateway(tmp_path, slew=0).passed(10, 90) == 1


def test_after_a_stop_in_a_gateway_its_axes_trip_and_neutral_leaves(tmp_path: Path) -> None:
    gateway = InGateway(tmp_path)
    assert gateway.passed(10, 91) == 0
    gateway.now_ns += 91 * MS
    gateway.standstill.clock = lambda: gateway.now_ns
    controller: Controller = gateway.rig.controller
    io_cycle(controller, gateway.ports, gateway.now_ns, 3, gateway.standstill)
    (own,) = (f for f in gateway.machine.sent if f.can_id == 0x110)
    values, before = gateway.rig.decoded(own), gateway.rig.decoded(gateway.rig.left[-2])
    assert values["AliveCounter"] == (before["AliveCounter"] + 1) % 256
    assert (values["Slew"], values["Enable"]) == (0, 0)
    assert controller.axes["slew"].axis.reason.name == "LOOP_STALLED"


def test_between_two_ticks_of_a_gateway_a_standstill_is_left_to_the_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gateway = InGateway(tmp_path)
    gateway.joysticks.wait(gateway.rig.joystick(Slew=1000))
    times = iter((0, 0, 101 * MS))
    gateway.standstill.clock = lambda: gateway.last_ns + next(times)
    monkeypatch.setattr("canshaper.daemon.gateway.select.select", lambda *_: ([1], [], []))
    line = InlineGateway(gateway.rig.deployment, lambda _fault: None)
    line.wait(0.2, gateway.rig.controller, gateway.ports, gateway.standstill)
    assert len(gateway.joysticks.queue) == 1
    assert gateway.machine.sent == []
