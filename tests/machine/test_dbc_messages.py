"""Messages of DBC files that were loaded: looked up by name, their lines, and what is wrong."""

from pathlib import Path

import pytest

from canshaper.errors import Problem
from canshaper.machine.database import Messages, load_dbc
from canshaper.machine.dbc_parse import letters
from canshaper.machine.dbc_text import Entry
from tests.machine.plain_dbc import OTHER

HEAD = 'VERSION "1"\n\nBU_: A\n\n'
WIDE = OTHER.replace("BO_ 5 Other", "BO_ 2147483653 Wide")
PG = (
    'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
    'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";\nBA_ "VFrameFormat" BO_ 5 3;\n'
)
NARROW = (
    "is one of J1939 with an id of 11 bits; an id of 29 bits stands in a DBC file with bit 31 set:"
    " 0x80000000 more"
)


def written(folder: Path, text: str, name: str = "a.dbc") -> Path:
    file = folder / name
    file.write_text(text, encoding="cp1252")
    return file


def test_a_file_is_known_by_its_messages(tmp_path: Path) -> None:
    path = written(tmp_path, HEAD + OTHER + WIDE)
    file, problems = load_dbc(path, {"Other"})
    assert file is not None
    assert problems == []
    assert file.path == path
    assert [(e.name, e.number, e.line) for e in file.entries] == [
        ("Other", 5, 5),
        ("Wide", 0x80000005, 8),
    ]
    assert [message.name for message in file.messages] == ["Other"]
    assert (file.warnings, file.count) == ([], 0)


def test_a_problem_is_at_the_line_of_its_message(tmp_path: Path) -> None:
    path = written(tmp_path, HEAD + OTHER + WIDE)
    file, _ = load_dbc(path)
    assert file is not None
    other, wide = file.messages
    assert file.problem(other, "x") == Problem(str(path), 5, "Other", "x")
    assert file.problem(wide, "x") == Problem(str(path), 8, "Wide", "x")
    elsewhere, _ = load_dbc(written(tmp_path, HEAD + OTHER.replace("5 O", "4 O"), "b.dbc"))
    assert elsewhere is not None
    (moved,) = elsewhere.messages
    assert file.problem(moved, "x") == Problem(str(path), None, "Other", "x")
    assert elsewhere.problem(moved, "x").line == 5


def test_text_that_is_none_is_a_problem_without_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("canshaper.machine.dbc_text.MOST_MESSAGES", 1)
    path = written(tmp_path, HEAD + OTHER + WIDE)
    text = "not a DBC file that can be used: more than 1 messages or 300000 statements"
    assert load_dbc(path) == (None, [Problem(str(path), None, "", text)])


def test_the_size_of_one_file_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path, HEAD + OTHER)
    monkeypatch.setattr("canshaper.machine.database.MOST_BYTES", path.stat().st_size)
    assert load_dbc(path)[0] is not None
    monkeypatch.setattr("canshaper.machine.database.MOST_BYTES", path.stat().st_size - 1)
    with pytest.raises(OSError, match="expected"):
        load_dbc(path)


def test_an_id_of_j1939_has_29_bits(tmp_path: Path) -> None:
    path = written(tmp_path, HEAD + OTHER + PG)
    narrow = Problem(str(path), 5, "Other", NARROW)
    assert load_dbc(path, {"Other"}) == (None, [narrow])
    file, problems = load_dbc(path)
    assert file is not None
    assert (file.messages, file.warnings, file.count, problems) == ([], [narrow], 1, [])


def test_an_id_of_two_messages_is_named_by_the_second(tmp_path: Path) -> None:
    twice = OTHER + OTHER.replace("Other", "Again") + OTHER.replace("Other", "Third")
    path = written(tmp_path, HEAD + twice)
    again = Problem(str(path), 8, "Again", "has the id 0x5 of Other")
    third = Problem(str(path), 11, "Third", "has the id 0x5 of Again")
    file, problems = load_dbc(path, {"Other"})
    assert file is not None
    assert problems == [again, third]
    file, problems = load_dbc(path)
    assert file is not None
    assert problems == []
    assert (file.messages, file.warnings, file.count) == ([], [again, third], 2)


def test_an_extended_id_is_another_one(tmp_path: Path) -> None:
    twice = WIDE + WIDE.replace("Wide", "Again")
    path = written(tmp_path, HEAD + OTHER + twice)
    file, problems = load_dbc(path, {"Other"})
    assert file is not None
    assert problems == []
    again = Problem(str(path), 11, "Again", "has the id 0x5 of Wide")
    assert (file.warnings, file.count) == ([again], 1)


def test_messages_are_found_by_name_in_several_files(tmp_path: Path) -> None:
    one, _ = load_dbc(written(tmp_path, HEAD + OTHER), {"Other"})
    two, _ = load_dbc(written(tmp_path, HEAD + WIDE, "b.dbc"), ())
    assert one is not None
    assert two is not None
    messages = Messages([one, two])
    assert messages.files == [one, two]
    assert messages.find("Other") == (one, one.messages[0])
    result = messages.find("Wide")
    assert not isinstance(result, str)
    assert (result[0], result[1].name) == (two, "Wide")
    assert messages.find("Wide") == result
    assert messages.all() == one.messages
    assert messages.ids() == {(5, False), (5, True)}
    assert messages.named({(5, True)}) == ["Wide"]
    assert messages.named([(5, True), (5, False)]) == ["Other", "Wide"]
    assert messages.warnings() == (0, [])
    assert messages.find("Vide") == (
        "expected a message of the DBC files, got 'Vide'; there are Other, Wide; did you mean Wide?"
    )


def test_a_name_of_two_files_is_none(tmp_path: Path) -> None:
    one, _ = load_dbc(written(tmp_path, HEAD + OTHER), {"Other"})
    two, _ = load_dbc(written(tmp_path, HEAD + OTHER, "b.dbc"), ())
    assert one is not None
    assert two is not None
    assert Messages([one, two]).find("Other") == (
        f"'Other' stands more than once in the DBC files: {one.path}, {two.path}"
    )


def test_warnings_of_all_files_are_counted(tmp_path: Path) -> None:
    faulty = OTHER.replace("8|8", "9|8")
    paths = [written(tmp_path, HEAD + faulty, name) for name in ("a.dbc", "b.dbc")]
    files = [file for path in paths if (file := load_dbc(path, ())[0])]
    text = "has 2 bytes, and the signal Two is not within them"
    assert Messages(files).warnings() == (
        2,
        [Problem(str(path), 5, "Other", text) for path in paths],
    )


def test_a_message_that_cannot_be_read_any_more(tmp_path: Path) -> None:
    path = written(tmp_path, HEAD + OTHER + WIDE)
    file, _ = load_dbc(path, ())
    assert file is not None
    assert file.read("Nothing") == f"{path}: 'Nothing' has another name for the parser"
    message = file.read("Wide")
    assert not isinstance(message, str)
    assert message.name == "Wide"
    path.write_text(HEAD + OTHER, encoding="cp1252")
    assert file.read("Other") == f"{path}: has changed since it was read"
    path.write_text(HEAD + OTHER.replace("8|8", "9|8"), encoding="cp1252")
    answer = file.read("Other")
    assert isinstance(answer, str)
    assert answer.startswith(f"{path}:5: not a DBC file that can be used: The signal Two does")


def test_every_problem_of_a_message_is_a_line_of_the_answer(tmp_path: Path) -> None:
    path = written(tmp_path, HEAD + OTHER + OTHER.replace("Other", "Again") + PG)
    file, _ = load_dbc(path, ())
    assert file is not None
    answer = file.read("Other")
    assert isinstance(answer, str)
    assert answer.splitlines() == [
        f"{path}:8: Again: has the id 0x5 of Other",
        f"{path}:5: Other: {NARROW}",
        f"{path}:8: Again: {NARROW}",
    ]


def test_a_file_that_the_parser_gets_as_a_whole(tmp_path: Path) -> None:
    text = HEAD + OTHER.replace("BO_ 5 O", "BO_ 5O") + WIDE + "BO_ 6 Next: 8 A\n"
    for names in ({"Next"}, None):
        file, problems = load_dbc(written(tmp_path, text), names)
        assert file is not None
        assert problems == []
        assert file.entries == [
            Entry("Other", 5, None),
            Entry("Wide", 0x80000005, 8),
            Entry("Next", 6, 11),
        ]
        assert [message.name for message in file.messages] == ["Other", "Wide", "Next"]
        assert (file.warnings, file.count, file.statements) == ([], 0, 0)
        assert file.used_bytes == len(text) - text.count("\n")


BROKEN = HEAD + 'CM_ "end"\n' + OTHER + 'CM_ "end";\n'


def test_a_statement_without_its_end_is_at_the_line_where_it_is_missed(tmp_path: Path) -> None:
    (problem,) = load_dbc(written(tmp_path, BROKEN), ())[1]
    assert problem.line == 6
    (problem,) = load_dbc(written(tmp_path, BROKEN), {"Other"})[1]
    assert problem.line == 6


def test_a_file_too_large_as_a_whole_is_not_parsed_as_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("canshaper.machine.dbc_parse.MOST_PARSED", letters(BROKEN) - 1)
    (problem,) = load_dbc(written(tmp_path, BROKEN), ())[1]
    assert problem.line == 9


def test_a_fault_of_a_used_message_is_no_fault_of_another(tmp_path: Path) -> None:
    """Unused messages may be broken too; a used one is named."""
    text = HEAD + OTHER.replace("8|8", "9|8") + 'CM_ "end"\nBO_ 9 Nine: 1 A\n;\n'
    _, (problem,) = load_dbc(written(tmp_path, text), {"Other"})
    assert problem.line == 5
    assert "The signal Two does not fit in message Other" in problem.message
