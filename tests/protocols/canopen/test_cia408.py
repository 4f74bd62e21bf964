"""Valves of CiA 408: brought to work step by step, watched, reset, and brought to work again."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canshaper.protocols.canopen.network import ValveControl
from tests.rigs.canopen import (
    ACTIVE,
    DISABLED,
    HOLD,
    INIT,
    OPERATIONAL,
    PRE_OPERATIONAL,
    RESET,
    VALVES,
    CanopenRig,
)

NOT_READY = ("NEUTRAL_WAIT", "VALVE_NOT_READY")
FAULT = ("TRIPPED", "VALVE_FAULT")
STEP_NS, TICK_NS = 50_000_000, 20_000_000


@pytest.fixture
def rig() -> CanopenRig:
    return CanopenRig()


def words(rig: CanopenRig, ticks: int, axis: str = "slew") -> list[tuple[int, int]]:
    """Control words as they change, with the time since the one before."""
    changes: list[tuple[int, int]] = []
    changed_ns = rig.now_ns
    for _ in range(ticks):
        word = rig.run()[axis]["ControlWord"]
        at_ns = rig.now_ns - TICK_NS
        if not changes or word != changes[-1][0]:
            changes.append((word, at_ns - changed_ns))
            changed_ns = at_ns
    return changes


def test_a_valve_is_brought_to_work_in_four_steps_50_ms_apart(rig: CanopenRig) -> None:
    steps = words(rig, 60)
    assert [word for word, _ in steps] == [INIT, DISABLED, HOLD, ACTIVE]
    assert min(passed for _, passed in steps[1:]) >= STEP_NS
    assert rig.axis() == ("READY", "JOYSTICK_NEUTRAL")


def test_the_first_word_is_init_before_and_at_the_first_tick(rig: CanopenRig) -> None:
    for axis in VALVES:
        rig.status(axis, INIT)  # sent before the controller ever ticks
    first = rig.controller.neutral_frames()
    assert [f.data for f in first] == [bytes((INIT, 0, 0, 0))] * 3
    assert rig.run()["slew"] == {"ControlWord": INIT, "SetPoint": 0}


def test_set_point_is_0_and_the_axis_waits_until_the_valve_is_active(rig: CanopenRig) -> None:
    rig.valves["slew"].stuck = True
    rig.valves["slew"].state = RESET
    for _ in range(60):
        assert rig.run(Slew=30000)["slew"]["SetPoint"] == 0
        assert rig.axis()[0] == "NEUTRAL_WAIT"
    rig.run()
    assert rig.axis() == NOT_READY
    assert rig.axis("lift")[0] == "READY"  # the others work


def test_no_step_without_the_status_word(rig: CanopenRig) -> None:
    rig.valves["slew"].silent = True
    assert [word for word, _ in words(rig, 200)] == [INIT]
    assert rig.axis() == NOT_READY


def test_a_valve_that_boots_for_ten_seconds_is_waited_for(rig: CanopenRig) -> None:
    """In its self test it is not ready; that is no fault of the first two seconds."""
    valve = rig.valves["slew"]
    valve.state, valve.stuck = 0, True
    valve.command = lambda _word: None  # type: ignore[method-assign]
    assert [word for word, _ in words(rig, 100)] == [INIT]
    rig.run(400)
    assert rig.axis() == NOT_READY
    rig.valves["slew"] = type(valve)()
    rig.until(lambda: rig.axis()[0] == "READY", 200)


def test_a_valve_that_was_active_before_is_brought_to_work_again(rig: CanopenRig) -> None:
    rig.valves["slew"].state = ACTIVE
    assert [word for word, _ in words(rig, 60)] == [INIT, DISABLED, HOLD, ACTIVE]


def test_a_fault_in_motion_is_neutral_with_the_next_frame(rig: CanopenRig) -> None:
    rig.moving()
    rig.valves["slew"].fault(stuck=True)
    assert rig.run(Slew=30000, Lift=20000)["slew"]["SetPoint"] == 0
    assert rig.axis() == FAULT
    for _ in range(100):
        commands = rig.run(Slew=30000, Lift=20000)
        assert commands["slew"]["SetPoint"] == 0
    assert commands["lift"]["SetPoint"] > 3000  # no business of the other one
    assert rig.axis() == FAULT


def test_a_fault_is_reset_by_an_edge_of_the_ready_bit_and_the_operator(rig: CanopenRig) -> None:
    rig.moving()
    rig.valves["slew"].fault()
    changes = words(rig, 60)
    assert [word for word, _ in changes] == [RESET, HOLD, ACTIVE]
    assert min(passed for _, passed in changes[1:]) >= STEP_NS
    assert rig.axis() == FAULT  # the valve works again, the axis waits for the operator
    rig.run(Reset=1)
    rig.run(2)
    assert rig.axis()[0] == "READY"
    rig.until(lambda: rig.command("slew")["SetPoint"] > 3000, 100, Slew=30000)


def test_a_fault_that_stays_is_reset_twice_a_second_and_no_more(rig: CanopenRig) -> None:
    rig.ready()
    rig.valves["slew"].fault(stuck=True)
    changes = [word for word, _ in words(rig, 100)]
    assert rig.axis() == NOT_READY
    assert changes.count(RESET) in (4, 5)  # in two seconds
    assert set(changes) == {ACTIVE, RESET, HOLD} or set(changes) == {RESET, HOLD}


def test_a_reset_held_while_the_valve_is_not_ready_is_no_press(rig: CanopenRig) -> None:
    rig.moving()
    rig.valves["slew"].fault()
    rig.run(2, Slew=30000)
    rig.until(lambda: rig.valves["slew"].state == ACTIVE, Reset=1)
    rig.run(20, Reset=1)
    assert rig.axis() == FAULT
    rig.run(2)
    rig.run(Reset=1)
    rig.run(2)
    assert rig.axis()[0] == "READY"


def test_a_valve_that_leaves_active_between_two_ticks_is_seen(rig: CanopenRig) -> None:
    rig.moving()
    rig.status("slew", HOLD)
    assert rig.run(Slew=30000)["slew"]["SetPoint"] == 0  # which commands ACTIVE again, after HOLD
    assert rig.axis() == FAULT


def test_a_valve_in_motion_that_falls_back_begins_with_init(rig: CanopenRig) -> None:
    rig.moving()
    rig.valves["slew"].state = DISABLED
    assert rig.run(Slew=30000)["slew"] == {"ControlWord": INIT, "SetPoint": 0}
    assert rig.axis() == FAULT


def test_a_status_word_that_is_lost_in_motion_stops_and_begins_again(rig: CanopenRig) -> None:
    rig.moving()
    rig.valves["slew"].silent = True
    passed = rig.until(lambda: rig.axis() == FAULT, Slew=30000)
    assert passed in (15, 16)  # 300 ms
    assert rig.command("slew") == {"ControlWord": INIT, "SetPoint": 0}
    rig.valves["slew"].silent = False
    rig.until(lambda: rig.valves["slew"].state == ACTIVE)
    rig.run(5)
    rig.run(Reset=1)
    rig.run(2)
    assert rig.axis()[0] == "READY"


def test_a_node_that_restarts_in_motion_begins_again_at_once(rig: CanopenRig) -> None:
    """Its last status word says ACTIVE still, and must not be believed."""
    rig.moving()
    rig.states["slew"] = PRE_OPERATIONAL
    rig.valves["slew"].silent = True
    rig.heartbeat("slew", 0)
    assert rig.run(Slew=30000)["slew"] == {"ControlWord": INIT, "SetPoint": 0}
    assert rig.axis() == FAULT
    rig.states["slew"] = OPERATIONAL
    rig.valves["slew"] = type(rig.valves["slew"])()
    assert [word for word, _ in words(rig, 60)] == [INIT, DISABLED, HOLD, ACTIVE]


def test_the_last_frame_of_a_working_valve_says_hold_and_0(rig: CanopenRig) -> None:
    rig.moving()
    rig.valves["lift"].fault(stuck=True)
    rig.run(Slew=30000)
    last = {f.can_id: f.data for f in rig.controller.neutral_frames()}
    assert last[0x220] == bytes((HOLD, 0, 0, 0))
    assert last[0x222][0] != ACTIVE
    assert last[0x222][2:] == b"\0\0"


def test_stall_drops_what_the_valve_sent(rig: CanopenRig) -> None:
    rig.moving()
    rig.controller.stalled()
    assert rig.tick()["slew"] == {"ControlWord": INIT, "SetPoint": 0}
    assert rig.axis()[0] == "TRIPPED"


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 15) | st.none(),
            st.sampled_from((-32768, -32767, -30000, 0, 0, 30000, 32767)),
            st.sampled_from((None, 0, 4, 5, 5, 127)),
        ),
        min_size=10,
        max_size=80,
    )
)
def test_whatever_valve_and_joystick_say_float_is_never_sent(
    drive: list[tuple[int | None, int, int | None]],
) -> None:
    """And nothing but 0 to a valve that has not said that it is active."""
    rig = CanopenRig().ready()
    rig.valves["slew"].silent = True
    rig.states["slew"] = -1
    for state, joystick, node in drive:
        for _ in range(3):
            if state is not None:
                rig.status("slew", state)
            if node is not None:
                rig.heartbeat("slew", node)
            command = rig.run(Slew=joystick)["slew"]
            assert -0x4000 <= command["SetPoint"] <= 0x4000
            if command["SetPoint"]:
                assert command["ControlWord"] == ACTIVE
            if state not in (None, ACTIVE) or node not in (None, OPERATIONAL):
                assert command["SetPoint"] == 0


def test_a_status_word_that_does_not_count_stops_and_does_not_start() -> None:
    """It may be out of sequence: that the valve has left its state takes no trust."""
    rig = CanopenRig().moving()
    key = rig.deployment.axes["slew"].status_word.key  # type: ignore[union-attr]
    control = rig.controller.inputs[key]
    assert isinstance(control, ValveControl)
    control.on_frame({"StatusWord": HOLD}, rig.now_ns, False)
    assert control.gate(False, rig.now_ns).name == "VALVE_FAULT"  # type: ignore[union-attr]
    assert control.gate(False, rig.now_ns) is None  # what counted last still says active
    control.invalidate()
    control.on_frame({"StatusWord": ACTIVE}, rig.now_ns, False)
    assert control.gate(True, rig.now_ns).name == "VALVE_NOT_READY"  # type: ignore[union-attr]
