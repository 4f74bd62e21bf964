"""Demands of a joystick whose enable switch is in the frames of another one."""

from collections.abc import Callable, Iterator

import pytest

from canshaper.codec.frame import Frame, FrameFault, MessageKey
from canshaper.controller.controller import Controller
from canshaper.inputs.input import Input, Switch, SwitchInput
from canshaper.inputs.joystick import JoystickInput
from canshaper.inputs.stops import EmergencyStopInput, EnableGate
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import CommandInput, Reason
from canshaper_sim.hand import Hand, Held
from tests.controller.cab import enable_of, seat
from tests.rigs.files import ROOT, Machine

LEFT, RIGHT, SEAT = 272, 273, 288
MS = 1_000_000


class Inputs:
    """Inputs of a controller, without their axes."""

    def __init__(self, deployment: Deployment) -> None:
        self.controller = Controller(deployment)
        self._hand = Hand(deployment)
        self._time_ms = 0
        self.now_ns = 0

    def frames(self) -> Iterator[Frame]:
        """The next frames of every node, with all that enables."""
        self._time_ms += 100
        self.now_ns = self._time_ms * MS
        yield from self._hand.frames(self._time_ms, Held(enable=True))

    def receive(self, change: Callable[[Frame], Frame] = lambda frame: frame) -> None:
        """Receive them, changed."""
        for frame in self.frames():
            changed = change(frame)
            self.controller.inputs[changed[:3]].receive(changed.data, self.now_ns)

    def of(self, can_id: int) -> object:
        return self.controller.inputs["crane", can_id, False]


class Joystick:
    """One whose enable is that of the other joystick."""

    def __init__(self, inputs: Inputs) -> None:
        self.receive = inputs.receive
        left, right = inputs.of(LEFT), inputs.of(RIGHT)
        assert isinstance(left, JoystickInput)
        assert isinstance(right, JoystickInput)
        self.input, self.other = left, right
        self._inputs = inputs
        self.releases = 0

    def command(self, later_ms: int = 0, trip: Reason | None = None) -> CommandInput:
        """Demand of an axis now, and its knowledge of the switch from now on."""
        now_ns = self._inputs.now_ns + later_ms * MS
        command, self.releases = self.input.command("Slew", now_ns, self.releases, trip, 0.02)
        return command


@pytest.fixture
def inputs(switched: Machine) -> Inputs:
    return Inputs(switched.load())


@pytest.fixture
def joystick(switched: Machine) -> Joystick:
    switched.in_yaml("enable: [Enable, seat, door, mode, right.Enable]", "enable_of: right")
    switched.in_yaml("enable: Enable", "enable: [Enable, seat]")
    switched.yaml = switched.yaml.replace("  door: {", "  #").replace("  mode: {", "  #")
    one = Joystick(Inputs(switched.load()))
    one.receive()
    assert one.command() == CommandInput(0.0)
    return one


def test_each_release_that_is_over_by_the_tick_counts_once(joystick: Joystick) -> None:
    for _ in range(3):
        joystick.receive(enable_of(RIGHT, 0))
        joystick.receive()
        assert joystick.command() == CommandInput(0.0, enabled=False)
        assert joystick.command() == CommandInput(0.0)


def test_it_stays_released_until_a_frame_says_otherwise(joystick: Joystick) -> None:
    joystick.receive(enable_of(RIGHT, 0))
    for _ in range(3):
        assert joystick.command(20) == CommandInput(0.0, enabled=False)
    joystick.receive()
    assert joystick.command() == CommandInput(0.0)


def test_its_silence_disables_and_is_no_press(joystick: Joystick) -> None:
    lost = CommandInput(
        fault=Reason.JOYSTICK_TIMEOUT, enabled=False, reset=True, trip=Reason.SECOND_SENDER
    )
    assert joystick.command(5000, Reason.SECOND_SENDER) == lost


def test_a_joystick_without_a_switch_of_its_own_has_no_invalid_one(joystick: Joystick) -> None:
    for frame in joystick._inputs.frames():
        if frame.can_id == LEFT:
            assert joystick.input.receive(frame.data, joystick._inputs.now_ns) is FrameFault.NONE


def test_switches_of_a_message_are_different_ones(joystick: Joystick) -> None:
    enable = joystick.other.watch("Enable")
    assert joystick.other.watch("Enable") is enable
    assert joystick.other.watch("Reset") is not enable


def test_a_joystick_counts_every_release_of_its_own_switch() -> None:
    inputs = Inputs(load_deployment(ROOT / "config/forwarder.yaml"))
    joystick = Joystick(inputs)
    inputs.receive()
    for _ in range(3):
        inputs.receive(enable_of(LEFT, 0))
        inputs.receive()
        assert joystick.command() == CommandInput(0.0, enabled=False)
        assert joystick.command() == CommandInput(0.0)


@pytest.fixture
def switch(inputs: Inputs) -> Switch:
    message = inputs.of(SEAT)
    assert isinstance(message, SwitchInput)
    return Switch(message, "Seated", 1)


def test_a_switch_that_nothing_was_received_of_was_not_released(switch: Switch) -> None:
    assert (switch.releases, switch.released) == (0, False)
    switch.on_frame({"Seated": 0}, accepted=False)
    assert not switch.doubted(0)  # no frame that counts has said that it agrees
    assert (switch.releases, switch.released) == (1, True)


def test_a_release_in_doubt_is_over_with_the_next_frame_that_counts(switch: Switch) -> None:
    switch.on_frame({"Seated": 1}, accepted=True)
    assert not switch.doubted(0)
    switch.on_frame({"Seated": 0}, accepted=False)
    assert switch.doubted(0)
    assert switch.doubted(1)
    switch.on_frame({"Seated": 1}, accepted=True)
    assert switch.doubted(0)
    assert not switch.doubted(1)


def test_a_gate_counts_every_release_since_it_was_asked(inputs: Inputs) -> None:
    inputs.receive()
    message = inputs.of(SEAT)
    assert isinstance(message, SwitchInput)
    gate = EnableGate(list(message.switches.values()))
    assert gate(True, inputs.now_ns) is None
    for _ in range(3):
        inputs.receive(seat(0, 1))
        inputs.receive()
        assert gate(False, inputs.now_ns) is Reason.ENABLE_LOST
        assert gate(False, inputs.now_ns) is None


@pytest.fixture
def remote() -> Inputs:
    return Inputs(load_deployment(ROOT / "config/remote-forwarder.yaml"))


def stop_of(inputs: Inputs) -> EmergencyStopInput:
    return next(i for i in inputs.controller.inputs.values() if isinstance(i, EmergencyStopInput))


def test_an_emergency_stop_counts_every_press(remote: Inputs) -> None:
    stop = stop_of(remote)
    for presses in range(3):
        for pressed in (1, 0):
            stop.on_frame({"Stop": pressed}, 0, accepted=True)
        assert stop.stop(0, presses) is Reason.EMERGENCY_STOP
        assert stop.presses == presses + 1


def test_a_reload_continues_the_sequence_of_switches_and_emergency_stop(
    inputs: Inputs, remote: Inputs
) -> None:
    (switches, *_), stop = inputs.controller.deployment.switches, remote.controller.deployment
    assert stop.emergency_stop is not None
    after: list[tuple[Inputs, MessageKey, Input]] = [
        (inputs, switches.key, SwitchInput(switches, switches.switches)),
        (remote, stop.emergency_stop.key, EmergencyStopInput(stop.emergency_stop, "Stop")),
    ]
    for one, key, new in after:
        (last,) = (frame for frame in one.frames() if frame[:3] == key)
        before = one.controller.inputs[key]
        assert before.receive(last.data, one.now_ns) is FrameFault.NONE
        new.copy_state(before)
        assert new.receive(last.data, one.now_ns + MS) is FrameFault.COUNTER_REPEATED
