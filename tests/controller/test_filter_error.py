"""A filter raises in a controller: the event says what and where, and the other axis is let go."""

import pytest

from canshaper.controller.events import StateEvent
from canshaper.shaping.states import Reason, State
from tests.controller.motion_rig import moving_as_one
from tests.rigs.forwarder import Make


class Faulty:
    def step(self, command: float) -> float:
        raise ZeroDivisionError("a mistake on line 7")


LINE = Faulty.step.__code__.co_firstlineno + 1


@pytest.mark.parametrize("missed", [0, 2])
def test_the_event_keeps_the_error(changed_rig: Make, missed: int) -> None:
    rig = moving_as_one(changed_rig)
    rig.run(3)
    rig.run(50, Slew=1000)
    controller = rig.controller
    assert controller.axes["near_far"].added != 0.0
    controller.events.clear()
    controller.axes["slew"].axis.transfer.shaper = Faulty()
    rig.receive(rig.joystick(Slew=1000))
    rig.tick(missed)
    (event,) = [e for e in controller.events if isinstance(e, StateEvent) and e.axis == "slew"]
    transition = event.transition
    assert (transition.new, transition.reason) == (State.TRIPPED, Reason.OUTPUT_INVALID)
    text = "axis=slew state=TRIPPED from=ACTIVE reason=OUTPUT_INVALID error=ZeroDivisionError: "
    assert event.text == f"{text}a mistake on line 7 ({__file__}:{LINE})"
    assert controller.axes["near_far"].added == 0.0
