"""Switches that enable a joystick: several, all needed, in other messages too."""

from collections.abc import Callable

import pytest

from canshaper.checksums.algorithms import SAE_J1850
from canshaper.codec.frame import Frame
from canshaper.shaping.states import Reason, State
from canshaper_sim.hand import Held
from tests.controller.cab import TICK_MS, Cab, right_enable, seat, without
from tests.rigs.files import Machine
from tests.rigs.forwarder import Make


def mode(code: int) -> Callable[[Frame], Frame]:
    return lambda frame: frame._replace(data=bytes((code,))) if frame.can_id == 289 else frame


LOSSES = {
    "seat off": seat(0, 1),
    "seat in error": seat(2, 1),
    "door open": seat(1, 0),
    "wrong checksum": seat(1, 1, right_sum=False),
    "no seat message": without(288),
    "another mode": mode(2),
    "mode 0": mode(0),
    "no mode": without(289),
    "switch of the right joystick off": right_enable(0),
    "switch of the right joystick invalid": right_enable(3),
    "right joystick silent": without(273),
}


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_losing_any_is_losing_enable(switched: Machine, loss: Callable[[Frame], Frame]) -> None:
    cab = Cab(switched)
    cab.drive(200)
    assert cab.slew == (State.READY, Reason.JOYSTICK_NEUTRAL)
    cab.drive(600, 0.8)
    assert cab.moves
    cab.change = loss
    cab.drive(420, 0.8)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)
    assert not cab.moves
    # That all agree again is no press, wherever the joystick is.
    cab.change = lambda frame: frame
    cab.drive(400)
    cab.drive(400, 0.8)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)
    assert not cab.moves
    cab.drive(100, enable=False)
    cab.drive(200)
    assert cab.slew == (State.READY, Reason.JOYSTICK_NEUTRAL)
    cab.drive(100, 0.8)
    assert cab.moves


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_what_was_never_there_enables_nothing(
    switched: Machine, loss: Callable[[Frame], Frame]
) -> None:
    cab = Cab(switched)
    cab.change = loss
    cab.drive(300)
    cab.drive(600, 0.8)
    cab.drive(300)
    cab.drive(600, 0.8)
    assert cab.slew[0] is State.NEUTRAL_WAIT
    assert not cab.moves
    # The right joystick is not enabled by them.
    if "right" not in next(name for name, one in LOSSES.items() if one is loss):
        assert cab.controller.axes["lift"].axis.state is State.READY
    # As soon as all agree, and the joystick was in neutral, it may move.
    cab.change = lambda frame: frame
    cab.drive(300, 0.8)
    assert cab.slew == (State.NEUTRAL_WAIT, Reason.JOYSTICK_NOT_NEUTRAL)
    cab.drive(100)
    assert cab.slew == (State.READY, Reason.JOYSTICK_NEUTRAL)


def test_at_rest_it_only_waits(switched: Machine) -> None:
    cab = Cab(switched)
    cab.drive(300)
    cab.change = seat(0, 1)
    cab.drive(300)
    assert cab.slew == (State.NEUTRAL_WAIT, Reason.ENABLE_OFF)
    cab.change = lambda frame: frame
    cab.drive(300)
    assert cab.slew == (State.READY, Reason.JOYSTICK_NEUTRAL)


def test_a_release_between_two_ticks_counts(switched: Machine) -> None:
    """Also in a frame that is out of sequence: to stop takes no trust."""
    cab = Cab(switched)
    cab.drive(200)
    cab.drive(600, 0.8)
    first = bytes((0x04,))
    frame = Frame("crane", 288, False, first + bytes((SAE_J1850.of(first),)))
    cab.gated.receive(frame, cab.time_ms * 1_000_000 + 1)
    cab.drive(TICK_MS, 0.8)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)


def test_a_release_that_is_over_by_the_tick_counts(switched: Machine) -> None:
    cab = Cab(switched)
    cab.drive(200)
    cab.drive(600, 0.8)
    last = next(f for f in cab.hand.frames(0, Held(enable=True)) if f.can_id == 288).data[0] >> 4
    for step, seated in ((1, 0), (2, 1)):
        first = bytes((last + step & 0xF) << 4 | 0x04 | seated for _ in range(1))
        frame = Frame("crane", 288, False, first + bytes((SAE_J1850.of(first),)))
        cab.gated.receive(frame, cab.time_ms * 1_000_000 + step)
    cab.drive(TICK_MS, 0.8)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)


def test_a_latched_emergency_stop_is_not_reset_by_a_seat(switched: Machine) -> None:
    cab = Cab(switched)
    cab.drive(200)
    cab.drive(600, 0.8)
    cab.controller.axes["slew"].stops.trip = Reason.SECOND_SENDER
    cab.drive(100)
    cab.change = seat(0, 1)
    cab.drive(300)
    cab.change = lambda frame: frame
    cab.drive(300)
    assert cab.slew == (State.TRIPPED, Reason.SECOND_SENDER)


def test_a_lost_joystick_still_stops_shaped(switched: Machine) -> None:
    switched.in_yaml(
        "enable: [Enable, seat, door, mode, right.Enable]", "enable: [seat, door, mode]"
    )
    cab = Cab(switched)
    cab.drive(200)
    cab.drive(600, 0.8)
    cab.change = without(272)
    cab.drive(160, 0.8)
    assert cab.slew == (State.STOPPING, Reason.JOYSTICK_TIMEOUT)
    assert cab.moves


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_the_gate_does_not_need_the_controller_for_it(
    switched: Machine, loss: Callable[[Frame], Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A controller that has forgotten its switches: the gate lets nothing pass."""
    cab = Cab(switched)
    for control in cab.controller.axes.values():
        control.stops.interlocks.clear()
    cab.drive(200)
    cab.drive(600, 0.8)
    assert cab.moves
    cab.change = loss
    monkeypatch.setattr(Cab, "drive", _drive_without_look)
    cab.drive(420, 0.8)
    assert any("axis=slew limit=stopped why=enable" in text for text in cab.events)
    assert not cab.moves
    assert cab.slew == (State.TRIPPED, Reason.OUTPUT_REFUSED)


def _drive_without_look(cab: Cab, time_ms: int, slew: float) -> None:
    for _ in range(time_ms // TICK_MS):
        cab.time_ms += TICK_MS
        for frame in cab.hand.frames(cab.time_ms, Held({"slew": slew}, enable=True)):
            if changed := cab.change(frame):
                cab.gated.receive(changed, cab.time_ms * 1_000_000)
        for frame in cab.gated.tick(cab.time_ms * 1_000_000):
            cab.sent[frame.can_id] = frame.data
        cab.events += [event.text for event in cab.controller.events]
        cab.controller.events.clear()


FIRST = "of 20 ms\n    enable: "  # of the left joystick
OTHERS, HELD = 0x5F, 0x20


@pytest.mark.parametrize("layout", ["40|8@1+", "40|8@1-", "47|8@0+"])
def test_one_bit_of_a_byte_enables(changed_rig: Make, layout: str) -> None:
    keys, after = f' SG_ Keys : {layout} (1,0) [0|0] "" SHAPER\n', " SG_ NearFar : 16|16@1-"
    rig = changed_rig({f"{FIRST}Enable": f"{FIRST}Keys/5"}, {after: keys + after})
    rig.run(5, Keys=OTHERS)
    assert rig.state("slew") is State.NEUTRAL_WAIT
    rig.run(5, Keys=HELD)
    assert rig.run(20, Slew=1000, Keys=HELD)["SlewCommand"]["Velocity"] > 0.0
    assert rig.state("slew") is State.ACTIVE
    assert rig.run(2, Slew=1000, Keys=OTHERS)["SlewCommand"]["Velocity"] == 0.0
