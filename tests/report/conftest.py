"""A pair of drives for the tests of reports."""

import pytest

from canshaper_sim.recording import Recording
from tests.report.drives import drive


@pytest.fixture(scope="session")
def pair() -> tuple[Recording, Recording]:
    """A raw and a shaped drive, each with lost samples and a time base of its own."""
    return drive(shaped=False, seed=1), drive(shaped=True, seed=2, period_s=0.0201)
