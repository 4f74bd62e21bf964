"""Press and release of an enable switch: by frames, and over a reload."""

import pytest

from canshaper.controller.controller import Controller
from canshaper.inputs.input import SwitchInput
from canshaper.shaping.states import Reason, State
from canshaper_sim.hand import Held
from tests.controller.cab import TICK_MS, Cab, enable_of, right_enable, seat, without
from tests.rigs.files import Machine


@pytest.mark.parametrize("enable", ["enable: seat", "enable: right.Enable", "enable_of: right"])
def test_the_switch_to_press_is_another(switched: Machine, enable: str) -> None:
    switched.in_yaml("enable: [Enable, seat, door, mode, right.Enable]", enable)
    if "seat" not in enable:
        switched.in_yaml("enable: Enable", "enable: [Enable, seat]")
    switched.yaml = switched.yaml.replace("  door: {", "  #").replace("  mode: {", "  #")
    cab = Cab(switched)
    cab.drive(300, enable=False)
    assert cab.slew == (State.NEUTRAL_WAIT, Reason.ENABLE_OFF)
    cab.drive(200)
    assert cab.slew == (State.READY, Reason.JOYSTICK_NEUTRAL)
    cab.drive(600, 0.8)
    assert cab.moves
    cab.drive(100, 0.8, enable=False)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)
    cab.drive(200)  # a press resets
    assert cab.slew == (State.READY, Reason.JOYSTICK_NEUTRAL)
    cab.drive(600, 0.8)
    assert cab.moves
    # Its silence is its loss, and that it comes again is no press.
    cab.change = without(288 if enable == "enable: seat" else 273)
    cab.drive(400, 0.8)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)
    cab.change = lambda frame: frame
    cab.drive(400)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)


@pytest.mark.parametrize("enable", ["enable: Enable", "enable: seat", "enable: right.Enable"])
def test_a_release_that_does_not_count_is_no_press(switched: Machine, enable: str) -> None:
    """It stops what moves, but what follows a frame out of sequence resets nothing."""
    switched.in_yaml("enable: [Enable, seat, door, mode, right.Enable]", enable)
    if "seat" not in enable:
        switched.in_yaml("enable: Enable", "enable: [Enable, seat]")
    switched.yaml = switched.yaml.replace("  door: {", "  #").replace("  mode: {", "  #")
    cab = Cab(switched)
    cab.drive(200)
    cab.drive(600, 0.8)
    cab.controller.axes["slew"].stops.trip = Reason.SECOND_SENDER
    cab.drive(400)
    assert cab.slew == (State.TRIPPED, Reason.SECOND_SENDER)
    can_id = {"enable: Enable": 272, "enable: seat": 288}.get(enable, 273)
    last = next(f for f in cab.hand.frames(cab.time_ms, Held(enable=True)) if f.can_id == can_id)
    counted = cab.hand.frames(cab.time_ms + 100, Held(enable=True))
    for frame in (last, *(f for f in counted if f.can_id == can_id)):
        cab.gated.receive(frame, cab.time_ms * 1_000_000 + 1)
    released = seat(0, 1)(last) if can_id == 288 else enable_of(can_id, 0)(last)
    cab.gated.receive(released, cab.time_ms * 1_000_000 + 2)  # behind those: a step back
    cab.drive(400)
    assert cab.slew == (State.TRIPPED, Reason.SECOND_SENDER)
    cab.drive(100, enable=False)
    cab.drive(200)
    assert cab.slew == (State.READY, Reason.JOYSTICK_NEUTRAL)


def test_that_all_are_lost_at_once_and_come_again_is_no_press(switched: Machine) -> None:
    switched.in_yaml(
        "enable: [Enable, seat, door, mode, right.Enable]",
        "enable: [right.Enable, seat, door, mode]",
    )
    cab = Cab(switched)
    cab.drive(200)
    cab.drive(600, 0.8)
    cab.change = lambda frame: frame if frame.can_id == 272 else None
    cab.drive(400, 0.8)
    cab.drive(80)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)
    cab.change = lambda frame: frame
    assert len(cab.hand.frames(cab.time_ms + TICK_MS, Held(enable=True))) == 4  # in the same tick
    cab.drive(300)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)


# -- a reload ------------------------------------------------------------------------------------


def test_a_switch_stays_released_over_a_reload(switched: Machine) -> None:
    """Whatever the file calls it."""
    cab = Cab(switched)
    cab.drive(200)
    cab.change = lambda frame: right_enable(0)(seat(0, 1)(frame))
    cab.drive(100)
    switched.yaml = switched.yaml.replace("seat", "driver")
    after = Controller(switched.load())
    after.carry_over(cab.controller)
    seats = after.inputs["crane", 288, False]
    assert isinstance(seats, SwitchInput)
    assert {n: s.released for n, s in seats.switches.items()} == {"driver": True, "door": False}
    assert after.joysticks["right"].watch("Enable").released


def test_a_switch_that_is_new_in_a_reload_is_not_released(switched: Machine) -> None:
    all_of_them = switched.yaml
    switched.in_yaml("enable: [Enable, seat, door, mode, right.Enable]", "enable: [Enable, seat]")
    switched.yaml = switched.yaml.replace("  door: {", "  #").replace("  mode: {", "  #")
    cab = Cab(switched)
    cab.change = seat(0, 0)
    cab.drive(200)
    switched.yaml = all_of_them
    after = Controller(switched.load())
    after.carry_over(cab.controller)
    seats = after.inputs["crane", 288, False]
    assert isinstance(seats, SwitchInput)
    assert {n: s.released for n, s in seats.switches.items()} == {"seat": True, "door": False}
    assert not after.joysticks["right"].watch("Enable").released
