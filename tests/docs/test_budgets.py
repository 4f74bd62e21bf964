"""Budgets of words, files and lines, so that one person can hold pages and code in the head.

Each page can be read once, from top to bottom. A fact that is added takes the place of another one,
or moves to the page that it belongs to: two pages with one fact soon contradict each other. What a
command writes into a page (tables between marks, output of ``canshaper``) is not counted.

Code that is added takes the place of other code, or says here why it may not. A room that only
grows is no longer reviewed as a whole, and a test that repeats another one is read by no one.
"""

import re
from pathlib import Path

import pytest

from tests.docs.pages import EVERY_PAGE, ROOT

MORE = 1.05  # a page may exceed its budget by so much before it has to be shortened
TABLES = re.compile(r"^<!-- (generated|measured): (.*?) -->$.*?^<!-- end: \2 -->$", re.M | re.S)
OUTPUT = re.compile(r"^<!-- canshaper .*? -->\n```text\n.*?^```$", re.M | re.S)
BUDGET = {
    "CHANGELOG.md": 610,
    "CONTRIBUTING.md": 590,
    "README.md": 570,
    "SECURITY.md": 340,
    "docs/api.md": 130,
    "docs/architecture.md": 320,
    "docs/calibration.md": 370,
    "docs/campaign.md": 780,
    "docs/canopen.md": 620,
    "docs/checksums.md": 200,
    "docs/commission.md": 600,
    "docs/comparison.md": 450,
    "docs/decisions.md": 800,
    "docs/deployment.md": 1710,
    "docs/devices.md": 340,
    "docs/doctor.md": 300,
    "docs/export.md": 500,
    "docs/glossary.md": 310,
    "docs/guide.md": 870,
    "docs/identification.md": 490,
    "docs/j1939.md": 550,
    "docs/machine-manual.md": 740,
    "docs/machines.md": 810,
    "docs/monitor.md": 260,
    "docs/realtime.md": 350,
    "docs/replay.md": 650,
    "docs/safety.md": 2290,
    "docs/sensor.md": 800,
    "docs/service.md": 680,
    "docs/states.md": 270,
    "docs/studio.md": 600,
    "docs/study.md": 280,
    "docs/testing.md": 400,
    "docs/topologies.md": 640,
    "docs/troubleshooting.md": 530,
    "docs/tuning.md": 550,
    "docs/work.md": 440,
    "studies/README.md": 360,
}

# Lines of Python with room for small additions, and why so many.
LINES = {
    "canshaper/gate": (2_250, "read in a day by someone who has never seen it"),
    "canshaper/shaping": (5_000, "the method: filters, axis, motion, ends, observer of the sway"),
    "canshaper": (
        67_300,
        "a new ability takes the room of an old one; docstrings state every case",
    ),
    "tests": (100_600, "one level for each behaviour"),
}
# Files, but for the empty ones of a package; 60 to 300 lines are one subject.
FILES = {"canshaper": (332, "one that only hands on is joined to its reader")}


def sources(room: str) -> list[str]:
    """Texts of the modules of a room."""
    texts = (path.read_text(encoding="utf-8") for path in (ROOT / room).rglob("*.py"))
    return [text for text in texts if text.count("\n") > 1]


def words(text: str) -> int:
    """Words (a letter or digit in each) that someone wrote by hand: no ``|`` of a table."""
    return sum(any(map(str.isalnum, one)) for one in OUTPUT.sub("", TABLES.sub("", text)).split())


def excess(page: str, text: str) -> str | None:
    """Return the fault of the number of words of a page; empty for none."""
    count, budget = words(text), BUDGET[page]
    if count <= MORE * budget:
        return None
    return f"{page}: expected {budget} words, at most 5 % more, got {count}"


def test_every_page_has_a_budget() -> None:
    assert {str(page.relative_to(ROOT)) for page in EVERY_PAGE} == BUDGET.keys()


@pytest.mark.parametrize("page", BUDGET)
def test_a_page_keeps_its_budget(page: str) -> None:
    assert excess(page, Path(ROOT, page).read_text(encoding="utf-8")) is None


def test_a_page_that_grows_is_refused_and_its_tables_do_not_count() -> None:
    page = "docs/api.md"
    budget = BUDGET[page]
    table = "<!-- generated: filters -->\n" + "| a " * 500 + "\n<!-- end: filters -->\n"
    output = "<!-- canshaper demo -->\n```text\n" + "1 " * 500 + "\n```\n"
    assert excess(page, "word | - " * int(MORE * budget) + "\n" + table + output) is None
    wrong = excess(page, "word " * (int(MORE * budget) + 1) + "\n" + table + output)
    assert wrong is not None
    assert wrong.startswith("docs/api.md: expected")


@pytest.mark.parametrize("room", LINES)
def test_a_room_keeps_its_budget_of_lines(room: str) -> None:
    budget, reason = LINES[room]
    lines = sum(text.count("\n") for text in sources(room))
    assert 0 < lines <= budget, f"{room}: {reason}"


@pytest.mark.parametrize("room", FILES)
def test_a_room_keeps_its_budget_of_files(room: str) -> None:
    budget, reason = FILES[room]
    assert 0 < len(sources(room)) <= budget, f"{room}: {reason}"
