from pathlib import Path
from typing import Any

import pytest

from canshaper.machine.binding import load_deployment
from studies.paper.study import FIGURES, Study, steps

FILE = Path(__file__).resolve().parents[3] / "config" / "forwarder.yaml"


@pytest.fixture(scope="session")
def steps_done() -> list[int]:
    return []


@pytest.fixture(scope="session")
def study(steps_done: list[int]) -> Study:
    return Study(load_deployment(FILE), lambda: steps_done.append(1))


@pytest.fixture(scope="session")
def table(study: Study) -> dict[str, Any]:
    return study.table()


@pytest.fixture(scope="session")
def numbers(study: Study) -> dict[int, dict[str, Any]]:
    return {n: study.figure_numbers(n) for n in FIGURES}


@pytest.fixture(scope="session")
def all_steps() -> int:
    return steps(FIGURES, table=True)
