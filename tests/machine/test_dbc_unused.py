"""DBC files as they are: faults of messages that are not used, and how one is read later."""

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine.dbc_text import signals_fault
from tests.machine.plain_dbc import OTHER, parts, whole
from tests.rigs.files import Machine


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("8|8@1+", "9|8@1+", 1, "Other: has 2 bytes, and the signal Two is not within them"),
        ("8|8@1+", "8|8@0+", 1, "Other: has 2 bytes, and the signal Two is not within them"),
        ("8|8@1+", "15|9@0+", 1, "Other: has 2 bytes, and the signal Two is not within them"),
        ("8|8@1+", "8|0@1+", 1, "Other: has 2 bytes, and the signal Two is not within them"),
        ("8|8@1+", "-1|8@1+", 1, "Other: has 2 bytes, and the signal Two is not within them"),
        ("8|8@1+", "8|1.5@1+", 1, "Other: has 2 bytes, and the signal Two is not within them"),
        ("8|8@1+", "7|8@1+", 1, "Other: has overlapping signals, One and Two"),
        ("Two : 8|8", "One : 8|8", 1, "Other: has two signals of the name One"),
        ("8|8@1+", "7|8@0+", 1, "Other: has overlapping signals, One and Two"),
        ("8|8@1+", "8|999999999@1+", 1, "the signal Two is not within them"),
        ("BO_ 5", "BO_ 2048", 1, "Other: has the id 0x800 of more than 11 bits; an id of 29"),
        ("BO_ 5", "BO_ 2684354560", 1, "Other: has the id 0x20000000 of more than 29 bits"),
        ("BO_ 5", "BO_ 1024", 1, "Other: has the id 0x400 of GrappleSway"),
        ("Two : 8|8", 'Two : 8|8@1+ (1,0) [0|0] "" A\n SG_ A m1 : 0|1', 1, "One and A"),
        ("Two : 8|8", 'Two m1 : 8|8@1+ (1,0) [0|0] "" A\n SG_ A : 15|1', 1, "Two and A"),
        ("Two : 8|8", 'Two m1 : 8|8@1+ (1,0) [0|0] "" A\n SG_ A m1 : 15|1', 1, "Two and A"),
        (
            ' "" A\n SG_ T',
            ' "" A\n\nVAL_ 5 None 1 "on" ;\nBO_ 6 X: 8 A\n SG_ T',
            4,
            "VAL_ 5 None is",
        ),
        ("BO_ 5", 'VAL_ 77 None 1 "on" ;\nBO_ 5', 1, "VAL_ 77 None is of a signal that"),
        ("BO_ 5", "SIG_VALTYPE_ 5 None : 1;\nBO_ 5", 1, "SIG_VALTYPE_ 5 None is of a signal"),
    ],
)
def test_a_fault_of_a_message_that_is_not_used_is_a_warning(
    machine: Machine, old: str, new: str, line: int, says: str
) -> None:
    machine.in_yaml("dbc: [", "dbc: [")
    first = machine.in_dbc("CM_ ", OTHER.replace(old, new, 1) + "\nCM_ ")
    count, (warning,) = machine.load().messages.warnings()
    assert count == 1
    assert str(warning).startswith(f"{machine.directory}/machine.dbc:{first + line - 1}: ")
    assert says in str(warning)


def test_a_message_too_long_for_any_protocol_is_not_compared(machine: Machine) -> None:
    """So that a file takes no more time than others of its size."""
    same = 'SG_ S : 0|8@1+ (1,0) [0|0] "" A\n'
    for length, count in ((4095, 1), (4096, 0)):
        machine.in_dbc("CM_ ", f"BO_ {length - 4000} L{length}: {length} A\n {same} {same}\nCM_ ")
        assert machine.load().messages.warnings()[0] == 1, count


def test_all_warnings_are_counted_and_the_first_kept(machine: Machine) -> None:
    rows = "".join(f'VAL_ {n} None 1 "on" ;\n' for n in range(2000, 2150))
    machine.in_dbc("CM_ ", f"{rows}{OTHER.replace('8|8', '9|8')}\nCM_ ")
    count, warnings = machine.load().messages.warnings()
    assert (count, len(warnings)) == (151, 100)
    assert "Other" in str(warnings[0])


def test_check_shows_the_first_of_them(machine: Machine) -> None:
    machine.load()
    command = ["check", str(machine.directory / "machine.yaml")]
    assert "not used" not in CliRunner().invoke(app, command).output
    line = machine.in_dbc("CM_ ", 'VAL_ 2000 None 1 "on" ;\nCM_ ')
    machine.load()
    shown = CliRunner().invoke(app, command)
    assert shown.exit_code == 0
    path = machine.directory / "machine.dbc"
    assert "  1 WARNING in messages and tables that are not used:" in shown.output
    assert f"    {path}:{line}: VAL_ 2000 None is of a signal that there is not\n" in shown.output
    assert "more" not in shown.output.split("not used:")[1].split("  bus")[0]
    machine.in_dbc("CM_ ", 'VAL_ 2000 None 1 "on" ;\n' * 10 + "CM_ ")
    machine.load()
    shown = CliRunner().invoke(app, command)
    assert "  11 WARNINGS in messages and tables that are not used:" in shown.output
    assert shown.output.count("that there is not") == 10
    assert "    and 1 more\n" in shown.output


# -- read when they are asked for -----------------------------------------------------------------


def test_another_message_is_read_when_it_is_asked_for(machine: Machine) -> None:
    messages = machine.load().messages
    entry = messages.find("TipPosition")
    assert not isinstance(entry, str)
    file, message = entry
    path = machine.directory / "machine.dbc"
    assert parts(message) == parts(whole(path).get_message_by_name("TipPosition"))
    assert str(file.problem(message, "x")).endswith(
        f"machine.dbc:{machine.in_dbc('BO_ 1025', 'BO_ 1025')}: TipPosition: x"
    )
    path.unlink()
    assert messages.find("TipPosition") == entry
    assert messages.find("GrappleSway") == f"{path}: No such file or directory"


def overlap(length: int, *signals: str) -> str | None:
    text = "".join(f' SG_ {signal}+ (1,0) [0|0] "" A\n' for signal in signals)
    names, text_of_fault = signals_fault(text.encode(), length)
    assert names == [signal.split()[0].encode() for signal in signals]
    return text_of_fault


@pytest.mark.parametrize(
    ("length", "signals"),
    [
        (1, ("A m0 : 0|8@1", "B m1 : 0|8@1")),
        (2, ("M M : 0|8@1", "A m0 : 8|8@1", "B m1 : 8|8@1")),
        (2, ("A : 8|8@1", "B m0 : 0|8@1", "C m1 : 0|8@1")),
        # which is of which is not known
        (2, ("M M : 0|4@1", "N m0M : 4|4@1", "B m1 : 4|8@1", "C m1 : 8|8@1")),
        (2, ("M M : 0|4@1", "N m0M : 4|4@1", "O m1M : 4|4@1", "B m1 : 8|8@1", "C m1 : 8|8@1")),
        (0, ()),
        (2, ("A m0 : 8|8@1", "B m0 : 0|8@1")),
        (2, ("A : 7|8@0", "B : 15|8@0")),
        (3, ("A : 7|8@0", "B : 15|8@0", "C : 23|8@0")),
        (2, ("A : 7|4@0", "B : 0|4@1")),
        (2, ("A : 3|8@0", "B : 4|4@1", "C : 8|4@1")),
    ],
)
def test_signals_without_a_common_bit_have_no_fault(length: int, signals: tuple[str, ...]) -> None:
    assert overlap(length, *signals) is None


@pytest.mark.parametrize(
    ("length", "signals", "first", "second"),
    [
        (1, ("M M : 0|8@1", "A m0 : 4|4@1"), "M", "A"),
        (2, ("M M : 0|8@1", "A m0 : 8|8@1", "B m0 : 12|4@1"), "A", "B"),
        (2, ("M M : 0|4@1", "N m0M : 4|4@1", "A : 8|8@1", "B : 8|8@1"), "A", "B"),
        (1, ("A : 0|4@1", "B : 4|4@1", "C : 0|4@1"), "A", "C"),
        (2, ("A : 7|4@0", "B : 4|4@1"), "A", "B"),
        (2, ("A : 3|8@0", "B : 12|4@1"), "A", "B"),
        (2, ("A : 0|12@1", "B : 8|4@1"), "A", "B"),
    ],
)
def test_signals_with_a_common_bit_overlap(
    length: int, signals: tuple[str, ...], first: str, second: str
) -> None:
    assert overlap(length, *signals) == f"has overlapping signals, {first} and {second}"
