"""Tables on a narrow terminal: columns go below each other, and no digit is lost."""

from io import StringIO

import pytest

from canshaper.report.console import SafeConsole, new_table

HEADS = [f"{pct:+} %" for pct in range(-30, 40, 10)]
ROWS = [("through the machine", "20.25"), ("shaper alone", "3.125")]


def shown(width: int, heads: list[str] = HEADS, title: str | None = "A title") -> str:
    table = new_table("swing left, %", *heads, title=title)
    for name, figure in ROWS:
        table.add_row(name, *(figure for _ in heads))
    console = SafeConsole(file=StringIO(), width=width)
    console.print(table)
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("width", range(30, 121, 6))
def test_no_figure_is_lost_and_no_line_is_too_long(width: int) -> None:
    text = shown(width)
    assert "…" not in text
    assert all(text.count(head) == 1 for head in HEADS)
    assert text.count("20.25") == text.count("3.125") == len(HEADS)
    assert max(len(line) for line in text.splitlines()) <= width
    assert text.count("A title") == 1


def test_every_part_has_the_first_column() -> None:
    parts = shown(60).count("swing left, %")
    assert parts == shown(60).count("through the machine") == shown(60).count("shaper alone") == 2


def test_a_table_that_fits_is_one() -> None:
    assert shown(100).count("swing left, %") == 1
    assert shown(60, heads=[]).count("swing left, %") == 1


def test_a_wide_first_column_is_wrapped() -> None:
    assert "20.25" in shown(20, heads=["+0 %"])
