"""DBC files: those that are none, and messages that cannot do what a deployment asks of them."""

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.shaping.states import Reason
from tests.rigs.files import Machine

SLEW_JOYSTICK = "Slew : 0|16@1- (0.1,0) [-100|100]"
SLEW_VALVE = "Velocity : 0|8@1- (0.8,0) [-100|100]"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "machine.dbc:1: not a DBC file that can be used: Invalid syntax at line 1, column 1"),
        ("hello\n", "machine.dbc:1: not a DBC file that can be used: Invalid syntax at line 1"),
        ("\x00\x01\xff\xfe", "machine.dbc:1: not a DBC file that can be used: Invalid syntax"),
        (
            'VERSION "1"\n\nBU_: A\n\nBO_ 1 M: 8 A\n SG_ S : 0 16@1- (1,0) [0|0] "" A\n',
            "machine.dbc:6: not a DBC file that can be used: Invalid syntax at line 6",
        ),
        (
            'VERSION "1"\n\nBO_ 1 JoystickLeft: 1 A\n SG_ S : 0|16@1- (1,0) [0|0] "" A\n',
            "machine.dbc:3: not a DBC file that can be used: The signal S does not fit",
        ),
        (
            f'VERSION "1"\n\nBO_ {"9" * 5000} M: 8 A\n',
            "machine.dbc: not a DBC file that can be used: Exceeds the limit (4300 digits)",
        ),
        # seen at the next statement only, which is that of a message that is not used
        (
            'VERSION "1"\n\nCM_ "end"\nBO_ 1 M: 1 A\n\nCM_ "end"\n',
            "machine.dbc:4: not a DBC file that can be used: Invalid syntax at line 4",
        ),
        (
            'VERSION "1"\n\nBO_ 1 M: 1 A\n\nCM_ "end\n',
            "machine.dbc:5: not a DBC file that can be used: Invalid syntax at line 5",
        ),
    ],
)
def test_what_is_no_dbc_file_is_one_problem(machine: Machine, text: str, says: str) -> None:
    machine.dbc = text
    (problem,) = machine.problems()
    assert problem.startswith(says)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("none.dbc", "expected a file, got 'none.dbc': No such file or directory"),
        (".", "expected a file, got '.': Is a directory"),
        ("''", "expected a file, got '': Is a directory"),
        ("n" * 300, "File name too long"),
    ],
)
def test_a_dbc_file_that_cannot_be_read(machine: Machine, name: str, says: str) -> None:
    line = machine.in_yaml("[machine.dbc]", f"[machine.dbc, {name}]")
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.yaml:{line}: dbc.1: ")
    assert problem.endswith(says)


def test_a_dbc_file_without_messages(machine: Machine) -> None:
    machine.dbc = 'VERSION "1"\n'
    problems = machine.problems()
    assert len(problems) == 10  # each message asked for is missed once
    assert all("expected a message of the DBC files, got " in p for p in problems)
    assert all(p.endswith("; there are none") for p in problems)


@pytest.mark.parametrize(
    ("old", "new", "number"),
    [
        ("BO_ 272 JoystickLeft: 8", "BO_ 272 JoystickLeft : 2147483920", "2147483920"),
        ("SG_ Slew : 0|16@1-", "SG_ Slew : 100000000|16@1-", "100000000"),
        ("SG_ Slew : 0|16@1-", "SG_ Slew m0: 0 | 100000@1-", "100000"),
    ],
)
def test_sizes_that_no_memory_holds(machine: Machine, old: str, new: str, number: str) -> None:
    line = machine.in_dbc(old, new)
    assert machine.problems() == [
        f"machine.dbc:{line}: not a DBC file that can be used:"
        f" expected 99999 bytes or bits at most, got {number}"
    ]


def test_overlapping_signals_are_reported_at_their_message(machine: Machine) -> None:
    machine.in_dbc("NearFar : 16|16@1-", "NearFar : 8|16@1-")
    line = machine.in_dbc("BO_ 272", "BO_ 272")
    assert machine.problems() == [
        f"machine.dbc:{line}: not a DBC file that can be used:"
        " The signals NearFar and Slew are overlapping in message JoystickLeft."
    ]


def test_a_table_without_its_signal_is_a_warning_and_named_by_none(machine: Machine) -> None:
    """It gives names only, and no signal has them."""
    machine.in_dbc("VAL_ 272 Enable", 'VAL_ 272 Enabel 1 "Leftover" ;\nVAL_ 272 Enable')
    line = machine.in_dbc("VAL_ 272 Enabel", "VAL_ 272 Enabel")
    deployment = machine.load()
    count, (warning,) = deployment.messages.warnings()
    assert count == 1
    path = machine.directory / "machine.dbc"
    assert str(warning) == f"{path}:{line}: VAL_ 272 Enabel is of a signal that there is not"
    enable = deployment.joysticks["left"].message.get_signal_by_name("Enable")
    assert "Leftover" not in {str(name) for name in (enable.choices or {}).values()}


def test_a_type_without_its_signal_is_reported_at_the_type(machine: Machine) -> None:
    machine.in_dbc("VAL_ 272 Enable", "SIG_VALTYPE_ 272 Enabel : 1;\nVAL_ 272 Enable")
    line = machine.in_dbc("SIG_VALTYPE_ 272", "SIG_VALTYPE_ 272")
    (problem,) = machine.problems()
    assert problem.startswith(
        f"machine.dbc:{line}: not a DBC file that can be used: unused SIG_VALTYPE_"
    )


def test_one_id_twice_in_one_file(machine: Machine) -> None:
    line = machine.in_dbc("BO_ 513 NearFarCommand", "BO_ 512 NearFarCommand")
    machine.in_dbc("CM_ SG_ 513", "CM_ SG_ 512")
    assert f"machine.dbc:{line}: NearFarCommand: has the id 0x200 of SlewCommand" in (
        machine.problems()
    )


def test_one_message_in_two_files(machine: Machine) -> None:
    line = machine.in_yaml("[machine.dbc]", "[machine.dbc, other.dbc]") + 5
    other = 'VERSION ""\n\nBU_: A\n\nBO_ 7 JoystickLeft: 1 A\n SG_ S : 0|8@1- (1,0) [0|0] "" A\n'
    (machine.directory / "other.dbc").write_text(other, encoding="cp1252")
    assert machine.problems() == [
        f"machine.yaml:{line}: joysticks.left.message: 'JoystickLeft' stands more than once in the"
        " DBC files: machine.dbc, other.dbc"
    ]


def test_every_file_is_looked_at(machine: Machine) -> None:
    machine.in_yaml("[machine.dbc]", "[none.dbc, machine.dbc, text.dbc]")
    (machine.directory / "text.dbc").write_text("hello", encoding="cp1252")
    problems = machine.problems()
    assert len(problems) == 2
    assert problems[0].endswith("dbc.0: expected a file, got 'none.dbc': No such file or directory")
    assert problems[1].startswith("text.dbc:1: not a DBC file")


def test_messages_of_several_files_come_together(machine: Machine) -> None:
    head, rest = machine.dbc.split("BO_ 1024 GrappleSway", 1)
    body, tail = rest.split("CM_ ", 1)
    machine.dbc = (
        head
        + "CM_ "
        + "\n".join(
            r for r in tail.splitlines() if not any(f"BO_ {n} " in r for n in (1024, 1025, 1026))
        )
    )
    other = 'VERSION ""\n\nBU_: PLANT SHAPER\n\nBO_ 1024 GrappleSway' + body
    (machine.directory / "other.dbc").write_text(other, encoding="cp1252")
    machine.in_yaml("[machine.dbc]", "[other.dbc, machine.dbc]")
    entry = machine.load().messages.find("GrappleSway")
    assert not isinstance(entry, str)
    assert entry[0].path.name == "other.dbc"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            [("JoystickLeft: 8", "JoystickLeft: 9")],
            "joysticks.left.message: JoystickLeft: expected a message of classical CAN, 8 bytes at"
            " most, got 9 bytes: bus crane has no fd: true",
        ),
        (
            [("SlewCommand: 2", "SlewCommand: 12")],
            "axes.slew.valve.message: SlewCommand: expected a message of classical CAN, 8 bytes at"
            " most, got 12 bytes: bus crane has no fd: true",
        ),
        (
            [("Slew : 0|16", "Slew m0 : 0|16"), ("Enable : 32", "Enable M : 32")],
            "joysticks.left.message: JoystickLeft is multiplexed; without multiplexor"
            " nothing can be taken from it",
        ),
        (
            [("Velocity : 0|8", "Velocity m0 : 0|8"), ("Counter : 8|8", "Counter M : 8|8")],
            "axes.slew.valve.message: SlewCommand is multiplexed; without multiplexor"
            " nothing can be sent in it",
        ),
    ],
)
def test_messages_of_another_kind(
    machine: Machine, changes: list[tuple[str, str]], says: str
) -> None:
    for old, new in changes:
        machine.in_dbc(old, new)
    (problem,) = machine.problems()
    assert problem.startswith("machine.yaml:")
    assert problem.endswith(says)


@pytest.mark.parametrize(
    ("old", "new", "of", "says"),
    [
        # full scale
        (
            SLEW_JOYSTICK,
            "Slew : 0|16@1- (0.1,0) [0|0]",
            "JoystickLeft",
            "Slew has no range in the DBC",
        ),
        (
            SLEW_JOYSTICK,
            "Slew : 0|16@1- (0.1,0) [-100|102]",
            "JoystickLeft",
            "Slew: expected a symmetrical range, got [-100|102]",
        ),
        (
            SLEW_JOYSTICK,
            "Slew : 0|16@1+ (0.1,0) [-100|100]",
            "JoystickLeft",
            "Slew cannot reach its",
        ),
        (
            SLEW_JOYSTICK,
            "Slew : 0|16@1- (0,0) [-100|100]",
            "JoystickLeft",
            "Slew: expected a scale other than 0, got 0",
        ),
        (SLEW_VALVE, "Velocity : 0|8@1- (0.8,0) [0|0]", "SlewCommand", "Velocity has no range"),
        (
            SLEW_VALVE,
            "Velocity : 0|8@1- (0.8,0) [0|100]",
            "SlewCommand",
            "a symmetrical range, got [0|100]",
        ),
        (
            SLEW_VALVE,
            "Velocity : 0|8@1- (0.4,0) [-100|100]",
            "SlewCommand",
            "Velocity cannot reach its range [-100|100] with 8 bits at 0.4 per bit",
        ),
        (SLEW_VALVE, "Velocity : 0|8@1- (11,0) [-100|100]", "SlewCommand", "fewer than 10 steps"),
        (
            SLEW_VALVE,
            "Velocity : 0|8@1+ (0.8,-102.3) [-100|100]",
            "SlewCommand",
            "Velocity has no raw value for zero",
        ),
        # cycle times
        ("BO_ 272 20;", "BO_ 272 0;", "JoystickLeft", "has no GenMsgCycleTime"),
        (
            "BO_ 512 20;",
            "BO_ 512 0;",
            "SlewCommand",
            "GenMsgCycleTime: expected a multiple of tick_ms, 20 ms, got none",
        ),
        (
            "BO_ 512 20;",
            "BO_ 512 50;",
            "SlewCommand",
            "GenMsgCycleTime: expected a multiple of tick_ms, 20 ms, got 50 ms",
        ),
        (
            "BO_ 512 20;",
            "BO_ 512 220;",
            "SlewCommand",
            "GenMsgCycleTime: expected up to 200 ms for a valve, got 220 ms",
        ),
        ("BO_ 784 500;", "BO_ 784 0;", "ShaperStatus", "a multiple of tick_ms, 20 ms, got none"),
        ("BO_ 768 100;", "BO_ 768 110;", "SlewStatus", "a multiple of tick_ms, 20 ms, got 110 ms"),
        # status
        ("State : 0|4@1+", "State : 0|2@1+", "SlewStatus", "State cannot carry 5 with 2 bits"),
        (
            "Reason : 8|8",
            "Reason : 8|6",
            "SlewStatus",
            f"cannot carry {max(Reason)} with",
        ),
        (
            "LastFault : 0|8",
            "LastFault : 0|2",
            "ShaperStatus",
            f"cannot carry {max(FrameFault)}",
        ),
        (
            "PredictedSway : 48|16@1- (0.01,0)",
            "PredictedSway : 48|16@1- (0,0)",
            "SlewStatus",
            "PredictedSway: expected an integer signal with a scale, got a scale of 0",
        ),
        (" SG_ SendFailures :", " SG_ Sends :", "ShaperStatus", "lacks the signals SendFailures"),
    ],
)
def test_what_a_message_of_the_dbc_cannot_do(
    machine: Machine, old: str, new: str, of: str, says: str
) -> None:
    machine.in_dbc(old, new)
    start = next(
        i for i, row in enumerate(machine.dbc.splitlines(), 1) if row[:3] == "BO_" and of in row
    )
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.dbc:{start}: {of}: ")
    assert says in problem


def test_a_range_at_the_last_bit_is_reached_in_spite_of_rounding(machine: Machine) -> None:
    # 88.9 / 0.7 is a little more than 127 in floating point
    machine.in_dbc(SLEW_VALVE, "Velocity : 0|8@1- (0.7,0) [-88.9|88.9]")
    assert machine.load().axes["slew"].valve.steps == 127


@pytest.mark.parametrize(
    ("changes", "type_of", "says"),
    [
        (
            [("SlewCommand: 2", "SlewCommand: 8"), ("0|8@1- (0.8", "32|32@1- (0.8")],
            "512 Velocity",
            "axes.slew.valve.signal: Velocity: expected an integer signal, got a float",
        ),
        (
            [("SlewCommand: 2", "SlewCommand: 8"), ("Counter : 8|8@1+", "Counter : 8|32@1-")],
            "512 AliveCounter",
            "axes.slew.valve.alive_counter: AliveCounter: expected an unsigned integer signal, got"
            " a float",
        ),
        (
            [
                ("Sway : 48|16@1-", "Sway : 32|32@1-"),
                ("RawCommand : 16|16", "RawCommand : 16|8"),
                ("ShapedCommand : 32|16", "Shaped : 24|8"),
            ],
            "768 PredictedSway",
            "PredictedSway: expected an integer signal with a scale, got a float",
        ),
        (
            [
                ("NearFar : 16|16", "NearFar : 16|2"),
                ("Slew : 0|16", "Slew : 18|14"),
                ("Enable : 32|2", "Enable : 0|2"),
                ("AntiSwayOff : 34", "AntiSwayOff : 2"),
                ("Reset : 36", "Reset : 4"),
                ("Counter : 56|8@1+", "Counter : 32|32@1-"),
            ],
            "272 AliveCounter",
            "joysticks.left.alive_counter: AliveCounter: expected an unsigned integer signal, got"
            " a float",
        ),
    ],
)
def test_floats_where_whole_numbers_are_needed(
    machine: Machine, changes: list[tuple[str, str]], type_of: str, says: str
) -> None:
    for old, new in changes:
        at = machine.dbc.index(f"BO_ {type_of.split(maxsplit=1)[0]} ")
        machine.dbc = machine.dbc[:at] + machine.dbc[at:].replace(old, new, 1)
    machine.dbc += f"SIG_VALTYPE_ {type_of} : 1;\n"
    assert any(says in p for p in machine.problems())


def test_a_counter_with_a_sign_cannot_count(machine: Machine) -> None:
    at = machine.dbc.index("BO_ 512 ")
    machine.dbc = machine.dbc[:at] + machine.dbc[at:].replace("er : 8|8@1+", "er : 8|8@1-", 1)
    (problem,) = machine.problems()
    assert problem.endswith(
        "axes.slew.valve.alive_counter: AliveCounter: expected an unsigned integer signal, got a"
        " signed one"
    )


@pytest.mark.parametrize(
    ("old", "new", "message", "says"),
    [
        (
            "Slew : 0|16",
            "Slew : -1|16",
            "JoystickLeft",
            "Slew: expected a start bit of 0 or more, got -1",
        ),
        (
            '"GenMsgCycleTime" INT',  # a type that there is not: everything is text
            '"GenMsgCycleTime" nanINT',
            "JoystickLeft",
            "GenMsgCycleTime: expected a whole number of ms, got '20'",
        ),
    ],
)
def test_numbers_that_are_none_are_reported(
    machine: Machine, old: str, new: str, message: str, says: str
) -> None:
    machine.in_dbc(old, new)
    assert any(f"{message}: {says}" in problem for problem in machine.problems())
