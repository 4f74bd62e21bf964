"""The caller, the clock or the build is wrong: the valves of the C get neutral.

In Python the daemon and the gate see to that; behind the C stands nothing.
"""

import shutil
from pathlib import Path

import pytest

from canshaper.errors import NativeError
from canshaper.gate.cycle import longest_gap_ns
from canshaper.native.drive import random_drive
from canshaper.native.library import (
    C_FILES,
    NativeController,
    compile_library,
    sizes_source,
    tables_source,
)
from canshaper.native.tables import tables
from canshaper.shaping.states import Reason, State
from canshaper_sim.hand import Hand, Held
from tests.native.judge import native, needs_compiler, shipped
from tests.rigs.files import CONFIG, read

FORWARDER = read(CONFIG / "forwarder.yaml")
TICK_NS = FORWARDER.config.tick_ms * 1_000_000
MOST = longest_gap_ns(FORWARDER) // TICK_NS  # ticks from one to the next that are no standstill
LIFT = [*FORWARDER.axes].index("lift")
VALVE = FORWARDER.axes["lift"].valve.message.key
FULL, NEVER_NS, LATEST_NS = 125, -(1 << 63), (1 << 63) - 1
ACTIVE = (State.ACTIVE, Reason.JOYSTICK_MOVED)
STALLED = (State.TRIPPED, Reason.LOOP_STALLED)


class Machine:
    """An operator at the lift of forwarder.yaml, which the C drives."""

    def __init__(self, c: NativeController | None = None, *, now_ns: int = 10**12) -> None:
        self.c = c or NativeController(shipped("forwarder"))
        self.now_ns, self._time_ms, self._hand = now_ns, 0, Hand(FORWARDER)

    def tick(
        self, held: Held | None = None, *, gap_ns: int = TICK_NS, missed: int = 0, late_ns: int = 0
    ) -> int:
        """Run a tick so long after the last one; return the setpoint of the lift.

        Args:
            held: what is held; None: no frame comes.
            gap_ns: time since the last tick.
            missed: ticks that were left out, as the caller says.
            late_ns: how long after the tick the frames came, as the caller says.
        """
        self.now_ns += gap_ns
        self._time_ms += FORWARDER.config.tick_ms
        for frame in self._hand.frames(self._time_ms, held) if held else ():
            self.c.receive(frame, min(self.now_ns + late_ns, LATEST_NS))
        frames = self.c.tick(self.now_ns, missed)
        (data,) = (one.data for one in frames if one[:3] == VALVE)
        return int.from_bytes(data[:1], "little", signed=True)

    @property
    def why(self) -> tuple[State, Reason]:
        """State and reason of the lift."""
        state, reason, *_ = self.c.rows()[LIFT]
        return State(int(state)), Reason(int(reason))


REST, UP = Held(enable=True), Held({"lift": 1.0}, enable=True)


def driven(machine: Machine, **how: int) -> Machine:
    """The machine with its lift at full speed."""
    sent = [machine.tick(REST, **how) for _ in range(10)]
    sent += [machine.tick(UP, **how) for _ in range(90)]
    assert (sent[9], sent[-1], machine.why) == (0, FULL, ACTIVE)
    return machine


@pytest.mark.parametrize(
    ("gap_ns", "missed"),
    [
        (TICK_NS, 0),
        (1, 0),  # the tick before was late, this one is not
        (2 * TICK_NS - 1, 0),
        (2 * TICK_NS, 1),
        (TICK_NS, -1),  # as none
        (MOST * TICK_NS, MOST - 1),
    ],
)
def test_a_gap_that_python_allows_is_no_standstill(gap_ns: int, missed: int) -> None:
    machine = driven(Machine())
    assert machine.tick(UP, gap_ns=gap_ns, missed=missed) == FULL
    assert machine.why == ACTIVE


@pytest.mark.parametrize(
    ("gap_ns", "missed"),
    [
        (MOST * TICK_NS + 1, MOST - 1),
        ((MOST + 1) * TICK_NS, MOST),
        (501 * TICK_NS, 500),
        (501 * TICK_NS, 0),  # the caller does not count
        (TICK_NS, 500),  # or counts what was none
        (2 * TICK_NS, 0),
        (TICK_NS, 1),
        (0, 0),  # a clock that stands
        (-TICK_NS, 0),  # or goes back
        (-501 * TICK_NS, 500),
        (NEVER_NS - 10**12, 0),
        (LATEST_NS - 2 * 10**12, 0),
        (TICK_NS, (1 << 31) - 1),
    ],
)
def test_after_any_other_one_the_axis_trips(gap_ns: int, missed: int) -> None:
    """With a joystick that is held and fresh; a valve that has closed would get full speed."""
    machine = driven(Machine())
    assert machine.tick(UP, gap_ns=gap_ns, missed=missed) == 0
    assert machine.why == STALLED
    assert [machine.tick(UP) for _ in range(50)] == [0] * 50
    assert machine.why == STALLED


def test_at_rest_the_joystick_has_to_come_to_neutral_again() -> None:
    machine = Machine()
    for _ in range(10):
        machine.tick(REST)
    assert machine.tick(UP, gap_ns=501 * TICK_NS, missed=500) == 0
    assert machine.why == (State.NEUTRAL_WAIT, Reason.JOYSTICK_TIMEOUT)
    assert [machine.tick(UP) for _ in range(50)] == [0] * 50
    assert machine.why == (State.NEUTRAL_WAIT, Reason.JOYSTICK_NOT_NEUTRAL)


@pytest.mark.parametrize("now_ns", [10**12, NEVER_NS])
def test_frames_that_waited_meanwhile_do_not_count(now_ns: int) -> None:
    machine = Machine(now_ns=now_ns)
    machine.tick(REST)
    assert machine.why == (State.READY, Reason.JOYSTICK_NEUTRAL)
    machine.tick(REST, gap_ns=0)
    machine.tick()
    assert machine.why == (State.NEUTRAL_WAIT, Reason.JOYSTICK_TIMEOUT)
    machine.tick(REST)
    assert machine.why == (State.READY, Reason.JOYSTICK_NEUTRAL)


def test_a_clock_that_stands_never_begins_a_motion() -> None:
    machine = Machine()
    held = [REST] * 10 + [UP] * 90
    assert {machine.tick(one, gap_ns=0) for one in held} == {0}


@pytest.mark.parametrize("now_ns", [10**12, 0, -(10**12), NEVER_NS + 10**12])
@pytest.mark.parametrize("late_ns", [-1_000, 0, 1_000_000, 10**10, LATEST_NS])
def test_a_joystick_that_is_silent_stops_the_axis_in_time(now_ns: int, late_ns: int) -> None:
    """A frame from the future counts as one of now, as in Python; and a clock may begin below 0."""
    machine = driven(Machine(now_ns=now_ns), late_ns=late_ns)
    silent = 0
    while machine.why == ACTIVE:
        machine.tick()
        silent += 1
    timeout_ns = min(one.config.timeout_ms for one in FORWARDER.joysticks.values()) * 1_000_000
    assert silent == (timeout_ns + min(late_ns, 0)) // TICK_NS + 1
    assert machine.why == (State.STOPPING, Reason.JOYSTICK_TIMEOUT)


@pytest.mark.parametrize("late_ns", [1, 10**10, 1 << 62])
def test_every_frame_from_the_future_counts_as_one_of_now(late_ns: int) -> None:
    """As the daemon reads it: a random drive, at last without a measured radius, is the same."""
    robust = read(CONFIG / "forwarder-robust.yaml")
    one, other = (NativeController(shipped("forwarder-robust")) for _ in range(2))
    (radius,) = (one.radius for one in robust.motions.values() if one.radius)
    for number, tick in enumerate(random_drive(robust, "first", 2_000)):
        for frame in tick.frames:
            if number > 1_000 and frame[:3] == radius.key:
                continue
            one.receive(frame, tick.now_ns)
            other.receive(frame, tick.now_ns + late_ns)
        sent = [each.tick(tick.now_ns, tick.missed) for each in (one, other)]
        assert (sent[0], one.rows()) == (sent[1], other.rows())


def test_a_joystick_that_is_frozen_is_found_whatever_its_frames_say() -> None:
    machine = driven(Machine(), late_ns=LATEST_NS)
    frozen = min(one.config.stuck_s for one in FORWARDER.joysticks.values())
    for _ in range(round(frozen * 1e9) // TICK_NS + 2):
        machine.tick(UP)
    assert machine.why[1] is Reason.JOYSTICK_FROZEN


def test_no_axis_moves_in_a_build_that_computes_otherwise(tmp_path: Path) -> None:
    """Though its caller never asks; only the library does, once."""
    sources = tmp_path / "c"
    shutil.copytree(C_FILES, sources)
    path, begin = sources / "src/cs_arithmetic.c", "bool cs_arithmetic(void)\n{\n"
    text = path.read_text(encoding="ascii")
    assert begin in text
    asked = "    static int asked;\n    if (asked++ > 0) { return false; }\n"
    path.write_text(text.replace(begin, begin + asked), encoding="ascii")
    check_stays_tripped(Machine(native(FORWARDER, sources=sources)))


def test_no_axis_moves_without_a_begin() -> None:
    machine = Machine()
    machine.c._state[:] = bytes(len(machine.c._state))  # type: ignore[index]  # as static memory is
    check_stays_tripped(machine)


def check_stays_tripped(machine: Machine) -> None:
    """Not even a reset with the joystick in neutral ends the trip."""
    reset = Held(enable=True, reset=True)
    held = ([REST] * 5 + [reset] * 5 + [Held()] * 5 + [REST] * 5 + [UP] * 20) * 5
    assert {machine.tick(one) for one in held} == {0}
    assert machine.why == (State.TRIPPED, Reason.OUTPUT_INVALID)


def test_sizes_of_another_machine_are_refused(tmp_path: Path) -> None:
    """Tables of a longer filter would write beyond the state of an axis."""
    needs_compiler()
    robust = read(CONFIG / "forwarder-robust.yaml")
    (tmp_path / "cs_sizes.h").write_text(sizes_source(tables(FORWARDER)), encoding="ascii")
    file = tmp_path / "cs_tables.c"
    file.write_text(tables_source(tables(robust)), encoding="ascii")
    with pytest.raises(NativeError, match=r"cs_sizes\.h is not of this machine"):
        compile_library([file], tmp_path / "one.so", f"-I{tmp_path}", f"-I{C_FILES}/src")
