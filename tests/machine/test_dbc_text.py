"""DBC files as they are: what belongs to messages that are not used, judged by plain cantools."""

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine import database, dbc_parse, dbc_text, lookup
from canshaper.machine.database import Messages, load_dbc
from tests.rigs.files import ROOT, Machine

FILES = sorted((ROOT / "dbc").glob("*.dbc"))
# One of each kind of statement that can belong to a message.
KINDS = """VERSION "1"
NS_ :
\tBA_
\tVAL_
BS_:
BU_: A B
VAL_TABLE_ Switch 1 "on" 0 "off" ;
BO_ 2147483905 Long: 8 A // a comment; "no string
 SG_ Kind M : 0|8@1+ (1,0) [0|0] "" B
 SG_ One m0 : 8|8@1- (0.5,1e1)
   [-1|1.5] "BO_ 7 None: 8 A" A, B // BO_ 8 Nothing: 8 A
 SG_ Two m1 : 8|8@1+ (1,0) [0|0] "" B

BO_ 1 Short: 8 B
 SG_ Up : 7|16@0+ (1,0) [0|0] "" A
 SG_ Real : 32|32@1- (1,0) [0|0] "" A
BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ Alone : 0|8@1+ (1,0) [0|0] "" A
BO_TX_BU_ 1 : A,B;
CM_ "text of \\"all\\";
BO_ 9 Nobody: 8 A";
CM_ BU_ A "CM_ BO_ 1 \\"of a node\\";";
CM_ BO_ 1 "first line
BO_ 5 Second: 8 A
";
CM_ SG_ 2147483905 One "of a signal; VAL_ 1 Up 0 \\"x\\" ;";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_ "SystemMessageLongSymbol" STRING ;
BA_DEF_ SG_ "GenSigStartValue" FLOAT -1000 1000;
BA_DEF_REL_ BU_BO_REL_ "Deadline" INT 0 65535;
BA_DEF_REL_ BU_SG_REL_ "Timeout" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 100;
BA_DEF_DEF_ "SystemMessageLongSymbol" "";
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_DEF_DEF_REL_ "Deadline" 0;
BA_DEF_DEF_REL_ "Timeout" 0;
BA_ "GenMsgCycleTime" BO_ 1 20;
BA_ "SystemMessageLongSymbol" BO_ 2147483905 "ALongerName";
BA_ "GenSigStartValue" SG_ 1 Up 5;
BA_REL_ "Deadline" BU_BO_REL_ A 1 20;
BA_REL_ "Timeout" BU_SG_REL_ B SG_ 2147483905 One 30;
VAL_ 1 Up 1 "one" 2 "two; VAL_ 3" ;
VAL_ 2147483905 One 0 "none" ;
SIG_VALTYPE_ 1 Real : 1;
SIG_GROUP_ 2147483905 Both 1 : One Two;
SG_MUL_VAL_ 2147483905 Two Kind 1-1, 3-4;
"""


def parts(message: Any) -> list[Any]:
    """All of a message that anything here reads."""
    keys = ("name", "frame_id", "is_extended_frame", "length", "cycle_time", "comment", "protocol")
    of_signal = (
        *("name", "start", "length", "byte_order", "is_signed", "is_float", "scale", "offset"),
        *("minimum", "maximum", "unit", "raw_initial", "comment", "receivers", "spn"),
        *("is_multiplexer", "multiplexer_ids", "multiplexer_signal"),
    )
    values: list[Any] = [getattr(message, key) for key in (*keys, "senders", "send_type")]
    values += [[(group.name, group.signal_names) for group in message.signal_groups or []]]
    for signal in message.signals:
        choices = {raw: str(name) for raw, name in (signal.choices or {}).items()}
        values.append([choices, *(getattr(signal, key) for key in of_signal)])
    return values


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "one.dbc"


def whole(path: Path) -> Any:
    return cantools.database.load_file(path, encoding="cp1252")


def compare(path: Path, names: set[str]) -> None:
    """The messages of a file are those that cantools finds in all of it."""
    loaded, problems = load_dbc(path, names)
    assert loaded
    assert not problems
    expected = {m.name: parts(m) for m in whole(path).messages if m.name in names}
    assert {m.name: parts(m) for m in loaded.messages} == expected
    rows = path.read_text(encoding="cp1252").split("\n")
    for entry in loaded.entries:
        assert entry.line
        assert str(entry.number) in rows[entry.line - 1]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_each_message_is_that_of_the_whole_file(path: Path) -> None:
    names = sorted(message.name for message in whole(path).messages)
    for name in names:
        compare(path, {name})
    for seed in range(10):
        compare(path, set(random.Random(seed).sample(names, len(names) // 2)))
    compare(path, set(names))


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    "names", [{"ALongerName"}, {"Short"}, {"Short", "ALongerName"}, set[str]()]
)
def test_each_kind_of_statement(file: Path, names: set[str], ends: str) -> None:
    file.write_bytes(KINDS.replace("\n", ends).encode("cp1252"))
    loaded, problems = load_dbc(file, names)
    assert loaded
    assert not problems
    assert (loaded.count, loaded.warnings) == (0, [])
    assert [(e.name, e.key) for e in loaded.entries] == [
        ("ALongerName", (257, True)),
        ("Short", (1, False)),
    ]
    assert [e.line for e in loaded.entries] == [8, 14]
    expected = [parts(m) for m in whole(file).messages if m.name in names]
    assert [parts(m) for m in loaded.messages] == expected


def test_nothing_of_other_messages_is_parsed(file: Path) -> None:
    file.write_text(KINDS, encoding="cp1252")
    text = dbc_text.dbc_text(file.read_bytes())
    assert text.entries
    rest = text.of({1})
    assert rest.count("\n") == KINDS.count("\n")
    assert "2147483905" not in rest
    assert "VAL_TABLE_" not in rest
    assert "3221225472" not in rest
    nothing: Any = cantools.database.load_string(text.of(()), "dbc")
    assert nothing.messages == []
    assert text.whole() == KINDS


@given(st.integers(0, 2**32), st.booleans())
def test_a_broken_statement_is_the_same_problem_as_in_the_whole_file(
    tmp_path_factory: pytest.TempPathFactory, seed: int, drop: bool
) -> None:
    """A token taken out or put in anywhere: the same messages as by cantools, or a problem."""
    path = tmp_path_factory.getbasetemp() / "broken.dbc"
    rnd = random.Random(seed)
    tokens = KINDS.split(" ")
    at = rnd.randrange(len(tokens))
    tokens[at : at + drop] = [] if drop else [rnd.choice(tokens)]
    path.write_text(" ".join(tokens), encoding="cp1252")
    loaded, problems = load_dbc(path, {"Short"})
    try:
        expected = [parts(m) for m in whole(path).messages if m.name == "Short"]
    except Exception:
        return  # a fault in what is not used may be a warning
    assert loaded, problems
    assert [parts(m) for m in loaded.messages if m.name == "Short"] == expected


# -- messages that are not used -------------------------------------------------------------------

OTHER = 'BO_ 5 Other: 2 A\n SG_ One : 0|8@1+ (1,0) [0|0] "" A\n SG_ Two : 8|8@1+ (1,0) [0|0] "" A\n'


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


def with_signals(*signals: str) -> Iterator[str]:
    yield "BO_ 5 Other: 2 A"
    for name in signals:
        yield f' SG_ {name}@1+ (1,0) [0|0] "" A'


@pytest.mark.parametrize(
    "signals",
    [
        ("M M : 0|8", "A m0 : 8|8", "B m1 : 8|8"),
        ("A : 8|8", "B m0 : 0|8", "C m1 : 0|8"),
        ("M M : 0|4", "N m0M : 4|4", "B m1 : 4|8", "C m1 : 8|8"),  # which is of which is not known
        ("M M : 0|4", "N m0M : 4|4", "O m1M : 4|4", "B m1 : 8|8", "C m1 : 8|8"),
        (),
    ],
)
def test_signals_that_exclude_each_other_may_overlap(
    machine: Machine, signals: tuple[str, ...]
) -> None:
    machine.in_dbc("CM_ ", "\n".join(with_signals(*signals)) + "\n\nCM_ ")
    assert machine.load().messages.warnings() == (0, [])


def test_a_message_too_long_for_any_protocol_is_not_compared(machine: Machine) -> None:
    """So that a file takes no more time than others of its size."""
    same = 'SG_ S : 0|8@1+ (1,0) [0|0] "" A\n'
    for length, count in ((4095, 1), (4096, 0)):
        machine.in_dbc("CM_ ", f"BO_ {length - 4000} L{length}: {length} A\n {same} {same}\nCM_ ")
        assert machine.load().messages.warnings()[0] == 1, count


def test_an_id_that_a_used_message_has_is_a_problem(machine: Machine) -> None:
    line = machine.in_dbc("CM_ ", OTHER.replace("BO_ 5", "BO_ 272") + "\nCM_ ")
    assert machine.problems() == [f"machine.dbc:{line}: Other: has the id 0x110 of JoystickLeft"]


def test_all_warnings_are_counted_and_the_first_kept(machine: Machine) -> None:
    rows = "".join(f'VAL_ {n} None 1 "on" ;\n' for n in range(2000, 2150))
    machine.in_dbc("CM_ ", f"{rows}{OTHER.replace('8|8', '9|8')}\nCM_ ")
    count, warnings = machine.load().messages.warnings()
    assert (count, len(warnings)) == (151, 100)
    assert "Other" in str(warnings[0])


def test_their_ids_and_names_are_known(machine: Machine) -> None:
    machine.in_dbc("CM_ ", OTHER + OTHER.replace("BO_ 5 O", "BO_ 2147483653 Wide") + "\nCM_ ")
    messages = machine.load().messages
    assert {(5, False), (5, True), (272, False)} <= messages.ids()
    assert messages.named({(5, False), (5, True), (6, False)}) == ["Other", "Widether"]
    assert "Other" not in {m.name for m in messages.all()}
    names = ", ".join(messages.named(messages.ids()))
    assert (
        messages.find("None")
        == f"expected a message of the DBC files, got 'None'; there are {names}"
    )


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


def test_another_message_that_cannot_be_used(machine: Machine) -> None:
    machine.in_dbc("CM_ ", OTHER.replace("8|8", "9|8") + "\nCM_ ")
    result = machine.load().messages.find("Other")
    assert isinstance(result, str)
    assert "The signal Two does not fit in message Other" in result


def test_a_file_that_has_changed_is_not_mixed_with_what_was_read(machine: Machine) -> None:
    messages = machine.load().messages
    machine.in_dbc("BO_ 1025", "BO_ 1055")
    path = machine.directory / "machine.dbc"
    path.write_text(machine.dbc.split("CM_ ")[0], encoding="cp1252")
    assert messages.find("TipPosition") == f"{path}: has changed since it was read"


SYMBOL = 'BA_ "SystemMessageLongSymbol" BO_ 1'


@pytest.mark.parametrize("symbol", ["a\nb", 'a\\"b'])
def test_a_long_name_that_is_none(file: Path, symbol: str) -> None:
    """cantools takes it; no one can name it."""
    file.write_text(KINDS + f'{SYMBOL} "{symbol}";\n', encoding="cp1252")
    loaded, _ = load_dbc(file, ())
    assert loaded
    assert [e.name for e in loaded.entries] == ["ALongerName", "Short"]
    result = Messages([loaded]).find("Short")
    assert result == f"{file}: 'Short' has another name for the parser"


def test_an_empty_long_name(file: Path) -> None:
    file.write_text(KINDS + f'{SYMBOL} "";\n', encoding="cp1252")
    loaded, _ = load_dbc(file, {""})
    assert loaded
    assert [m.name for m in loaded.messages] == [e.name for e in loaded.entries[1:]] == [""]


def test_all_that_can_be_loaded(file: Path) -> None:
    """For who asks which there are."""
    file.write_text(OTHER + OTHER.replace("BO_ 5 O", "BO_ 6 Bad_o").replace("8|8", "9|8"), "cp1252")
    loaded, problems = load_dbc(file)
    assert loaded
    assert not problems
    assert [m.name for m in loaded.messages] == ["Other"]
    assert loaded.count == 1
    assert Messages([loaded]).find("None") == (
        "expected a message of the DBC files, got 'None'; there are Bad_other, Other"
    )
    for row in (
        OTHER,  # two of one id
        "SIG_VALTYPE_ 5 One : 1;\n",  # a float of 8 bits
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","J1939PG";\n'
        'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";\nBA_ "VFrameFormat" BO_ 5 1;\n',
    ):
        file.write_text(f"{OTHER}{OTHER.replace('5 Other', '6 Next')}{row}", "cp1252")
        loaded, problems = load_dbc(file)
        assert loaded
        assert not problems
        assert [m.name for m in loaded.messages] == ["Next"]
        assert loaded.count == len(loaded.warnings) == 1, row
    loaded, _ = load_dbc(file, ())
    assert loaded
    assert loaded.messages == []
    file.write_text(f'{OTHER}VAL_ 5 None 1 "on" ;\n', "cp1252")
    loaded, _ = load_dbc(file)
    assert loaded
    assert ([m.name for m in loaded.messages], loaded.count) == (["Other"], 1)


# -- written as no one expects, and too large -----------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        OTHER.replace("BO_ 5 Other", "BO_ 5Other"),
        OTHER.replace("SG_ Two :", "SG_ Two M2 M3 :"),  # not a signal: cantools says why
        OTHER.replace("SG_ One", "SG_ 1One"),
    ],
)
def test_cantools_gets_all_where_a_message_is_written_in_another_way(file: Path, text: str) -> None:
    file.write_text(f'{text}\nVAL_ 5 One 1 "on" ;\nBO_ 6 Next: 8 A\n', encoding="cp1252")
    loaded, problems = load_dbc(file, {"Next"})
    try:
        expected = whole(file)
    except Exception:
        assert not loaded
        assert "Invalid syntax" in problems[0].message
        return
    assert loaded
    assert [parts(m) for m in loaded.messages] == [parts(m) for m in expected.messages]
    assert [(e.name, e.line) for e in loaded.entries] == [("Other", None), ("Next", 6)]


def test_only_what_is_used_is_limited(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    count = len(machine.dbc)
    machine.in_dbc(
        "CM_ ", "".join(OTHER.replace("5 O", f"{i} O{i}") for i in range(1100, 1300)) + "CM_ "
    )
    for name in ("MOST_PARSED", "MOST_WORDS", "MOST_PAYLOAD"):
        most = {"MOST_PARSED": count, "MOST_WORDS": count // 3, "MOST_PAYLOAD": 200}[name]
        monkeypatch.setattr(dbc_parse, name, most)
    machine.load()
    machine.in_dbc("BO_ 272 JoystickLeft: 8", "BO_ 272 JoystickLeft: 208")
    (problem,) = machine.problems()
    assert "expected 200 bytes at most in its messages, got " in problem
    monkeypatch.setattr(dbc_parse, "MOST_WORDS", 10)
    (problem,) = machine.problems()
    assert "expected 10 words at most, got " in problem
    monkeypatch.setattr(dbc_parse, "MOST_PARSED", 100)
    (problem,) = machine.problems()
    assert "expected 100 bytes at most in what is used of it, got " in problem


@pytest.mark.parametrize("most", ["MOST_MESSAGES", "MOST_STATEMENTS", "MOST_PARSED"])
def test_more_than_any_machine_has(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, most: str
) -> None:
    machine.in_yaml("[machine.dbc]", "[machine.dbc, other.dbc]")
    rows = "".join(OTHER.replace("5 O", f"{i} O{i}") for i in range(50))
    (machine.directory / "other.dbc").write_text(f'VERSION "1"\n{rows}', encoding="cp1252")
    files = machine.load().messages.files
    counts = {
        "MOST_MESSAGES": [len(file.entries) for file in files],
        "MOST_STATEMENTS": [file.statements for file in files],
        "MOST_PARSED": [file.used_bytes for file in files],
    }[most]
    assert counts[1] == {"MOST_MESSAGES": 50, "MOST_STATEMENTS": 50, "MOST_PARSED": 11}[most]
    monkeypatch.setattr(database, most, sum(counts) - 1)
    (problem,) = machine.problems()
    assert f"dbc: expected {sum(counts) - 1} " in problem
    assert problem.endswith(f" in all at most, got {sum(counts)}")
    monkeypatch.setattr(database, most, sum(counts))
    machine.load()


@pytest.mark.parametrize(("most", "count"), [("MOST_MESSAGES", 50), ("MOST_STATEMENTS", 51)])
def test_more_than_any_file_has(
    file: Path, monkeypatch: pytest.MonkeyPatch, most: str, count: int
) -> None:
    rows = "".join(OTHER.replace("5 O", f"{i} O{i}") for i in range(50))
    file.write_text(rows + 'CM_ BO_ 5 "text";', encoding="cp1252")
    monkeypatch.setattr(dbc_text, most, count)
    assert load_dbc(file, ())[0]
    monkeypatch.setattr(dbc_text, most, count - 1)
    loaded, (problem,) = load_dbc(file, ())
    assert not loaded
    assert "not a DBC file that can be used: more than" in str(problem)


def test_wrong_files_take_no_more_than_good_ones(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine.in_yaml("[machine.dbc]", "[a.dbc, b.dbc, c.dbc]")
    for name in ("a.dbc", "b.dbc", "c.dbc"):
        (machine.directory / name).write_text("no DBC", encoding="cp1252")
    assert len(machine.problems()) == 3
    monkeypatch.setattr(lookup, "MOST_PARSED", 12)
    assert len(machine.problems()) == 3
    monkeypatch.setattr(lookup, "MOST_PARSED", 11)
    assert [p.split(":")[0] for p in machine.problems()] == ["a.dbc", "b.dbc"]
