"""Nodes of CANopen that stop, restart, fall silent or report an emergency."""

from pathlib import Path

import pytest

from tests.rigs.canopen import (
    NODES,
    OPERATIONAL,
    PRE_OPERATIONAL,
    STOPPED,
    CanopenRig,
    write_variant,
)

FAULT = ("TRIPPED", "VALVE_FAULT")
FLOW_COMMAND_LATE = 0x8003


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
