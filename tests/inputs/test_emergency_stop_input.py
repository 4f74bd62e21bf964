"""The emergency stop alone: who may press it, and who may free it."""

from collections.abc import Callable
from typing import Any

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.inputs.stops import EmergencyStopInput
from canshaper.shaping.states import Reason
from tests.rigs.emergency import Machine

MS = 1_000_000
PRESSED = Reason.EMERGENCY_STOP


@pytest.fixture
def stop(changed_rig: Callable[..., Any]) -> tuple[EmergencyStopInput, Machine]:
    machine = Machine(changed_rig)
    bound = machine.rig.controller.deployment.emergency_stop
    assert bound is not None
    return EmergencyStopInput(bound, bound.config.signal), machine


def test_a_press_out_of_sequence_holds_until_a_free_frame_in_sequence(
    stop: tuple[EmergencyStopInput, Machine],
) -> None:
    """An axis asks once a tick; what was reported once is reported until the stop is freed."""
    entry, sender = stop
    assert entry.receive(sender.stop(0).data, 0) is FrameFault.NONE
    assert entry.stop(0, 0) is None
    assert entry.receive(sender.stop(1, step=20).data, 10 * MS) is FrameFault.COUNTER_JUMP
    for now in range(10, 30):
        assert entry.stop(now * MS, entry.presses) is PRESSED
    assert entry.receive(sender.stop(0, step=20).data, 30 * MS) is FrameFault.COUNTER_JUMP
    assert entry.stop(30 * MS, entry.presses) is PRESSED
    assert entry.receive(sender.stop(0).data, 40 * MS) is FrameFault.NONE
    assert entry.stop(40 * MS, entry.presses) is None


def test_a_press_between_two_ticks_is_reported_in_the_next_one(
    stop: tuple[EmergencyStopInput, Machine],
) -> None:
    entry, sender = stop
    for code, at in ((0, 0), (1, 3 * MS), (0, 6 * MS)):
        assert entry.receive(sender.stop(code).data, at) is FrameFault.NONE
    assert entry.stop(20 * MS, 0) is PRESSED
    assert entry.presses == 1
    assert entry.stop(40 * MS, 1) is None


def test_before_its_first_frame_and_after_its_timeout_it_is_lost(
    stop: tuple[EmergencyStopInput, Machine],
) -> None:
    entry, sender = stop
    assert entry.stop(0, 0) is Reason.EMERGENCY_STOP_LOST
    entry.receive(sender.stop(0).data, 5 * MS)
    assert entry.stop(65 * MS, 0) is None
    assert entry.stop(65 * MS + 1, 0) is Reason.EMERGENCY_STOP_LOST
