"""One tick between the buses and the controller, above all the first one after a standstill."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.gate.cycle import Standstill, io_cycle
from canshaper.shaping.states import State
from tests.rigs.emergency import PRESSED, READY, Machine
from tests.rigs.files import machine_file
from tests.rigs.forwarder import PATIENT, SLOW_VALVE, TICK_NS, Make, Rig
from tests.rigs.gateway import GatewayRig
from tests.rigs.j1939 import Rig as J1939Rig
from tests.rigs.j1939 import bjm
from tests.rigs.waiting import Waiting, both, tick


def test_a_valve_that_has_closed_meanwhile_does_not_get_full_speed(changed_rig: Make) -> None:
    rig = changed_rig(PATIENT)
    rig.moving()
    port = Waiting()
    port.wait(rig.joystick(Slew=1000))
    tick(rig, port, missed=31)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "LOOP_STALLED")
    assert port.sent[0].data[0] == 0


# -- what waited while the loop stood still --------------------------------------------------------


def test_what_waited_is_read_to_its_end_and_not_believed(rig: Rig) -> None:
    """However much it is: neutral is among it, and the joystick has been out for long."""
    rig.run(3)
    port = Waiting(most=10)
    port.wait(*(frame for _ in range(100) for frame in both(rig)))
    tick(rig, port, missed=100)
    assert port.queue == []
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "JOYSTICK_TIMEOUT")
    for _ in range(10):
        port.wait(*both(rig, Slew=1000))
        tick(rig, port)
        assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "JOYSTICK_NOT_NEUTRAL")


def test_a_bus_that_never_ends_does_not_hold_up_the_loop_for_ever(rig: Rig) -> None:
    class Endless(Waiting):
        def frames(self) -> Iterator[Frame]:
            yield rig.joystick()

    port = Endless()
    tick(rig, port, missed=100)
    assert port.sent


def test_a_frame_that_waited_is_not_passed_on(tmp_path: Path) -> None:
    """Nor is one counted, so that the ECU sees no gap in the counter."""
    gateway = GatewayRig(tmp_path).moving()
    before = gateway.decoded(gateway.left[-2])
    port, machine = Waiting(), Waiting()
    port.wait(*(gateway.joystick(Slew=1000) for _ in range(10)))
    standstill = Standstill(gateway.deployment)
    standstill.last_ns = gateway.now_ns
    gateway.now_ns += 10 * TICK_NS
    ports = {"joysticks": port, "machine": machine}
    io_cycle(gateway.controller, ports, gateway.now_ns, 10, standstill)
    (own,) = (f for f in machine.sent if f.can_id == 0x110)
    after = gateway.decoded(own)
    assert (after["Slew"], after["Enable"]) == (0, 0)
    assert after["AliveCounter"] == (before["AliveCounter"] + 1) % 256


def test_an_emergency_stop_of_a_standstill_is_latched(changed_rig: Make) -> None:
    """Pressed and free again in it, at rest: like any press it asks for a reset."""
    machine = Machine(changed_rig)
    machine.run(3)
    assert machine.states() == READY
    port, rig = Waiting(), machine.rig
    for pressed in (0, 0, 1, 1, 1, 0, 0, 0):
        port.wait(machine.stop(pressed), *both(rig))
    tick(rig, port, missed=8)
    assert machine.states() == PRESSED
    for _ in range(3):
        port.wait(machine.stop(0), *both(rig))
        tick(rig, port)
    assert machine.states() == PRESSED


@pytest.mark.parametrize(("source", "counts"), [(0x33, True), (0x34, False)])
def test_in_j1939_it_is_known_by_its_group_and_source_at_any_priority(
    tmp_path: Path, source: int, counts: bool
) -> None:
    stop = "{ bus: crane, message: BJM3, signal: Button1, timeout_ms: 100, source: 0x33 }"
    rig = J1939Rig(machine_file(tmp_path, "j1939-forwarder", more=f"emergency_stop: {stop}\n"))
    rig.controller.stalled()
    for pressed in (1, 0):
        rig.receive(bjm("BJM2", 0x33), bjm("BJM3", source, 6, Button1=pressed))
    rig.tick()
    assert (rig.state() is State.TRIPPED) is counts


def test_an_emergency_stop_that_was_free_in_a_standstill_is_not_known(changed_rig: Make) -> None:
    machine = Machine(changed_rig)
    machine.run(3)
    port, rig = Waiting(), machine.rig
    port.wait(*(machine.stop(0), *both(rig)) * 8)
    tick(rig, port, missed=8)
    for _ in range(3):
        port.wait(*both(rig))
        tick(rig, port)
    assert machine.states() == [(State.NEUTRAL_WAIT, "EMERGENCY_STOP_LOST")] * 3
    port.wait(machine.stop(0), *both(rig))
    tick(rig, port)
    assert machine.states() == READY


def test_an_axis_with_a_slow_valve_has_seen_the_standstill_too(
    changed_rig: Callable[..., Rig],
) -> None:
    """A valve of 200 ms: the joystick is out, and fresh again, before its turn comes."""
    rig = changed_rig(dbc=SLOW_VALVE)
    rig.run(31)
    assert rig.state() is State.READY
    rig.controller.stalled()
    rig.run(40, Slew=1000)
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "JOYSTICK_NOT_NEUTRAL")


def test_a_frame_that_does_not_go_out_is_a_trip(rig: Rig) -> None:
    class Full(Waiting):
        def send(self, frame: Frame) -> bool:
            super().send(frame)
            return frame.can_id != 0x200

    rig.moving()
    port = Full()
    port.wait(rig.joystick(Slew=1000))
    tick(rig, port)
    assert (rig.state(), rig.controller.counters.values["SendFailures"]) == (State.ACTIVE, 1)
    port.wait(rig.joystick(Slew=1000))
    tick(rig, port)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SEND_FAILED")
