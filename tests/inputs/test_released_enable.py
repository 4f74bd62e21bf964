"""An enable that was seen released: no fault, and not forgotten while frames cannot be trusted."""

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.shaping.states import State
from tests.rigs.forwarder import SLOW_VALVE, Make, Rig


def test_a_released_enable_is_no_fault_of_the_frame(rig: Rig) -> None:
    rig.run(10, Enable=0)
    rig.run(10)
    assert rig.count("InvalidSignals") == 0
    assert rig.controller.counters.last_fault is FrameFault.NONE
    rig.run(1, Enable=2)
    assert rig.count("InvalidSignals") == 2  # both joysticks
    assert rig.controller.counters.last_fault is FrameFault.INVALID_SIGNAL


def test_of_a_joystick_that_is_silent_since_then_silence_is_reported(
    changed_rig: Make,
) -> None:
    """A valve of 200 ms on a joystick that is old after 100 ms."""
    rig = changed_rig(dbc=SLOW_VALVE)
    rig.run(30)
    assert rig.state() is State.READY
    rig.run(1, Enable=0)
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "ENABLE_OFF")
    for _ in range(10):
        assert rig.reason() == "ENABLE_OFF"
        rig.tick()
    assert rig.reason() == "JOYSTICK_TIMEOUT"


@pytest.mark.parametrize("accepted", [True, False])
def test_it_stays_released_while_the_frames_after_it_cannot_be_trusted(
    rig: Rig, accepted: bool
) -> None:
    """A counter that stands still says nothing new, and least of all that someone enabled."""
    rig.run(5)
    rig.counts["JoystickLeft"] -= not accepted
    rig.receive(rig.joystick(Enable=0), rig.joystick("JoystickRight"))
    rig.tick()
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "ENABLE_OFF")
    rig.counts["JoystickLeft"] -= 1
    frozen = rig.joystick(Enable=1)
    for _ in range(20):
        rig.receive(frozen, rig.joystick("JoystickRight"))
        rig.tick()
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "ENABLE_OFF")
    rig.run(1)
    assert rig.state() is State.READY
