"""Frames that wait in the sockets while the loop stands still: only bad news of them counts."""

from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.config.bus import CanopenNode
from canshaper.protocols.canopen.network import NodeGate
from canshaper.protocols.canopen.nodes import RemoteNode
from canshaper.shaping.states import Reason, State
from tests.rigs.canopen import BOOT_UP, HOLD, OPERATIONAL, STOPPED, CanopenRig
from tests.rigs.emergency import PRESSED, STOP, Machine
from tests.rigs.forwarder import Make, Rig
from tests.rigs.gateway import GatewayRig
from tests.rigs.j1939 import AVC, OTHER, bjm
from tests.rigs.j1939 import Rig as J1939Rig

FOREIGN = Frame("crane", 0x200, False, b"\0\0")
FLOW_COMMAND_LATE = 0x8003
NODE_FAULT = ("NEUTRAL_WAIT", "NODE_FAULT")
# From READY before a standstill to READY after it: a heartbeat, and four steps of the valve.
STEPS = 30


@pytest.fixture
def canopen() -> CanopenRig:
    """A machine at rest, whose loop has just stood still: what comes now has waited."""
    rig = CanopenRig().ready()
    rig.controller.stalled()
    return rig


# -- nodes of CANopen ------------------------------------------------------------------------------


def test_without_news_the_axes_are_ready_again(canopen: CanopenRig) -> None:
    assert not canopen.run(1)["slew"]["SetPoint"]
    assert canopen.axis() == NODE_FAULT
    assert canopen.until(lambda: canopen.axis()[0] == "READY") < STEPS


@pytest.mark.parametrize(
    ("node", "axes"), [("slew", ("slew",)), ("left", ("slew", "near_far")), ("right", ("lift",))]
)
def test_an_error_that_is_not_over_lets_nothing_begin(
    canopen: CanopenRig, node: str, axes: tuple[str, ...]
) -> None:
    """Of a valve or of a joystick; the error is over with its own message only."""
    canopen.emergency(node, FLOW_COMMAND_LATE)
    canopen.run(3 * STEPS)
    assert [axis for axis in canopen.valves if canopen.axis(axis) == NODE_FAULT] == list(axes)
    for _ in range(50):
        sent = canopen.run(1, Slew=30000, NearFar=30000, Lift=30000)
        assert all(sent[axis]["SetPoint"] == 0 for axis in axes)
    canopen.emergency(node, 0, register=0)
    canopen.until(lambda: canopen.axis(axes[0])[0] == "READY")


def test_an_error_that_was_over_in_it_leaves_the_axis_latched_that_moved() -> None:
    rig = CanopenRig().moving()
    rig.controller.stalled()
    rig.emergency("slew", FLOW_COMMAND_LATE)
    rig.emergency("slew", 0, register=0)
    rig.run(3 * STEPS)
    assert rig.axis() == ("TRIPPED", "LOOP_STALLED")
    rig.run(1, Reset=1)
    assert rig.until(lambda: rig.axis()[0] == "READY") < STEPS


def test_the_end_of_an_error_counts_too_for_it_is_reported_once(canopen: CanopenRig) -> None:
    canopen.emergency("slew", FLOW_COMMAND_LATE)
    canopen.run(2)
    canopen.controller.stalled()
    canopen.emergency("slew", 0, register=0)
    assert canopen.until(lambda: canopen.axis()[0] == "READY") < STEPS


@pytest.mark.parametrize("state", [STOPPED, OPERATIONAL, BOOT_UP])
def test_a_heartbeat_that_waited_does_not_let_anything_begin(
    canopen: CanopenRig, state: int
) -> None:
    """Its node may be silent by now."""
    canopen.heartbeat("slew", state)
    canopen.states["slew"] = -1
    for _ in range(3 * STEPS):
        canopen.run()
        assert canopen.axis() == NODE_FAULT


def test_a_node_that_booted_has_no_emergency_any_more(canopen: CanopenRig) -> None:
    canopen.emergency("slew", FLOW_COMMAND_LATE)
    canopen.heartbeat("slew", BOOT_UP)
    assert canopen.until(lambda: canopen.axis()[0] == "READY") < STEPS


def test_a_valve_that_was_not_active_begins_from_init(canopen: CanopenRig) -> None:
    canopen.status("slew", HOLD)
    assert canopen.run(1)["slew"]["ControlWord"] == 0x8
    assert canopen.axis()[0] == "NEUTRAL_WAIT"
    assert canopen.until(lambda: canopen.axis()[0] == "READY") < STEPS


def test_a_heartbeat_that_was_lost_for_a_moment_is_seen_by_an_axis_that_is_asked_later() -> None:
    """One with a slow valve: the node is back before the turn of that axis comes."""
    node = RemoteNode(CanopenNode(id=0x20, heartbeat_ms=100))
    node.heartbeat(b"\x05", 0)
    gate = NodeGate(node, Reason.VALVE_FAULT)
    assert gate(False, 0) is None
    assert node.lost(100_000_001)
    assert not node.lost(100_000_002)
    node.heartbeat(b"\x05", 110_000_000)
    assert gate(False, 120_000_000) is Reason.VALVE_FAULT
    assert gate(False, 140_000_000) is None


@pytest.mark.parametrize(("later_ns", "counts"), [(100_000_000, False), (100_000_001, True)])
def test_a_heartbeat_that_came_too_late_was_lost_whenever_it_is_read(
    later_ns: int, counts: bool
) -> None:
    node = RemoteNode(CanopenNode(id=0x20, heartbeat_ms=100))
    gate = NodeGate(node, Reason.NODE_FAULT)
    node.heartbeat(b"\x05", 0)
    assert gate(True, 0) is None
    node.heartbeat(b"\x05", later_ns)
    assert (gate(True, later_ns) is Reason.NODE_FAULT) is counts


# -- other senders ---------------------------------------------------------------------------------


def test_another_sender_of_a_valves_id_trips(rig: Rig) -> None:
    """At rest too, as it does at any other time."""
    rig.run(3)
    rig.controller.stalled()
    rig.receive(FOREIGN)
    rig.run(1)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SECOND_SENDER")
    assert rig.state("lift") is State.NEUTRAL_WAIT


def test_another_address_that_commands_our_valve_trips() -> None:
    rig = J1939Rig().claimed()
    rig.controller.stalled()
    rig.receive(Frame("crane", AVC & ~0xFF | OTHER, True, bytes(8)))
    rig.tick(bjm("BJM1"), bjm("BJM2"))
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SECOND_SENDER")


def test_an_address_that_was_claimed_by_another_is_lost() -> None:
    """Its claim comes once; without it we would claim again, and both would."""
    rig = J1939Rig().claimed()
    rig.controller.stalled()
    rig.receive(rig.claim(-1))
    rig.run(1)
    assert "bus=crane address=0x9c state=lost" in rig.events
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ADDRESS_LOST")


def test_a_joystick_from_any_address_has_to_come_again() -> None:
    rig = J1939Rig().claimed()
    rig.run(5)
    rig.controller.stalled()
    rig.receive(bjm("BJM1"), bjm("BJM2"))
    rig.tick()
    for _ in range(30):
        rig.tick(bjm("BJM2"))
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "JOYSTICK_TIMEOUT")
    assert rig.state("lift") is State.READY


# -- joysticks and the emergency stop --------------------------------------------------------------


def test_a_press_of_enable_in_it_resets_nothing(rig: Rig) -> None:
    rig.moving()
    rig.controller.stalled()
    rig.receive(rig.joystick(Enable=0), rig.joystick(Enable=1))
    rig.run(10)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "LOOP_STALLED")
    rig.run(1, Enable=0)
    rig.run(2)
    assert rig.state() is State.READY


@pytest.mark.parametrize(("error", "counts"), [(0, True), (1, False)])
def test_a_frame_with_a_wrong_checksum_says_nothing(
    changed_rig: Make, error: int, counts: bool
) -> None:
    check = "alive_counter: Count, checksum: { signal: Check, kind: sum }"
    machine = Machine(changed_rig, STOP.replace("alive_counter: Count", check))
    machine.run(3)
    machine.rig.controller.stalled()
    machine.rig.receive(machine.stop(1, error=error), machine.stop(0))
    machine.run(1)
    assert (machine.states() == PRESSED) is counts


def test_what_waited_is_never_passed_on_by_a_gateway(tmp_path: Path) -> None:
    """Nor with the next frame, which is a repetition and no news."""
    rig = GatewayRig(tmp_path)
    rig.run(3)
    rig.controller.stalled()
    waited = rig.joystick()
    assert rig.receive(waited) is None
    rig.tick()
    assert rig.receive(waited) is None
    assert rig.receive(rig.joystick()) is not None
