"""The table of stops and silence: what the measurement would refuse, and that it is in the page."""

import pytest

from tests.hil.figures import (
    PAGE,
    SECTION,
    Silence,
    Stop,
    table,
    wrong_silences,
    wrong_stops,
)
from tools.marks import STAMP, marked, section_lines

TRIPPED, WENT_ON = (True, True, True), (False, False, False)


@pytest.mark.parametrize(
    ("gap_ms", "seen", "right"),
    [
        (101.1, TRIPPED, True),
        (101.1, WENT_ON, False),
        (101.1, (True, False, True), False),
        (101.1, (False, False, True), False),
        (79.9, WENT_ON, True),
        (79.9, TRIPPED, False),
        (90.0, WENT_ON, True),
        (90.0, TRIPPED, True),
    ],
)
def test_a_stop_is_right_by_its_gap(
    gap_ms: float, seen: tuple[bool, bool, bool], right: bool
) -> None:
    assert (wrong_stops([Stop(90, gap_ms, *seen)]) == []) is right


@pytest.mark.parametrize(("falls_ms", "right"), [(121.0, True), (121.1, False)])
def test_a_command_falls_within_the_age_limit_and_a_tick(falls_ms: float, right: bool) -> None:
    assert (wrong_silences([Silence(falls_ms, stopped=False)]) == []) is right


def test_the_page_has_a_place_for_what_was_measured() -> None:
    assert marked(PAGE.read_text("utf-8"), "measured") == [SECTION]
    assert STAMP.match(section_lines(PAGE.read_text("utf-8"), "measured", SECTION)[-1])
    silences = [Silence(101.0, stopped=False), Silence(119.0, stopped=True)]
    rows = table([Stop(120, 121.0, *TRIPPED)], silences)
    assert "1 of 1 stops, 0 went on" in rows[2]
