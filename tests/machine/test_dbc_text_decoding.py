"""Text of a DBC file: its characters, its comments, its limits, and lines of what is left over."""

import pytest

from canshaper.machine import dbc_text as module
from canshaper.machine.dbc_text import dbc_text

MESSAGE = b"BO_ 5 Other: 2 A\n"


def test_characters_are_those_of_windows_and_others_are_replaced() -> None:
    text = dbc_text(b'CM_ "\xb0\x81";\n')
    assert text.whole() == text.of(()) == 'CM_ "\N{DEGREE SIGN}\ufffd";\n'
    long = dbc_text(MESSAGE + b'BA_ "SystemMessageLongSymbol" BO_ 5 "\xb0\x81";\n')
    assert long.entries is not None
    assert [entry.name for entry in long.entries] == ["\N{DEGREE SIGN}\ufffd"]


def test_a_comment_is_passed_over() -> None:
    entries = dbc_text(b"// BO_ 6 None: 2 A\n" + MESSAGE).entries
    assert entries is not None
    assert [(entry.name, entry.line) for entry in entries] == [("Other", 2)]


def test_of_a_string_without_end_only_cantools_can_say_what_is_in_it() -> None:
    assert dbc_text(MESSAGE + b'CM_ "text').entries is None


def test_one_message_more_than_allowed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_MESSAGES", 1)
    assert dbc_text(MESSAGE).statements == 1
    with pytest.raises(ValueError, match=r"^more than 1 messages or 300000 statements$"):
        dbc_text(MESSAGE + MESSAGE.replace(b"5", b"6"))


def test_each_leftover_table_has_its_line() -> None:
    text = dbc_text(b'\nVAL_ 7 One 1 "on" ;\n\nVAL_ 8 Two 1 "on" ;\n')
    assert list(text.leftover_faults(text.leftover(()))) == [
        (2, "VAL_ 7 One is of a signal that there is not"),
        (4, "VAL_ 8 Two is of a signal that there is not"),
    ]


@pytest.mark.parametrize(
    ("number", "good"),
    [
        (0x7FF, True),
        (0x800, False),
        (0x7FFF_FFFF, False),
        (0x8000_0000, True),  # 29 bits, all 0
        (0x9FFF_FFFF, True),
        (0xA000_0000, False),
    ],
)
def test_the_last_ids_of_11_and_29_bits(number: int, good: bool) -> None:
    (entry,) = dbc_text(f"BO_ {number} One: 8 A\n".encode()).entries
    assert (entry.fault is None) is good


def test_as_many_statements_as_there_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    text = b'BO_ 1 One: 8 A\nCM_ BO_ 1 "a";\nCM_ BO_ 1 "b";\n'
    monkeypatch.setattr("canshaper.machine.dbc_text.MOST_STATEMENTS", 3)
    assert len(dbc_text(text).entries) == 1
    monkeypatch.setattr("canshaper.machine.dbc_text.MOST_STATEMENTS", 2)
    with pytest.raises(ValueError, match="or 2 statements"):
        dbc_text(text)
