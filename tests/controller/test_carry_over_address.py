"""A reload is no reset, but of a lost address: a new one is the way back."""

import pytest

from canshaper.controller.controller import Controller
from canshaper.shaping.states import Reason, State
from tests.gate.bench import load


@pytest.mark.parametrize(
    ("reason", "state"),
    [(Reason.ADDRESS_LOST, State.NEUTRAL_WAIT), (Reason.EMERGENCY_STOP, State.TRIPPED)],
)
def test_which_trip_a_reload_carries_over(reason: Reason, state: State) -> None:
    deployment = load("forwarder")
    before, after = (Controller(deployment).axes["slew"] for _ in range(2))
    before.axis.restore(State.TRIPPED, reason)
    after.copy_state(before)
    assert after.axis.state is state
