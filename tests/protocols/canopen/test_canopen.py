"""Our node on a bus of CANopen, and the others: heartbeats, emergencies, starting them."""

from itertools import pairwise
from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.daemon.daemon import Daemon
from canshaper.daemon.ports import close_ports
from canshaper.machine.binding import load_deployment
from tests.rigs.canopen import (
    NODES,
    OPERATIONAL,
    OURS,
    PRE_OPERATIONAL,
    STOPPED,
    CanopenRig,
    write_variant,
)

FAULT = ("TRIPPED", "VALVE_FAULT")
START = 1
FLOW_COMMAND_LATE = 0x8003


@pytest.fixture
def rig() -> CanopenRig:
    return CanopenRig()


@pytest.fixture
def guest(tmp_path: Path) -> CanopenRig:
    """A machine in which another one is the master."""
    return CanopenRig(write_variant(tmp_path, ("master: true", "master: false")))


def test_we_boot_and_then_beat_every_200_ms(rig: CanopenRig) -> None:
    beats = []
    for _ in range(61):
        rig.run()
        beats += [(rig.now_ns, f.data) for f in rig.sent if f.can_id == 0x700 + OURS]
    assert [data for _, data in beats] == [b"\0"] + [b"\x05"] * (len(beats) - 1)
    times = [at for at, _ in beats]
    assert {b - a for a, b in pairwise(times)} == {200_000_000}
    assert len(times) == 7


def test_a_node_that_boots_is_started_at_once_and_again_until_it_works(rig: CanopenRig) -> None:
    rig.states = dict.fromkeys(NODES, -1)
    rig.states["slew"] = PRE_OPERATIONAL
    rig.heartbeat("slew", 0)
    commands = []
    for _ in range(51):
        rig.run()
        commands += rig.commands
    assert commands == [bytes((START, NODES["slew"]))] * 3  # now, after 0.5 s, after 1 s
    assert rig.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    rig.states["slew"] = OPERATIONAL
    rig.run(40)
    assert not rig.commands
    assert rig.axis("lift") == ("NEUTRAL_WAIT", "NODE_FAULT")  # never seen, never started


def test_a_stopped_node_is_started_too(rig: CanopenRig) -> None:
    rig.ready()
    rig.states["left"] = STOPPED
    rig.run()
    assert rig.commands == [bytes((START, NODES["left"]))]


def test_who_is_no_master_starts_no_one(guest: CanopenRig) -> None:
    guest.states = dict.fromkeys(NODES, PRE_OPERATIONAL)
    for node in NODES:
        guest.heartbeat(node, 0)
    for _ in range(60):
        guest.run()
        assert not guest.commands
    guest.states = dict.fromkeys(NODES, OPERATIONAL)
    guest.ready()


def test_nothing_moves_until_every_node_of_the_axis_works(rig: CanopenRig) -> None:
    rig.states["left"] = PRE_OPERATIONAL
    rig.run(60)
    assert rig.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    assert rig.axis("lift")[0] == "READY"


@pytest.mark.parametrize("state", [PRE_OPERATIONAL, STOPPED, 0, 0x33])
def test_a_valve_node_that_stops_in_motion_is_neutral_at_once(rig: CanopenRig, state: int) -> None:
    rig.moving()
    rig.states["slew"] = state
    assert rig.run(Slew=30000)["slew"]["SetPoint"] == 0
    assert rig.axis() == FAULT


def test_a_node_that_restarts_between_two_ticks_is_seen(rig: CanopenRig) -> None:
    rig.moving()
    rig.heartbeat("slew", 0)  # and OPERATIONAL again within the tick
    assert rig.run(Slew=30000)["slew"]["SetPoint"] == 0
    assert rig.axis() == FAULT


WORDS = """      cia408:
        control: ControlWord
        status: { bus: crane, message: SlewValve, signal: StatusWord, timeout_ms: 300 }
        node: slew
"""


@pytest.fixture
def drive(tmp_path: Path) -> CanopenRig:
    """Slewed by a node without CiA 408."""
    return CanopenRig(write_variant(tmp_path, (WORDS, "      node: slew\n")))


@pytest.mark.parametrize("state", [PRE_OPERATIONAL, STOPPED, 0])
def test_a_drive_that_stops_in_motion_is_neutral_at_once(drive: CanopenRig, state: int) -> None:
    drive.moving()
    drive.states["slew"] = state
    assert drive.run(Slew=30000)["slew"]["SetPoint"] == 0
    drive.states["slew"] = OPERATIONAL
    drive.run(60, Slew=30000)
    assert drive.axis() == FAULT
    assert drive.axis("lift")[0] != "TRIPPED"


def test_a_drive_with_an_emergency_is_neutral_at_once(drive: CanopenRig) -> None:
    drive.moving()
    drive.emergency("slew", FLOW_COMMAND_LATE)
    assert drive.run(Slew=30000)["slew"]["SetPoint"] == 0
    assert drive.axis() == FAULT


def test_a_drive_whose_heartbeat_is_lost_is_neutral(drive: CanopenRig) -> None:
    drive.moving()
    drive.states["slew"] = -1
    assert 25 <= drive.until(lambda: drive.axis() == FAULT, Slew=30000) <= 28  # 500 ms
    assert drive.command("slew")["SetPoint"] == 0


def test_a_joystick_that_restarts_between_two_ticks_is_a_shaped_stop(rig: CanopenRig) -> None:
    rig.moving()
    rig.heartbeat("left", 0)
    assert rig.run(Slew=30000)["slew"]["SetPoint"] > 0
    assert rig.axis() == ("STOPPING", "NODE_FAULT")


def test_the_toggle_bit_of_node_guarding_is_no_state(rig: CanopenRig) -> None:
    rig.states = dict.fromkeys(NODES, OPERATIONAL | 0x80)
    rig.states["left"] = rig.states["right"] = OPERATIONAL
    rig.ready()


def test_a_lost_heartbeat_of_a_valve_is_neutral_and_latched(rig: CanopenRig) -> None:
    rig.moving()
    rig.states["slew"] = -1
    passed = rig.until(lambda: rig.axis() == FAULT, Slew=30000, Lift=20000)
    assert 25 <= passed <= 28  # 500 ms
    assert rig.command("slew")["SetPoint"] == 0
    assert rig.command("lift")["SetPoint"] > 3000
    assert rig.last_fault == "HEARTBEAT_LOST"
    assert any("node=slew state=lost" in text for text in rig.texts)
    rig.states["slew"] = OPERATIONAL
    rig.run(60)
    assert rig.axis() == FAULT
    rig.run(Reset=1)
    rig.run(2)
    assert rig.axis()[0] == "READY"


def test_a_lost_heartbeat_of_a_joystick_is_a_shaped_stop(rig: CanopenRig) -> None:
    """Its PDOs still come: it is the node that cannot be trusted."""
    rig.moving()
    rig.states["left"] = OPERATIONAL | 0x100  # its PDOs come, its heartbeat does not
    rig.heartbeat = lambda node, state: (  # type: ignore[method-assign]
        None if node == "left" else rig.receive(0x700 + NODES[node], bytes((state,)))
    )
    for _ in range(40):
        message = rig.dbc.get_message_by_name("JoystickLeft")
        values = {"Slew": 30000, "NearFar": 0, "Enable": 1, "Reset": 0, "AntiSwayOff": 0}
        rig.receive(0x190, message.encode(values, scaling=False))
        rig.run()
        if rig.axis()[0] == "STOPPING":
            break
    assert rig.axis() == ("STOPPING", "NODE_FAULT")
    assert rig.command("slew")["SetPoint"] > 0  # not at once


def test_an_emergency_in_motion_is_neutral_with_the_next_frame(rig: CanopenRig) -> None:
    rig.moving()
    rig.emergency("slew", FLOW_COMMAND_LATE)
    reported = rig.run(Slew=30000, Lift=20000)
    assert reported["slew"]["SetPoint"] == 0
    assert reported["lift"]["SetPoint"] > 3000
    assert rig.axis() == FAULT
    assert rig.last_fault == "NODE_EMERGENCY"
    assert any("node=slew" in text and "emergency=0x8003" in text for text in rig.texts)


def test_an_emergency_that_is_over_within_a_tick_trips_too(rig: CanopenRig) -> None:
    rig.moving()
    rig.emergency("slew", FLOW_COMMAND_LATE)
    rig.emergency("slew", 0, 0)
    assert rig.run(Slew=30000)["slew"]["SetPoint"] == 0
    assert rig.axis() == FAULT


def test_after_code_0_and_reset_the_axis_works_again(rig: CanopenRig) -> None:
    rig.moving()
    rig.emergency("slew", FLOW_COMMAND_LATE)
    rig.run(3)
    rig.run(Reset=1)
    rig.run(3)
    assert rig.axis() == FAULT  # it is still there
    rig.emergency("slew", 0, 0)
    rig.run(3)
    assert rig.axis() == FAULT  # and latched
    rig.run(Reset=1)
    rig.run(2)
    assert rig.axis()[0] == "READY"


def test_code_0_with_errors_left_in_the_register_is_not_all_well(rig: CanopenRig) -> None:
    rig.ready()
    rig.emergency("slew", FLOW_COMMAND_LATE)
    rig.emergency("slew", 0, 0x81)
    rig.run(3)
    assert rig.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    rig.emergency("slew", 0, 0)
    rig.run(3)
    assert rig.axis()[0] == "READY"


def test_boot_up_ends_an_emergency(rig: CanopenRig) -> None:
    rig.ready()
    rig.emergency("slew", FLOW_COMMAND_LATE)
    rig.run()
    assert rig.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    rig.heartbeat("slew", 0)
    rig.ready()


def test_an_emergency_of_a_joystick_is_a_shaped_stop(rig: CanopenRig) -> None:
    rig.moving()
    rig.emergency("left", 0x5000)
    assert rig.run(Slew=30000)["slew"]["SetPoint"] > 0
    assert rig.axis() == ("STOPPING", "NODE_FAULT")


def test_release_of_enable_and_a_valve_fault_count_in_a_stop_for_a_node(rig: CanopenRig) -> None:
    rig.moving()
    rig.emergency("left", 0x5000)
    rig.run(2, Slew=30000)
    assert rig.run(Slew=30000, Enable=0)["slew"]["SetPoint"] == 0
    assert rig.axis() == ("TRIPPED", "ENABLE_LOST")
    rig = CanopenRig().moving()
    rig.emergency("left", 0x5000)
    rig.run(2, Slew=30000)
    rig.emergency("slew", FLOW_COMMAND_LATE)
    assert rig.run(Slew=30000)["slew"]["SetPoint"] == 0
    assert rig.axis() == FAULT


@pytest.mark.parametrize("can_id", [0x700 + OURS, 0x000])
def test_a_second_one_of_us_is_reported(rig: CanopenRig, can_id: int) -> None:
    """Our heartbeat, and the commands of the master, come from no other node."""
    rig.ready()
    rig.receive(can_id, b"\x05" if can_id else b"\x80\x00")
    assert rig.last_fault == "SECOND_SENDER"


def test_another_master_is_welcome_where_we_are_none(guest: CanopenRig) -> None:
    guest.receive(0x000, bytes((START, 0)))
    assert guest.last_fault == "NONE"


@pytest.mark.parametrize("can_id", [0x080, 0x085, 0x100, 0x5A0, 0x620, 0x705, 0x77F, 0x7E5])
def test_other_services_are_daily_life(rig: CanopenRig, can_id: int) -> None:
    """SYNC, EMCY and heartbeats of nodes that are not ours to watch, TIME, SDO, LSS."""
    rig.receive(can_id, bytes(8))
    assert rig.last_fault == "NONE"
    rig.controller.receive(Frame("crane", can_id, True, bytes(8)), rig.now_ns)
    assert rig.last_fault == "UNKNOWN_ID"


@pytest.mark.parametrize("can_id", [0x001, 0x101, 0x1A5, 0x480, 0x6FF])
def test_a_pdo_that_no_one_knows_is_a_fault(rig: CanopenRig, can_id: int) -> None:
    rig.receive(can_id, bytes(8))
    assert rig.last_fault == "UNKNOWN_ID"


@pytest.mark.parametrize(("base", "data"), [(0x700, b""), (0x700, b"\5\5"), (0x80, bytes(7))])
def test_wrong_length(rig: CanopenRig, base: int, data: bytes) -> None:
    rig.ready()
    rig.receive(base + NODES["slew"], data)
    assert rig.last_fault == "WRONG_LENGTH"
    rig.run()
    assert rig.axis()[0] == "READY"


def test_the_daemon_opens_a_bus_of_canopen(tmp_path: Path) -> None:
    """A bus is a key of what is open; that has to work with the nodes in it."""
    file = write_variant(
        tmp_path, ("interface: socketcan", "interface: virtual"), ("vcan0", "canopen-test")
    )
    daemon = Daemon(lambda: load_deployment(file))
    assert set(daemon._ports) == {"crane"}
    close_ports(daemon._ports.values())
