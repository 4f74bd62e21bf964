"""DBC files with more than any machine has: what is limited, and that it costs no time."""

import pytest

from canshaper.machine import database, dbc_parse, lookup
from tests.machine.plain_dbc import OTHER
from tests.rigs.files import Machine


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


@pytest.mark.parametrize("most", ["MOST_MESSAGES", "MOST_STATEMENTS", "MOST_PARSED"])
def test_more_than_any_machine_has(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, most: str
) -> None:
    line = machine.in_yaml("[machine.dbc]", "[machine.dbc, other.dbc]")
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
    what = {
        "MOST_MESSAGES": "messages",
        "MOST_STATEMENTS": "statements of messages",
        "MOST_PARSED": "bytes in what is used of them",
    }[most]
    says = f"expected {sum(counts) - 1} {what} in all at most, got {sum(counts)}"
    assert problem == f"machine.yaml:{line}: dbc: {says}"
    monkeypatch.setattr(database, most, sum(counts))
    machine.load()


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
