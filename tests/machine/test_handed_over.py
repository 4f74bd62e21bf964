"""A deployment is read by a process of its own: the daemon gets it as a pickle."""

import pickle

import pytest

from canshaper.machine.binding import load_deployment
from tests.faults.shipped import NAMES
from tests.rigs.files import CONFIG


@pytest.mark.parametrize("name", NAMES)
def test_a_deployment_can_be_handed_over(name: str) -> None:
    deployment = load_deployment(CONFIG / f"{name}.yaml")
    again = pickle.loads(pickle.dumps(deployment))
    assert again.identity == deployment.identity
    assert [one.key for one in again.sent()] == [one.key for one in deployment.sent()]
