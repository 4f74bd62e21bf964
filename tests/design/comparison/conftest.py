"""The filters that are compared on the forwarder."""

import pytest

from canshaper.design.comparison.manoeuvres import Candidate, candidates
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.design.comparison.candidates import FILE


@pytest.fixture(scope="module")
def deployment() -> Deployment:
    return load_deployment(FILE)


@pytest.fixture(scope="module")
def by_name(deployment: Deployment) -> dict[str, Candidate]:
    return {c.name: c for c in candidates(deployment)}
