"""DBC files: those that are none, and those that contradict themselves or another."""

import pytest

from tests.rigs.files import Machine


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


def test_every_file_is_looked_at(machine: Machine) -> None:
    machine.in_yaml("[machine.dbc]", "[none.dbc, machine.dbc, text.dbc]")
    (machine.directory / "text.dbc").write_text("hello", encoding="cp1252")
    problems = machine.problems()
    assert len(problems) == 2
    assert problems[0].endswith("dbc.0: expected a file, got 'none.dbc': No such file or directory")
    assert problems[1].startswith("text.dbc:1: not a DBC file")
