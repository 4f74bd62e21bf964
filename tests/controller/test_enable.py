"""What enables a joystick: several switches, all needed, in other messages too."""

from collections.abc import Callable

import pytest

from canshaper.checksums.algorithms import SAE_J1850
from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.inputs.input import SwitchInput
from canshaper.machine.stopping import allowed_m
from canshaper.shaping.states import Reason, State
from canshaper_sim.hand import Hand, Held
from tests.rigs.files import Machine

SEAT_DBC = """BO_ 288 Seat: 2 JOYSTICKS
 SG_ Seated : 0|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Door : 2|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Count : 4|4@1+ (1,0) [0|15] "" SHAPER
 SG_ Check : 8|8@1+ (1,0) [0|255] "" SHAPER

BO_ 289 Ecu: 1 JOYSTICKS
 SG_ Mode : 0|8@1+ (1,0) [0|255] "" SHAPER

"""
SEAT_KEYS = (
    "alive_counter: Count, checksum: { signal: Check, kind: crc8_sae_j1850 }, timeout_ms: 200"
)
SWITCHES = f"""switches:
  seat: {{ bus: crane, message: Seat, signal: Seated, {SEAT_KEYS} }}
  door: {{ bus: crane, message: Seat, signal: Door, {SEAT_KEYS} }}
  mode: {{ bus: crane, message: Ecu, signal: Mode, code: 3, timeout_ms: 300 }}

axes:
"""
LEFT = "enable: Enable"
TICK_MS = 20


@pytest.fixture
def switched(machine: Machine) -> Machine:
    """The left joystick needs seat, door, mode and the switch of the right one besides its own."""
    machine.in_dbc("BO_ 512 SlewCommand", SEAT_DBC + "BO_ 512 SlewCommand")
    cycle = 'BA_ "GenMsgCycleTime" BO_ 272 20;\n'
    machine.in_dbc(
        cycle, cycle + cycle.replace("272 20", "288 100") + cycle.replace("272 20", "289 100")
    )
    machine.in_yaml("axes:\n", SWITCHES)
    machine.in_yaml(LEFT, "enable: [Enable, seat, door, mode, right.Enable]")
    return machine


class Cab:
    """The controller behind its guard, and an operator who has switches of every kind."""

    def __init__(self, machine: Machine) -> None:
        self.deployment = machine.load()
        self.controller = Controller(self.deployment)
        self.guarded = Guarded(self.controller)
        self.hand = Hand(self.deployment)
        self.time_ms = 0
        self.sent: dict[int, bytes] = {}
        self.change: Callable[[Frame], Frame | None] = lambda frame: frame
        self.events: list[str] = []

    def drive(self, time_ms: int, slew: float = 0.0, *, enable: bool = True) -> None:
        for _ in range(time_ms // TICK_MS):
            self.time_ms += TICK_MS
            for frame in self.hand.frames(self.time_ms, Held({"slew": slew}, enable=enable)):
                if changed := self.change(frame):
                    self.guarded.receive(changed, self.time_ms * 1_000_000)
            for frame in self.guarded.tick(self.time_ms * 1_000_000):
                self.sent[frame.can_id] = frame.data
            events = self.controller.events
            self.events += [e.text for e in events]
            assert not any("output=refused" in text for text in self.events), self.events
            events.clear()

    @property
    def slew(self) -> tuple[State, Reason]:
        axis = self.controller.axes["slew"].axis
        return axis.state, axis.reason

    @property
    def moves(self) -> bool:
        return self.sent[512][0] != 0


def without(can_id: int) -> Callable[[Frame], Frame | None]:
    return lambda frame: None if frame.can_id == can_id else frame


def seat(seated: int, door: int, *, right_sum: bool = True) -> Callable[[Frame], Frame]:
    """The message of seat and door with other switches."""

    def change(frame: Frame) -> Frame:
        if frame.can_id != 288:
            return frame
        first = bytes((frame.data[0] & 0xF0 | door << 2 | seated,))
        return frame._replace(data=first + bytes((SAE_J1850.of(first) ^ (not right_sum),)))

    return change


def mode(code: int) -> Callable[[Frame], Frame]:
    return lambda frame: frame._replace(data=bytes((code,))) if frame.can_id == 289 else frame


def right_enable(code: int) -> Callable[[Frame], Frame]:
    return enable_of(273, code)


def enable_of(joystick: int, code: int) -> Callable[[Frame], Frame]:
    def change(frame: Frame) -> Frame:
        if frame.can_id != joystick:
            return frame
        return frame._replace(
            data=frame.data[:4] + bytes((frame.data[4] & ~3 | code,)) + frame.data[5:]
        )

    return change


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
    cab.guarded.receive(frame, cab.time_ms * 1_000_000 + 1)
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
        cab.guarded.receive(frame, cab.time_ms * 1_000_000 + step)
    cab.drive(TICK_MS, 0.8)
    assert cab.slew == (State.TRIPPED, Reason.ENABLE_LOST)


def test_a_latched_emergency_stop_is_not_reset_by_a_seat(switched: Machine) -> None:
    cab = Cab(switched)
    cab.drive(200)
    cab.drive(600, 0.8)
    cab.controller.axes["slew"].trip(Reason.SECOND_SENDER)
    cab.drive(100)
    cab.change = seat(0, 1)
    cab.drive(300)
    cab.change = lambda frame: frame
    cab.drive(300)
    assert cab.slew == (State.TRIPPED, Reason.SECOND_SENDER)


# -- the switch to press is in another message ---------------------------------------------------


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
    cab.controller.axes["slew"].trip(Reason.SECOND_SENDER)
    cab.drive(400)
    assert cab.slew == (State.TRIPPED, Reason.SECOND_SENDER)
    can_id = {"enable: Enable": 272, "enable: seat": 288}.get(enable, 273)
    last = next(f for f in cab.hand.frames(cab.time_ms, Held(enable=True)) if f.can_id == can_id)
    counted = cab.hand.frames(cab.time_ms + 100, Held(enable=True))
    for frame in (last, *(f for f in counted if f.can_id == can_id)):
        cab.guarded.receive(frame, cab.time_ms * 1_000_000 + 1)
    released = seat(0, 1)(last) if can_id == 288 else enable_of(can_id, 0)(last)
    cab.guarded.receive(released, cab.time_ms * 1_000_000 + 2)  # behind those: a step back
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


# -- a reload, limits, the guard -----------------------------------------------------------------


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


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_the_guard_does_not_need_the_controller_for_it(
    switched: Machine, loss: Callable[[Frame], Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A controller that has forgotten its switches: the guard lets nothing pass."""
    cab = Cab(switched)
    for runner in cab.controller.axes.values():
        runner._interlocks.clear()
    cab.drive(200)
    cab.drive(600, 0.8)
    assert cab.moves
    cab.change = loss
    monkeypatch.setattr(Cab, "drive", _drive_without_look)
    cab.drive(420, 0.8)
    assert any("axis=slew limit=enable" in text for text in cab.events)
    assert not cab.moves
    assert cab.slew == (State.TRIPPED, Reason.OUTPUT_REFUSED)


def _drive_without_look(cab: Cab, time_ms: int, slew: float) -> None:
    for _ in range(time_ms // TICK_MS):
        cab.time_ms += TICK_MS
        for frame in cab.hand.frames(cab.time_ms, Held({"slew": slew}, enable=True)):
            if changed := cab.change(frame):
                cab.guarded.receive(changed, cab.time_ms * 1_000_000)
        for frame in cab.guarded.tick(cab.time_ms * 1_000_000):
            cab.sent[frame.can_id] = frame.data
        cab.events += [event.text for event in cab.controller.events]
        cab.controller.events.clear()


def test_the_way_to_stop_counts_the_slowest_switch(switched: Machine) -> None:
    axis = switched.load().config.axes["slew"]
    distance = allowed_m(axis, timeout_ms=300, period_s=0.02)
    assert distance
    switched.in_yaml("stop_distance_m: 200", f"stop_distance_m: {distance + 0.01:.2f}")
    switched.load()
    switched.in_yaml("code: 3, timeout_ms: 300", "code: 3, timeout_ms: 400")
    assert "axes.slew.limits.stop_distance_m: expected" in switched.problems()[0]


# -- what the file may not say -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("right.Enable]", "rihgt.Enable]", "enable.4: expected a joystick, got 'rihgt'"),
        ("right.Enable]", "right.Enabel]", "expected a signal of JoystickRight, got 'Enabel'"),
        ("right.Enable]", "seet]", "expected a signal of JoystickLeft, got 'seet'"),
        ("right.Enable]", "seat]", "enable.4: expected each switch once, got 'seat' again"),
        ("right.Enable]", "right.Lift]", "expected a free signal, got 'Lift', which is enable"),
        (", mode,", ",", "switches.mode: expected a joystick that mode enables, got none"),
        ("signal: Door", "signal: Seated", "expected a free signal, got 'Seated'"),
        ("signal: Mode, code", "signal: Mode, cycle_ms: 200, code", "timeout_ms: expected 400 ms"),
        ("code: 3", "code: 256", "mode.code: expected up to 255, of 8 bits of Mode, got 256"),
        ("signal: Door", "signal: Door, code: 4", "door.code: expected up to 3, of 2 bits of Door"),
        ("Door, alive_counter: Count,", "Door,", "the same as switches.seat, which reads the"),
        ("message: Ecu", "message: JoystickLeft", "which is used already by"),
        ("[Enable, seat, door, mode, right.Enable]", "[]", "enable: expected 1 or more entries"),
        ("    enable: [", "    enable_of: right\n    enable: [", "enable and enable_of, got both"),
        ("    enable: [Enable, seat, door, mode, right.Enable]\n", "", "enable_of, got neither"),
        ("enable: [Enable, seat, door, mode, right.Enable]", "enable_of: left", "got both"),
        (
            "enable: [Enable, seat, door, mode, right.Enable]",
            "enable_of: front",
            "enable_of: expected a joystick with enable, got 'front'; there are right",
        ),
    ],
)
def test_what_is_wrong_is_one_line(switched: Machine, old: str, new: str, says: str) -> None:
    if says == "got both" and "enable_of: left" in new:
        new, says = "enable_of: left", "enable_of: expected a joystick with enable, got 'left'"
    switched.in_yaml(old, new)
    assert any(says in problem for problem in switched.problems()), switched.problems()


def test_a_message_without_a_cycle_is_no_switch(switched: Machine) -> None:
    switched.in_dbc('BA_ "GenMsgCycleTime" BO_ 289 100;\n', "")
    line = switched.in_dbc("BO_ 289", "BO_ 289")
    assert switched.problems() == [
        f"machine.dbc:{line}: Ecu: has no GenMsgCycleTime; cycle_ms may say it"
    ]
