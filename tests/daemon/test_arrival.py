"""An age counts from the arrival of a frame, bad news from the moment it is read.

Frames wait while the loop does something else. What is fresh or lost is decided by when they
arrived; a release, a press, a foreign sender in them counts in the next tick, however old it is.
"""

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.config.bus import CanopenNode
from canshaper.inputs.stops import FOREIGN_NS
from canshaper.protocols.canopen.nodes import RemoteNode
from canshaper.shaping.states import State
from tests.rigs.canopen import OPERATIONAL
from tests.rigs.emergency import PRESSED, Machine
from tests.rigs.forwarder import SLOW_VALVE, TICK_NS, Make, Rig
from tests.rigs.j1939 import Rig as J1939Rig
from tests.rigs.j1939 import bjm
from tests.rigs.tripped import tripped
from tests.rigs.waiting import Waiting, both, tick

MS = 1_000_000
LIMIT_NS = 100 * MS  # of both joysticks
FOREIGN = Frame("crane", 0x200, False, b"\x00\xee")
# -- ages ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("early_ns", [0, 1, 7 * MS, TICK_NS - 1, TICK_NS])
def test_silence_counts_from_the_arrival_of_the_last_frame(rig: Rig, early_ns: int) -> None:
    """Found within its limit and a tick, wherever in the tick the frame came."""
    rig.moving()
    port = Waiting()
    arrived_ns = rig.now_ns - early_ns
    port.wait(*both(rig, Slew=1000), arrived_ns=arrived_ns)
    detected_ns = rig.now_ns
    tick(rig, port)
    while rig.state() is State.ACTIVE:
        detected_ns = rig.now_ns
        tick(rig, port)
    assert rig.reason() == "JOYSTICK_TIMEOUT"
    assert LIMIT_NS < detected_ns - arrived_ns <= LIMIT_NS + TICK_NS


@pytest.mark.parametrize(("age_ns", "known"), [(LIMIT_NS, True), (LIMIT_NS + 1, False)])
def test_a_frame_that_is_too_old_when_it_is_read_moves_nothing(
    rig: Rig, age_ns: int, known: bool
) -> None:
    rig.moving()
    port = Waiting()
    rig.now_ns += 4 * TICK_NS
    port.wait(*both(rig, Slew=1000), arrived_ns=rig.now_ns - age_ns)
    tick(rig, port)
    assert rig.state() is (State.ACTIVE if known else State.STOPPING)


def test_no_frame_is_younger_than_the_tick_that_reads_it(rig: Rig) -> None:
    """One that came while the tick was held up before its read, or its age would be found late."""
    rig.moving()
    port = Waiting()
    port.wait(*both(rig, Slew=1000), arrived_ns=rig.now_ns + TICK_NS)
    for _ in range(6):
        tick(rig, port)
        assert rig.state() is State.ACTIVE
    tick(rig, port)
    assert rig.state() is State.STOPPING


def test_a_counter_is_not_expected_to_run_on_over_a_silence_between_two_arrivals(rig: Rig) -> None:
    """Both are read by one tick: the gap counts, not that they were read together."""
    rig.moving()
    port = Waiting()
    port.wait(*both(rig, Slew=1000), arrived_ns=rig.now_ns - LIMIT_NS - 1)
    rig.counts = {name: count + 100 for name, count in rig.counts.items()}
    port.wait(*both(rig, Slew=1000), arrived_ns=rig.now_ns)
    tick(rig, port)
    assert rig.controller.counters.last_fault is FrameFault.NONE
    assert rig.state() is State.ACTIVE


def test_an_address_is_silent_by_the_arrivals_of_its_frames() -> None:
    """Of J1939, where the joystick may have any: read together, they came a silence apart."""
    rig = J1939Rig()
    limit_ns = rig.deployment.config.joysticks["left"].timeout_ms * MS
    for source, arrived_ns in ((0x33, 0), (0x40, limit_ns + 1)):
        rig.controller.receive(bjm("BJM1", source), arrived_ns)
    assert rig.controller.counters.last_fault is FrameFault.NONE
    rig.controller.receive(bjm("BJM1", 0x33), 2 * limit_ns + 1)
    assert rig.controller.counters.last_fault is FrameFault.SECOND_SENDER


def test_a_node_is_as_silent_as_its_last_heartbeat_is_old() -> None:
    node = RemoteNode(CanopenNode(id=5, heartbeat_ms=200))
    node.heartbeat(bytes((OPERATIONAL,)), 7 * MS)
    assert not node.lost(207 * MS)
    assert node.lost(207 * MS + 1)


# -- bad news --------------------------------------------------------------------------------------

# Frames that arrived before the tick before, and were read by the one after it.
LATE = pytest.mark.parametrize("age_ns", [0, TICK_NS, TICK_NS + 1, 3 * TICK_NS, LIMIT_NS])


@LATE
def test_a_release_that_is_over_counts_when_it_is_read(rig: Rig, age_ns: int) -> None:
    rig.moving()
    port = Waiting()
    arrived_ns = rig.now_ns - age_ns
    port.wait(*both(rig, Enable=0, Slew=1000), *both(rig, Slew=1000), arrived_ns=arrived_ns)
    tick(rig, port)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ENABLE_LOST")
    assert port.sent[0].data[0] == 0


def test_a_release_behind_more_frames_than_a_tick_takes_counts_in_the_next(rig: Rig) -> None:
    rig.moving()
    port = Waiting(most=4)
    arrived_ns = rig.now_ns
    for enable in (1, 1, 0, 1):
        port.wait(*both(rig, Enable=enable, Slew=1000), arrived_ns=arrived_ns)
    tick(rig, port)
    assert rig.state() is State.ACTIVE
    tick(rig, port)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ENABLE_LOST")


def test_a_release_that_is_too_old_to_be_believed_is_no_shaped_stop(rig: Rig) -> None:
    """Nothing in it is known any more but that: neutral at once, not through the filter."""
    rig.moving()
    port = Waiting()
    port.wait(*both(rig, Enable=0), arrived_ns=rig.now_ns - LIMIT_NS - 1)
    tick(rig, port)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ENABLE_LOST")


@LATE
def test_a_release_that_does_not_count_is_no_press_when_it_is_over(rig: Rig, age_ns: int) -> None:
    """Out of sequence, and enabled again behind it: the way back would be a real press."""
    tripped(rig)
    port = Waiting()
    arrived_ns = rig.now_ns - age_ns
    rig.counts["JoystickLeft"] = (rig.counts["JoystickLeft"] + 100) % 256
    port.wait(*both(rig, Enable=0), arrived_ns=arrived_ns)
    for _ in range(5):
        port.wait(*both(rig), arrived_ns=arrived_ns)
    tick(rig, port)
    rig.run(5)
    assert rig.state() is State.TRIPPED


@LATE
def test_a_press_of_the_emergency_stop_that_is_over_counts_when_it_is_read(
    changed_rig: Make, age_ns: int
) -> None:
    machine = Machine(changed_rig)
    machine.run(3)
    port, rig = Waiting(), machine.rig
    arrived_ns = rig.now_ns - age_ns
    port.wait(*(machine.stop(pressed) for pressed in (1, 0)), arrived_ns=arrived_ns)
    port.wait(*both(rig), arrived_ns=rig.now_ns)
    tick(rig, port)
    assert machine.states() == PRESSED


def test_every_axis_of_a_joystick_sees_a_release_once(changed_rig: Make) -> None:
    """One with a slow valve too, whose turn comes ticks later; and none sees it twice."""
    rig = changed_rig(dbc=SLOW_VALVE)
    rig.run(31)
    port = Waiting()
    port.wait(*both(rig, Enable=0), *both(rig), arrived_ns=rig.now_ns)
    tick(rig, port)
    assert rig.controller.axes["slew"]._releases == 0
    rig.run(10)
    controls = rig.controller.axes
    assert [controls[n]._releases for n in ("slew", "near_far")] == [1, 1]


@pytest.mark.parametrize("age_ns", [0, TICK_NS, FOREIGN_NS, FOREIGN_NS + 1, 5 * FOREIGN_NS])
def test_a_second_sender_trips_however_long_ago_it_sent(rig: Rig, age_ns: int) -> None:
    rig.moving()
    port = Waiting()
    port.wait(FOREIGN, arrived_ns=rig.now_ns - age_ns)
    port.wait(*both(rig, Slew=1000), arrived_ns=rig.now_ns)
    tick(rig, port)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SECOND_SENDER")


@pytest.mark.parametrize(("age_ns", "over"), [(0, False), (FOREIGN_NS - 2 * TICK_NS, True)])
def test_the_second_of_its_silence_counts_from_its_arrival(
    rig: Rig, age_ns: int, over: bool
) -> None:
    rig.moving()
    port = Waiting()
    port.wait(FOREIGN, arrived_ns=rig.now_ns - age_ns)
    port.wait(*both(rig), arrived_ns=rig.now_ns)
    tick(rig, port)
    rig.run(3)
    rig.run(1, Reset=1)
    rig.run(1)
    assert (rig.state() is State.READY) is over
