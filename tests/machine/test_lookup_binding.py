"""Messages that a deployment names: their ids, nodes and times, each problem in full."""

from pathlib import Path

import pytest

from canshaper.shaping.states import Reason
from tests.rigs.files import Machine

J1939 = ("j1939-forwarder", "j1939-bjm-avc")
CANOPEN = ("canopen-forwarder", "canopen-cia401-cia408")
READ = "feedback: { bus: crane, message: AVC0, source: 0x80, signal: PortFlow,"
RADIUS = "motion: { crane: { slew: slew, near_far: near_far, radius: { %s } } }\n\n"


def changed(folder: Path, names: tuple[str, str], *changes: tuple[str, str]) -> Machine:
    """A shipped machine whose deployment and DBC file have these pieces replaced everywhere."""
    machine = Machine(folder)
    machine.become(f"{names[0]}.yaml", f"{names[1]}.dbc")
    for old, new in changes:
        assert old in machine.yaml + machine.dbc, old
        machine.yaml, machine.dbc = (text.replace(old, new) for text in (machine.yaml, machine.dbc))
    return machine


def test_in_j1939_an_id_is_the_same_at_every_priority(tmp_path: Path) -> None:
    left, right = 2365445886, 0x80000000 | 6 << 26 | 2365445886 & 0x03FFFFFF
    at = "joysticks.right.message: BJM2 has the id 0x18fdd6fe on bus crane"
    wrong = changed(tmp_path, J1939, (str(left + 512), str(right)))
    assert f"{at}, which is used already by joysticks.left" in wrong.faults()


def test_outside_of_j1939_every_bit_of_an_id_counts(machine: Machine) -> None:
    machine.dbc = machine.dbc.replace(" 272 ", f" {0x80000110} ")
    machine.dbc = machine.dbc.replace(" 273 ", f" {0x84000110} ")
    keys = {name: one.key for name, one in machine.load().joysticks.items()}
    assert keys == {"left": ("crane", 0x110, True), "right": ("crane", 0x4000110, True)}


@pytest.mark.parametrize(
    ("names", "changes", "says"),
    [
        (
            J1939,
            [("    message: BJM1\n", "    message: BJM1\n    source: 0x9C\n")],
            "joysticks.left.source: BJM1 comes from address 156, which is ours on bus crane",
        ),
        (
            J1939,
            [("2365445886", str(2365445886 - 0xFE + 0x9C))],
            "joysticks.left.message: BJM1 comes from address 156, which is ours on bus crane",
        ),
        (
            J1939,
            [("of 20 ms\n    enable: Button1", "of 20 ms\n    enable: Button1/0")],
            "joysticks.left.message: Button1: expected the signal, as its two bits are one state in"
            " J1939 (2 is an error, 3 not available), got Button1/0 or Button1/1",
        ),
        (
            J1939,
            [("BO_ 2365445886 BJM1: 8", "BO_ 2365445886 BJM1: 9")],
            "joysticks.left.message: BJM1: expected 8 bytes at most, got 9",
        ),
        (
            J1939,
            [
                ('BA_ "VFrameFormat" BO_ 2365445886 3;\n', ""),
                ("feedback: { bus: crane, message: AVEF0, signal: ExtendFlow,", READ),
            ],
            "axes.slew.feedback.message: AVC0: expected a group that commands no valve, got that"
            " of axes.slew.valve",
        ),
        (
            CANOPEN,
            [(" 1696 ", " 1586 ")],
            "axes.slew.status.message: SlewStatus: expected the id of a PDO, got 0x632, which is"
            " one of SDO in CANopen",
        ),
    ],
)
def test_what_a_protocol_refuses(
    tmp_path: Path, names: tuple[str, str], changes: list[tuple[str, str]], says: str
) -> None:
    assert changed(tmp_path, names, *changes).faults() == [says]


POSITION = ("XPosition : 6|10@1+ (0.1,0) [0|100]", "XPosition : 6|10@1+ (0.1,0) [0|102.3]")
UNNAMED = ('XPosition 1022 "Error" 1023 "NotAvailable" ;', 'Button4 2 "Error" ;')
FLOW = ("ExtendFlow : 0|8@1+ (1,-125) [-125|125]", "ExtendFlow : 0|8@1+ (1,-125) [0|0]")
FLOW_NAMES = ('ExtendFlow 254 "Error" 255 "NotAvailable"', 'ExtendFlow 254 "Error"')
FULL = ("signal: XPosition\n", "signal: XPosition\n      full: 100\n")
ERRORS = "expected a range that ends before the error codes of J1939,"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            [POSITION, UNNAMED],
            {
                f"BJM1: XPosition: {ERRORS} 1022 to 1023, or names for them (VAL_), got"
                " [0|102.3]: 1022 would be 102.2 %"
            },
        ),
        (
            [FLOW, FLOW_NAMES],
            {
                f"AVEF{n}: ExtendFlow: {ERRORS} 254 to 255, or names for them (VAL_), got no range:"
                " 255 would be 130 %"
                for n in range(3)
            },
        ),
        (
            [
                ("PortFlow : 0|8@1+ (0.4,0) [0|100]", "PortFlow : 0|8@1+ (0.4,0) [0|102]"),
                (UNNAMED[0], f'{UNNAMED[0]}\nVAL_ 2365468926 PortFlow 254 "Error" 255 "None" ;'),
            ],
            {
                f"AVC{n}: PortFlow: {ERRORS} 254 to 255, got [0|102]: 254 would be 101.6 %"
                for n in range(3)
            },
        ),
    ],
)
def test_an_error_of_j1939_is_no_measurement(
    tmp_path: Path, changes: list[tuple[str, str]], says: set[str]
) -> None:
    """All bits 1, not available, would otherwise be full speed; nor is it a command."""
    assert set(changed(tmp_path, J1939, *changes).faults()) == says


@pytest.mark.parametrize("changes", [[POSITION], [UNNAMED], [POSITION, UNNAMED, FULL]])
def test_an_error_of_j1939_has_a_name_or_lies_out_of_the_range(
    tmp_path: Path, changes: list[tuple[str, str]]
) -> None:
    joystick = changed(tmp_path, J1939, *changes).load().joysticks["left"]
    position = joystick.velocities[0]
    flags = {"XNeutral": 0, "XNegative": 0, "XPositive": 1}
    command = position.read({"XPosition": 1000, **flags})
    assert command == pytest.approx(1000 / 1023 if changes == [POSITION] else 1.0)
    for raw in (1022, 1023):
        assert isinstance(position.read({"XPosition": raw, **flags}), Reason)


@pytest.mark.parametrize(("code", "named"), [(1, False), (2, False), (3, False), (3, True)])
def test_an_error_of_j1939_enables_nothing(tmp_path: Path, code: int, *, named: bool) -> None:
    table = 'BJM3 Button1 0 "Released" 1 "Pressed" 2 "Error" 3 "NotAvailable" ;'
    of = table.replace("BJM3", "VAL_ 2365446910")
    other = 'VAL_ 2365446910 Button1 0 "Released" 3 "Pressed" ;' if named else ""
    seat = "bus: crane, message: BJM3, source: 0x35, timeout_ms: 100, signal: Button1"
    machine = changed(
        tmp_path,
        J1939,
        (of, other),
        ("Button1 : 46|2@1+ (1,0) [0|1]", "Button1 : 46|2@1+ (1,0) [0|3]"),
        ("axes:\n", f"switches:\n  seat: {{ {seat}, code: {code} }}\n\naxes:\n"),
        ("enable: Button1", "enable: [Button1, seat]"),
    )
    if named or code == 1:
        assert machine.load().switches[0].switches["seat"] == ("Button1", code)
        return
    assert machine.faults() == [
        "switches.seat.code: Button1: expected a code below 2, as the others are errors in J1939,"
        f" or a name for it (VAL_), got {code}"
    ]


def test_a_group_with_a_destination_may_command_a_valve_and_be_read(tmp_path: Path) -> None:
    """A frame to another node is no command of the valve."""
    feedback = "feedback: { bus: crane, message: AVEF0,"
    deployment = changed(
        tmp_path,
        J1939,
        ("2365468926", str(0x8CEF33FE)),
        ("2365460734", str(0x8CEF9CFE)),
        (feedback, f"{feedback} source: 0x33,"),
    ).load()
    bound = deployment.axes["slew"].feedback
    assert bound is not None
    assert bound.key == ("crane", 0x0CEF9C33, True)
    assert deployment.axes["slew"].valve.message.key[1] == 0x0CEF339C


def test_a_group_is_one_of_j1939_only(tmp_path: Path) -> None:
    """An id of a message of another kind is no group, whatever its bits are."""
    stop = "emergency_stop: { bus: crane, message: BJM3, signal: Button1, timeout_ms: 200 }\n"
    deployment = changed(
        tmp_path,
        J1939,
        (
            "status: { bus: crane, message: ShaperStatus }",
            f"{stop}status: {{ bus: crane, message: ShaperStatus }}",
        ),
        ("2365446910", str(0x8CFE3021)),
        (f'BA_ "VFrameFormat" BO_ {0x8CFE3021} 3;\n', ""),
    ).load()
    assert deployment.emergency_stop is not None


def test_an_id_of_29_bits_is_no_service_of_canopen(tmp_path: Path) -> None:
    deployment = changed(tmp_path, CANOPEN, (" 1696 ", f" {0x80000632} ")).load()
    status = deployment.axes["slew"].status
    assert status is not None
    assert status.message.key == ("crane", 0x632, True)


def test_an_id_of_a_service_is_free_on_a_bus_without_canopen(machine: Machine) -> None:
    machine.dbc = machine.dbc.replace(" 768 ", f" {0x632} ")
    status = machine.load().axes["slew"].status
    assert status is not None
    assert status.message.key == ("crane", 0x632, False)


def test_a_node_of_a_bus_that_there_is_not(machine: Machine) -> None:
    joystick = "    bus: crane\n    message: JoystickLeft\n"
    line = machine.in_yaml(joystick, joystick.replace("crane", "boom") + "    node: left\n")
    assert machine.problems() == [
        f"machine.yaml:{line}: joysticks.left.bus: expected a bus, got 'boom'; there are crane",
        f"machine.yaml:{line + 2}: joysticks.left.node: expected a node of bus boom, got 'left';"
        " there are none",
    ]


def test_several_buses_that_there_are_stand_in_a_row(machine: Machine) -> None:
    machine.in_yaml("buses:\n", "buses:\n  boom: { interface: socketcan, channel: vcan1 }\n")
    line = machine.in_yaml("    bus: crane\n", "    bus: tool\n")
    assert machine.problems() == [
        f"machine.yaml:{line}: joysticks.left.bus: expected a bus, got 'tool'; there are boom,"
        " crane"
    ]


def test_of_two_buses_each_has_its_own_messages(machine: Machine) -> None:
    machine.in_yaml("buses:\n", "buses:\n  boom: { interface: socketcan, channel: vcan1 }\n")
    machine.in_yaml(
        "    bus: crane\n    message: JoystickR", "    bus: boom\n    message: JoystickR"
    )
    on_bus = machine.load().on_bus
    assert {m.name for m in on_bus["boom"]} == {"JoystickRight"}
    assert len(on_bus["crane"]) == 9


@pytest.mark.parametrize(
    ("tick", "cycle", "timeout", "says"),
    [
        (20, 20, 39, "expected 40 ms or more, twice the cycle of JoystickLeft, got 39"),
        (20, 60, 100, "expected 120 ms or more, twice the cycle of JoystickLeft, got 100"),
        (50, 40, 99, "expected 100 ms or more, twice tick_ms, got 99"),
    ],
)
def test_a_timeout_is_twice_cycle_and_tick(
    machine: Machine, tick: int, cycle: int, timeout: int, says: str
) -> None:
    machine.in_yaml("tick_ms: 20", f"tick_ms: {tick}")
    machine.in_dbc("BO_ 272 20;", f"BO_ 272 {cycle};")
    line = machine.in_yaml("timeout_ms: 100", f"timeout_ms: {timeout}")
    reported = [p for p in machine.problems() if "joysticks.left." in p]
    assert reported == [f"machine.yaml:{line}: joysticks.left.timeout_ms: {says}"]
    machine.in_yaml(f"timeout_ms: {timeout}", f"timeout_ms: {2 * max(tick, cycle)}")
    if tick == 20:
        assert machine.load().joysticks["left"].config.timeout_ms == 2 * max(tick, cycle)


def test_a_radius_on_change_has_a_timeout_of_two_ticks(machine: Machine) -> None:
    """Its message has no cycle; only a tick looks at it."""
    radius = "bus: crane, message: TipPosition, signal: Radius, timeout_ms: 39"
    machine.in_dbc('BA_ "GenMsgCycleTime" BO_ 1025 20;\n', "")
    line = machine.in_yaml("axes:\n", RADIUS % radius + "axes:\n")
    assert (
        f"machine.yaml:{line}: motion.crane.radius.timeout_ms: expected 40 ms or more, twice"
        " tick_ms, got 39"
    ) in machine.problems()


def test_a_timeout_is_not_compared_with_a_cycle_that_is_none(machine: Machine) -> None:
    machine.in_dbc("BO_ 512 20;", "BO_ 512 0;")
    machine.in_yaml("signal: Velocity, timeout_ms: 200", "signal: Velocity, timeout_ms: 50")
    line = machine.in_dbc("BO_ 512 SlewCommand", "BO_ 512 SlewCommand")
    assert machine.problems() == [
        f"machine.dbc:{line}: SlewCommand: GenMsgCycleTime: expected a multiple of tick_ms, 20 ms,"
        " got none"
    ]
