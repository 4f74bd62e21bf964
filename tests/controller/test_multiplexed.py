"""Messages with a multiplexor: only frames with the value that the file names are meant."""

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.gate.build import record_of
from canshaper.gate.gate import Gate
from canshaper.shaping.states import Reason
from canshaper_sim.hand import Hand, Held
from tests.rigs.files import Machine

KIND = ' SG_ Kind M : 40|4@1+ (1,0) [0|0] "" SHAPER\n'


@pytest.fixture
def multiplexed(machine: Machine) -> Machine:
    """The left joystick in the frames of kind 3; in those of kind 5 its bytes mean other things."""
    machine.in_dbc(
        " SG_ Slew : 0", f'{KIND} SG_ Other m5 : 0|16@1+ (1,0) [0|0] "" SHAPER\n SG_ Slew m3 : 0'
    )
    machine.in_dbc("NearFar :", "NearFar m3 :")
    machine.in_dbc("Enable : 32|2", "Enable m3 : 32|2")
    machine.in_yaml("message: JoystickLeft", "message: JoystickLeft\n    multiplexor: 3")
    return machine


def frame(kind: int, slew: int, enable: int, count: int) -> bytes:
    return slew.to_bytes(2, "little") + bytes((0, 0, enable, kind, 0, count & 0xFF))


def test_frames_with_another_value_are_nobodys(multiplexed: Machine) -> None:
    deployment = multiplexed.load()
    controller, gate = Controller(deployment), Gate(record_of(deployment))
    joystick, key = controller.joysticks["left"], ("crane", 272, False)
    for count, (kind, slew, enable) in enumerate(
        [
            (3, 500, 1),
            (5, 0xFFFF, 0),
            (3, 500, 1),
            (5, 900, 0),
            (5, 900, 0),
            (5, 900, 0),
            (3, 500, 1),
        ]
    ):
        now_ns = (count + 1) * 20_000_000
        data = frame(kind, slew, enable, count)
        controller.receive(Frame(*key, data), now_ns)
        gate.receive(key, data, now_ns)
        assert joystick.commands == {"Slew": 0.5, "NearFar": 0.0}
        assert gate.axes["slew"].demand == 0.5
        assert (joystick.releases, gate.joysticks["left"].pressed.released) == (0, False)
    # They count in the sequence, whose counter they have: none of these was a jump.
    assert controller.counters.last_fault is FrameFault.NONE
    # What is meant has not come: it is lost, however often the others come.
    for count in range(7, 20):
        data = frame(5, 0, 1, count)
        now_ns = (count + 1) * 20_000_000
        controller.receive(Frame("crane", 272, False, data), now_ns)
    assert joystick.lost(now_ns) is Reason.JOYSTICK_TIMEOUT


def test_a_counter_of_these_frames_alone(multiplexed: Machine) -> None:
    multiplexed.in_dbc("AliveCounter :", "AliveCounter m3 :")
    controller = Controller(multiplexed.load())
    for tick, (kind, count) in enumerate([(3, 1), (5, 77), (3, 2), (5, 140), (3, 3)]):
        data = frame(kind, 500, 1, count)
        controller.receive(Frame("crane", 272, False, data), (tick + 1) * 20_000_000)
    assert controller.counters.last_fault is FrameFault.NONE
    assert controller.joysticks["left"].commands["Slew"] == 0.5


def test_the_simulated_operator_sends_what_is_meant(multiplexed: Machine) -> None:
    frames = Hand(multiplexed.load()).frames(0, Held({"slew": 0.5}, enable=True))
    (data,) = (f.data for f in frames if f.can_id == 272)
    assert data[5] == 3
    assert int.from_bytes(data[:2], "little") == 500


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("multiplexor: 3", "multiplexor: 4", "expected a value of Kind, got 4; there are 3, 5"),
        ("multiplexor: 3", "multiplexor: 5", "expected a signal of JoystickLeft, got 'Slew'"),
        ("multiplexor: 3", "multiplexor: -1", "multiplexor: expected"),
    ],
)
def test_values_that_cannot_be(multiplexed: Machine, old: str, new: str, says: str) -> None:
    multiplexed.in_yaml(old, new)
    assert any(says in problem for problem in multiplexed.problems()), multiplexed.problems()
