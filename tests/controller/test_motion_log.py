"""Log lines of a two-axis motion: once why the axes move singly, once that they do not."""

from canshaper.controller.events import MotionEvent
from tests.controller.motion_rig import MEASURED, Make, by_two_joysticks, moving_as_one, slewing
from tests.rigs.forwarder import Rig


def said(rig: Rig) -> list[str]:
    """Log lines of the motion since the last call."""
    texts = [event.text for event in rig.controller.events if isinstance(event, MotionEvent)]
    rig.controller.events.clear()
    return texts


TOGETHER = "motion=crane axes=together"
SINGLE = "motion=crane axes=single"


def test_the_log_says_once_why_the_axes_move_singly_and_once_that_they_no_longer_do(
    changed_rig: Make,
) -> None:
    rig = by_two_joysticks(changed_rig)
    rig.run(50)
    assert said(rig) == [TOGETHER]
    rig.run(50, Slew=1000)
    rig.run(50, Slew=1000, AntiSwayOff=1)
    assert said(rig) == [f"{SINGLE} slew=BYPASS_ON"]
    rig.run(50, Slew=1000)
    assert said(rig) == [TOGETHER]
    for _ in range(50):  # released on the other joystick
        rig.receive(rig.joystick("JoystickLeft"), rig.joystick("JoystickRight", Enable=0))
        rig.tick()
    assert said(rig) == [f"{SINGLE} near_far=TRIPPED"]
    rig.run(50)
    assert said(rig) == [TOGETHER]


def test_a_trip_that_becomes_another_state_is_the_same_cause(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig).moving()
    said(rig)
    rig.run(50, Enable=0)
    rig.run(1, Slew=500)  # reset by the press, but held out: it waits for neutral
    rig.run(50, Slew=500)
    assert said(rig) == [f"{SINGLE} slew=TRIPPED"]


def test_the_log_says_that_the_radius_is_lost(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig, MEASURED)
    rig.run(50)
    assert said(rig) == [f"{SINGLE} radius=lost"]
    slewing(rig, 50, 3000)
    assert said(rig) == [TOGETHER]
    slewing(rig, 50, None)  # carried on by the model, as long as the motion lasts
    assert said(rig) == [f"{SINGLE} radius=lost"]
    slewing(rig, 50, 3000)
    assert said(rig) == [TOGETHER]


def test_at_the_start_the_axes_wait_without_a_word(changed_rig: Make) -> None:
    rig = moving_as_one(changed_rig)
    for _ in range(50):
        rig.tick()
    assert said(rig) == []
