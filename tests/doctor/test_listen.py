"""What was heard of the levers, against their cycle and their timeout."""

from collections.abc import Iterable
from itertools import accumulate
from pathlib import Path

import pytest

from canshaper.can.binding import load_deployment
from canshaper.doctor.finding import Finding, Level
from canshaper.doctor.listen import heard_findings
from tests.doctor.conftest import SHIPPED

MS = 1_000_000
DEPLOYMENT = load_deployment(SHIPPED)  # cycle 20 ms, timeout 100 ms


def at(gaps_ms: Iterable[float]) -> list[int]:
    return [round(t * MS) for t in accumulate(gaps_ms)]


def judged(gaps_ms: Iterable[float]) -> Finding:
    heard = {"lever left": at(gaps_ms), "lever right": at([20.0] * 50)}
    left, right = heard_findings(DEPLOYMENT, heard)
    assert (right.subject, right.level) == ("lever right", Level.OK)
    return left


@pytest.mark.parametrize(
    ("gaps_ms", "level"),
    [
        ([20.0] * 100, Level.OK),
        ([20.0] * 99 + [49.0], Level.OK),
        ([20.0] * 99 + [50.0], Level.WARNING),
        ([20.0] * 99 + [99.0], Level.WARNING),
        ([20.0] * 99 + [100.0], Level.BAD),
        ([9.0] * 100, Level.WARNING),
        ([31.0] * 100, Level.WARNING),
        ([], Level.BAD),
        ([20.0], Level.BAD),
    ],
)
def test_levels(gaps_ms: list[float], level: Level) -> None:
    found = judged(gaps_ms)
    assert found.level is level
    assert bool(found.remedy) == (level is not Level.OK)


def test_what_is_said() -> None:
    text = "100 frames, a period of 20.0 ms (DBC: 20 ms), the longest 60.0 ms"
    assert judged([20.0] * 99 + [60.0]).found == text
    assert judged([]).found == "0 frames heard"


def test_other_buses_are_not_listened_to(two_buses: Path) -> None:
    heard = {"lever left": at([20.0] * 50)}
    found = heard_findings(load_deployment(two_buses), heard)
    assert [(f.subject, f.level) for f in found] == [
        ("lever left", Level.OK),
        ("lever right", Level.NOTE),
        ("emergency stop", Level.NOTE),
    ]
