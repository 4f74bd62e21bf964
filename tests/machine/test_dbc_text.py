"""DBC files as they are: the messages that are used, judged by plain cantools."""

import random
from pathlib import Path
from typing import Any

import cantools
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from canshaper.machine import dbc_text
from canshaper.machine.database import Messages, load_dbc
from tests.machine.plain_dbc import OTHER, parts, whole
from tests.rigs.files import ROOT

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


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "one.dbc"


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


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=pytest.mark.slow) if p.name.startswith("j1939") else p for p in FILES],
    ids=lambda path: path.name,
)
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
@example(9347, False)
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
    if any("99999 bytes or bits" in one.message for one in problems):
        return  # a size that no memory holds is refused in a comment as well
    assert loaded, problems
    got = [parts(m) for m in loaded.messages if m.name == "Short"]
    # A message in a comment gets a missing sender, too.
    assert repr(got).replace(" Vector__XXX", "") == repr(expected).replace(" Vector__XXX", "")


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
        "SIG_VALTYPE_ 5 None : 1;\n",  # of a signal that there is not
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


# -- written as no one expects --------------------------------------------------------------------


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
