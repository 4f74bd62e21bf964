"""Deployment against DBC: what does not fit is one problem, with file and line."""

import re
from pathlib import Path

import pytest

from tests.rigs.files import Machine

VALVE = """VERSION ""

BU_: A

BO_ 1536 Valve: 2 A
 SG_ Velocity : 0|8@1- (0.8,0) [-100|100] "%" A
 SG_ AliveCounter : 8|8@1+ (1,0) [0|255] "" A

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 1536 20;
"""
SHIPPED = (Path(__file__).parents[2] / "dbc" / "forwarder.dbc").read_text(encoding="cp1252")
MESSAGES = ", ".join(sorted(re.findall(r"^BO_ \d+ (\w+)", SHIPPED, re.MULTILINE)))


def test_the_shipped_machine_binds(machine: Machine) -> None:
    deployment = machine.load()
    assert {n: joystick.key for n, joystick in deployment.joysticks.items()} == {
        "left": ("crane", 0x110, False),
        "right": ("crane", 0x111, False),
    }
    assert [(a.period_ticks, a.status_ticks) for a in deployment.axes.values()] == [(1, 5)] * 3
    assert deployment.status_ticks == 25
    assert {a.valve.steps for a in deployment.axes.values()} == {125}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        # names that are not there, with those that are
        (
            "message: JoystickLeft",
            "message: JoystickLeeft",
            "joysticks.left.message: expected a message of the DBC files, got 'JoystickLeeft';"
            " there are"
            f" {MESSAGES}",
        ),
        (
            "signal: Slew,",
            "signal: Sleww,",
            "axes.slew.command.signal: expected a signal of JoystickLeft, got 'Sleww'; there are"
            " Slew, NearFar, Enable, AntiSwayOff, Reset, AliveCounter",
        ),
        (
            "message: SlewCommand, signal: Velocity",
            "message: SlewCommand, signal: Speed",
            "axes.slew.valve.signal: expected a signal of SlewCommand, got 'Speed'; there are"
            " Velocity, AliveCounter",
        ),
        (
            "message: SlewStatus",
            "message: Nothing",
            "axes.slew.status.message: expected a message of the DBC files, got 'Nothing'; there"
            f" are {MESSAGES}",
        ),
        (
            "joystick: left",
            "joystick: mid",
            "axes.slew.command.joystick: expected a joystick, got 'mid'; there are left, right",
        ),
        (
            "enable: Enable",
            "enable: On",
            "joysticks.left.enable: expected a signal of JoystickLeft, got 'On'",
        ),
        (
            "reset: Reset",
            "reset: R",
            "joysticks.left.reset: expected a signal of JoystickLeft, got 'R'",
        ),
        (
            "anti_sway_off: AntiSwayOff",
            "anti_sway_off: O",
            "anti_sway_off: expected a signal of JoystickLeft, got 'O'",
        ),
        # one id for two purposes
        (
            "message: NearFarCommand",
            "message: SlewCommand",
            "axes.near_far.valve.signal: expected a free signal, got 'Velocity', which is"
            " axes.slew.valve.signal already",
        ),
        (
            "message: SlewStatus",
            "message: JoystickRight",
            "axes.slew.status.message: JoystickRight has the id 0x111 on bus crane, which is used"
            " already by joysticks.right",
        ),
        # one signal for two purposes: each of these would move the axis by itself
        (
            "alive_counter: AliveCounter }",
            "alive_counter: Velocity }",
            "axes.slew.valve.signal: expected a free signal, got 'Velocity', which is"
            " alive_counter already",
        ),
        (
            "anti_sway_off: AntiSwayOff",
            "anti_sway_off: Enable",
            "joysticks.left.anti_sway_off: expected a free signal, got 'Enable', which is enable"
            " already",
        ),
        # filters
    ],
)
def test_what_the_dbc_does_not_have(machine: Machine, old: str, new: str, says: str) -> None:
    line = machine.in_yaml(old, new)
    (problem,) = [p for p in machine.problems() if says in p]
    assert problem.startswith(f"machine.yaml:{line}: ")


def test_one_name_gone_is_one_problem(machine: Machine) -> None:
    machine.in_yaml("message: SlewCommand", "message: Slew")
    machine.in_yaml("message: JoystickRight", "message: Right")
    assert [p.split(": ")[1] for p in machine.problems()] == [
        "joysticks.right.message",
        "axes.slew.valve.message",
    ]


def test_a_joystick_that_is_the_enable_switch_too(machine: Machine) -> None:
    machine.in_yaml("enable: Enable", "enable: Slew")
    machine.in_dbc("(0.1,0)", "(1,0)")
    line = machine.in_yaml("signal: Slew,", "signal: Slew,")
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.slew.command.signal: expected a free signal, got 'Slew', which"
        " is enable already"
    ]


def test_two_joysticks_that_are_one_message(machine: Machine) -> None:
    line = machine.in_yaml("message: JoystickRight", "message: JoystickLeft")
    assert machine.problems()[0] == (
        f"machine.yaml:{line}: joysticks.right.message: JoystickLeft has the id 0x110 on bus crane,"
        " which is used already by joysticks.left"
    )


def test_a_joystick_and_a_valve_of_one_id(machine: Machine) -> None:
    machine.in_yaml("[machine.dbc]", "[machine.dbc, valve.dbc]")
    line = machine.in_yaml("message: SlewCommand", "message: Valve")
    (machine.directory / "valve.dbc").write_text(VALVE.replace("1536", "273"), encoding="cp1252")
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.slew.valve.message: Valve has the id 0x111 on bus crane,"
        " which is used already by joysticks.right"
    ]


def test_the_same_id_on_two_buses_or_extended_is_another_message(machine: Machine) -> None:
    machine.in_yaml(
        "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }",
        "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }\n"
        "  boom: { interface: socketcan, channel: vcan1 }",
    )
    machine.in_yaml("bus: crane, message: SlewCommand", "bus: boom, message: SlewCommand")
    machine.dbc = machine.dbc.replace(" 513 ", " 2147484160 ")  # 0x200, extended
    axes = machine.load().axes
    assert axes["near_far"].valve_message.frame_id == axes["slew"].valve_message.frame_id == 0x200
    assert axes["near_far"].valve_message.is_extended_frame


def test_two_buses_on_one_channel(machine: Machine) -> None:
    line = machine.in_yaml(
        "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }",
        "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }\n"
        "  boom: { interface: socketcan, channel: vcan0, bitrate: 250000 }",
    )
    assert machine.problems() == [
        f"machine.yaml:{line + 1}: buses.boom: has the channel vcan0 of bus crane"
    ]


def test_a_bus_that_is_no_multicast_is_not_shared(machine: Machine) -> None:
    line = machine.in_yaml(
        "{ interface: socketcan, channel: vcan0, bitrate: 250000 }",
        "{ interface: socketcan, channel: vcan0, bitrate: 250000, network: true }",
    )
    assert machine.problems() == [
        f"machine.yaml:{line}: buses.crane.network: expected true with udp_multicast only, got it"
        " with socketcan"
    ]
