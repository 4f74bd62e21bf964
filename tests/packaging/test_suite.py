"""`make test`: parts go on after a failure; what is missing is named; the exit status says it."""

import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
GREEN = "print('SKIPPED [2] tests/a.py:1: no kernel'); print('3 passed, 2 skipped in 0.1s')"
RED = "print('FAILED tests/b.py::test_b'); print('1 failed, 4 passed in 0.1s (0:00:01)'); exit(1)"


@pytest.fixture
def suite(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import suite

    monkeypatch.setattr(suite, "OUT", tmp_path)
    return suite


def part(suite: ModuleType, name: str, code: str, **more: object) -> object:
    return suite.Part(name, f"shows {name}", [[sys.executable, "-c", code]], **more)


def test_a_part_that_fails_stops_no_other(
    suite: ModuleType, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    red, green = part(suite, "red", RED), part(suite, "green", GREEN)
    last = part(suite, "last", GREEN)
    suite.run([[red], [green, last]])
    text = suite.table([red, green, last])
    rows = [line.split() for line in text.splitlines()]
    assert [row[0] for row in rows[:4]] == ["part", "red", "green", "last"]
    assert [(r[1], r[2], r[3], r[5]) for r in rows[1:4]] == [
        ("4", "1", "0", "FAILED"),
        ("3", "0", "2", "ok"),
        ("3", "0", "2", "ok"),
    ]
    assert "red: FAILED tests/b.py::test_b" in text
    assert "green: skipped 2: no kernel" in text
    assert text.endswith("\n10 passed, 1 failed, 4 skipped")
    assert "FAILED tests/b.py::test_b" in capsys.readouterr().out
    assert "4 passed" in (tmp_path / "red.log").read_text()


def test_a_part_without_what_it_needs_is_named(suite: ModuleType) -> None:
    absent = part(suite, "absent", RED, absent=lambda: "no browser here")
    green = part(suite, "green", GREEN)
    suite.run([[absent, green]])
    text = suite.table([absent, green])
    assert "absent: not run: no browser here" in text
    assert text.endswith("\n3 passed, 0 failed, 2 skipped")


def test_a_gate_that_fails_without_counting_tests_is_a_failure(suite: ModuleType) -> None:
    gate = part(suite, "types", "print('error: no'); exit(2)")
    suite.run([[gate]])
    assert suite.table([gate]).endswith("\n0 passed, 1 failed, 0 skipped")


@pytest.mark.parametrize(("code", "status"), [(GREEN, 0), (RED, 1), ("exit(77)", 0)])
def test_status(suite: ModuleType, monkeypatch: pytest.MonkeyPatch, code: str, status: int) -> None:
    monkeypatch.setattr(suite, "rows_of_test", lambda: [[part(suite, "one", code)]])
    assert suite.main([]) == status


def test_a_part_that_there_is_not_is_refused(
    suite: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        suite.main(["everything"])
    assert "everything is none of: lint fast" in capsys.readouterr().err
