"""A joystick's frame through the gateway: ours in it are the velocities, and when it leaves."""

import itertools
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.frame import Frame, FrameFault
from canshaper.shaping.states import Reason
from tests.rigs.emergency import DBC, STOP, STOP_ID
from tests.rigs.gateway import TICK_NS, GatewayRig

VELOCITIES = 0xFFFFFFFF  # Slew and NearFar: the first four bytes
COUNTER = 0xFF << 56
FREE = 0x00FF_FFC0_0000_0000  # bits of JoystickLeft that no signal has


@pytest.fixture
def rig(tmp_path: Path) -> GatewayRig:
    return GatewayRig(tmp_path)


def word(frame: Frame) -> int:
    return int.from_bytes(frame.data, "little")


def test_it_leaves_at_once_on_the_other_bus_with_its_own_id(rig: GatewayRig) -> None:
    passed = rig.receive(rig.joystick())
    assert passed is not None
    assert passed[:3] == ("machine", 0x110, False)


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> GatewayRig:
    return GatewayRig(tmp_path_factory.mktemp("gateway")).moving()


@given(st.integers(0, 2**64 - 1), st.integers(-1000, 1000), st.integers(0, 1))
def test_every_other_bit_is_untouched(
    quick: GatewayRig, bits: int, joystick: int, reset: int
) -> None:
    frame = quick.joystick(junk=bits & FREE, NearFar=joystick, Reset=reset)
    passed = quick.receive(frame)
    assert passed is not None
    mine = VELOCITIES | COUNTER
    assert word(passed) & ~mine == word(frame) & ~mine
    assert quick.decoded(passed)["Slew"] > 400  # as in the last tick
    assert quick.decoded(passed)["NearFar"] == 0


def test_the_velocity_is_the_shaped_one_of_the_last_tick(rig: GatewayRig) -> None:
    rig.run(3)
    assert rig.run(1, Slew=1000)["Slew"] == 0  # the tick comes after the frame
    ours = rig.run(1, Slew=1000)["Slew"]
    assert 0 < ours <= 150  # 5 full speeds a second, and the dead band of 5 %


def test_the_counter_is_ours_and_has_no_gap(rig: GatewayRig) -> None:
    """Where the joystick's has one: a lost frame is one that we have not passed on."""
    rig.run(3)
    rig.joystick()  # is lost
    rig.run(300)
    counts = [rig.decoded(f)["AliveCounter"] for f in rig.left if f.can_id == 0x110]
    assert [(b - a) % 256 for a, b in itertools.pairwise(counts)] == [1] * 302


@pytest.mark.parametrize("cut", [True, False], ids=["short", "twice"])
def test_what_does_not_count_does_not_pass(rig: GatewayRig, cut: bool) -> None:
    rig.run(3)
    frame = rig.joystick()
    if cut:
        frame = frame._replace(data=frame.data[:7])
    else:
        rig.receive(frame)
    assert rig.receive(frame) is None


def test_a_frame_of_another_message_makes_none(rig: GatewayRig) -> None:
    rig.run(3)
    assert rig.receive(Frame("joysticks", 0x400, False, bytes(4))) is None
    assert rig.receive(Frame("machine", 0x400, False, bytes(4))) is None


def test_without_a_joystick_nothing_is_sent(rig: GatewayRig) -> None:
    for _ in range(50):
        assert rig.tick() == []


def test_a_lost_joystick_ends_in_a_shaped_stop_of_our_own_and_then_silence(rig: GatewayRig) -> None:
    rig.moving()
    before = rig.decoded(rig.left[-2])["AliveCounter"]
    own: list[Frame] = []
    gaps = []
    for tick in range(200):
        frames = [f for f in rig.tick() if f.can_id == 0x110]
        own += frames
        gaps += [tick] if frames else []
    assert gaps == list(range(gaps[0], gaps[0] + len(gaps)))  # each cycle, until it is over
    assert gaps[0] in (5, 6)  # after 100 ms, not sooner
    values = [rig.decoded(frame) for frame in own]
    speeds = [v["Slew"] for v in values]
    assert speeds[0] > 300
    assert speeds[-1] == 0
    assert 20 < len(speeds) < 102  # stop_s is 2 s
    assert [v["AliveCounter"] for v in values] == [
        (before + i) % 256 for i in range(1, len(values) + 1)
    ]
    assert {v["Enable"] for v in values[:-1]} == {1}  # else the ECU would not let it stop so
    assert {(v["Reset"], v["AntiSwayOff"], v["NearFar"]) for v in values} == {(0, 0, 0)}
    assert rig.state()[0] == "NEUTRAL_WAIT"


def test_nothing_in_our_own_frames_is_older_than_the_axes(rig: GatewayRig) -> None:
    """A joystick that no axis has, a pressed reset: of a lost joystick nothing is held."""
    rig.run(3)
    rig.run(60, Lift=1000, Rotate=500)
    while not (own := rig.tick()):
        pass
    values = rig.decoded(own[0])
    assert values["Lift"] > 0
    assert values["Rotate"] == 32767  # "not available": its start value


def test_a_joystick_without_a_start_value_is_neutral_in_our_own_frames(tmp_path: Path) -> None:
    """Raw 0 of an unsigned signal with an offset would be full speed."""
    rig = GatewayRig(
        tmp_path,
        dbc=(
            ("Rotate : 16|16@1- (0.1,0)", "Rotate : 16|16@1+ (0.1,-1000)"),
            ('BA_ "GenSigStartValue" SG_ 273 Rotate 32767;\n', ""),
        ),
    )
    rig.run(3, Rotate=10000)
    rig.run(60, Lift=1000, Rotate=10000)
    while not (own := rig.tick()):
        pass
    assert rig.decoded(own[0])["Rotate"] == 10000


def test_a_joystick_that_comes_back_is_passed_on_in_the_stop(rig: GatewayRig) -> None:
    rig.moving()
    for _ in range(12):
        rig.tick()
    passed = rig.receive(rig.joystick(Slew=1000))
    assert passed is not None
    assert 0 < rig.decoded(passed)["Slew"] < 1000
    assert rig.state()[0] == "STOPPING"
    assert rig.tick() == []  # there is one of the joystick
    assert rig.run(100, Slew=1000)["Slew"] == 0
    assert rig.state() == ("NEUTRAL_WAIT", "JOYSTICK_NOT_NEUTRAL")


def test_enable_off_leaves_with_its_frame_and_neutral_in_the_same(rig: GatewayRig) -> None:
    rig.moving()
    left = rig.run(1, Slew=1000, Enable=0)
    assert (left["Enable"], left["Slew"]) == (0, 0)
    assert rig.run(1, Slew=1000, Enable=0)["Slew"] == 0
    assert rig.state() == ("TRIPPED", "ENABLE_LOST")


def test_a_release_that_is_over_makes_the_next_frame_neutral(rig: GatewayRig) -> None:
    rig.moving()
    rig.receive(rig.joystick(Slew=1000, Enable=0))
    passed = rig.receive(rig.joystick(Slew=1000))
    assert passed is not None
    assert (rig.decoded(passed)["Slew"], rig.decoded(passed)["Enable"]) == (0, 1)
    rig.tick()
    assert rig.state() == ("TRIPPED", "ENABLE_LOST")
    rig.run(3, Enable=0)
    rig.moving()


def test_a_trip_that_is_noted_makes_the_next_frame_neutral(rig: GatewayRig) -> None:
    """The last frame did not reach the ECU: the velocity of the last tick goes no further."""
    rig.moving()
    rig.controller.send_failed(rig.left[-2])
    passed = rig.receive(rig.joystick(Slew=1000))
    assert passed is not None
    assert rig.decoded(passed)["Slew"] == 0
    assert rig.tick() == []
    assert rig.state() == ("TRIPPED", "SEND_FAILED")


def test_neutral_after_a_trip_does_not_wait_for_a_joystick_that_is_late(rig: GatewayRig) -> None:
    rig.moving()
    rig.controller.axes["slew"].stops.trip = Reason.EMERGENCY_STOP
    sent = [rig.tick() for _ in range(4)]
    assert [len(frames) for frames in sent] == [0, 0, 1, 0]
    values = rig.decoded(sent[2][0])
    assert (values["Slew"], values["Enable"]) == (0, 0)


def test_another_sender_of_the_joystick_behind_us_trips(rig: GatewayRig) -> None:
    rig.moving()
    foreign = Frame("machine", 0x110, False, bytes(8))
    assert rig.receive(foreign) is None
    assert rig.controller.counters.last_fault is FrameFault.SECOND_SENDER
    assert rig.run(2, Slew=1000)["Slew"] == 0
    assert rig.state() == ("TRIPPED", "SECOND_SENDER")
    assert rig.state("lift")[0] == "READY"


def test_a_trip_before_the_first_joystick_frame_sends_nothing(rig: GatewayRig) -> None:
    rig.receive(Frame("machine", 0x110, False, bytes(8)))
    assert [rig.tick() for _ in range(10)] == [[]] * 10
    assert rig.state() == ("TRIPPED", "SECOND_SENDER")


def test_a_frame_that_did_not_go_out_trips(rig: GatewayRig) -> None:
    rig.moving()
    passed = rig.receive(rig.joystick(Slew=1000))
    assert passed is not None
    rig.controller.send_failed(passed)
    rig.tick()
    assert rig.state() == ("TRIPPED", "SEND_FAILED")


def test_ids_that_no_one_knows_are_no_fault_in_the_line(rig: GatewayRig) -> None:
    rig.run(3)
    for bus in ("joysticks", "machine"):
        assert rig.receive(Frame(bus, 0x7E8, False, bytes(8))) is None
    assert rig.controller.counters.values["UnknownId"] == 0


def test_the_last_frame_is_neutral_where_the_one_before_was_not(rig: GatewayRig) -> None:
    assert rig.controller.neutral_frames() == []  # no joystick was received yet
    rig.moving()
    (frame,) = rig.controller.neutral_frames()
    assert (rig.decoded(frame)["Slew"], rig.decoded(frame)["Enable"]) == (0, 0)
    (again,) = rig.controller.neutral_frames()  # the one before may be lost
    assert again.data[:2] == frame.data[:2]


def test_ten_late_frames_in_one_tick_leave_in_their_order(rig: GatewayRig) -> None:
    rig.run(3)
    for joystick in range(10):
        rig.receive(rig.joystick(Reset=joystick % 2))
    assert [rig.decoded(f)["Reset"] for f in rig.left[-10:]] == [0, 1] * 5
    assert rig.now_ns == 3 * TICK_NS


@pytest.mark.parametrize("over", [False, True])
def test_a_pressed_emergency_stop_makes_the_next_frame_neutral(tmp_path: Path, over: bool) -> None:
    """It leaves before the tick in which the axes trip."""
    stop = STOP.replace("bus: crane", "bus: joysticks").replace("60", "1000")
    last = "status: { bus: machine, message: ShaperStatus }"
    rig = GatewayRig(tmp_path, yaml=((last, stop + last),), dbc=tuple(DBC.items()))

    def stop(count: int, pressed: int) -> Frame:
        return Frame("joysticks", STOP_ID, False, bytes((pressed, count, 0)))

    rig.receive(stop(0, 0))
    rig.run(3)
    assert rig.run(30, Slew=1000)["Slew"] > 300
    rig.receive(stop(1, 1))
    if over:
        rig.receive(stop(2, 0))
    passed = rig.receive(rig.joystick(Slew=1000))
    assert passed is not None
    assert (rig.decoded(passed)["Slew"], rig.decoded(passed)["Enable"]) == (0, 1)
    rig.tick()
    assert rig.state() == ("TRIPPED", "EMERGENCY_STOP")
