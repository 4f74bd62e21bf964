"""The state machine follows its table: every row is reached, and nothing else happens."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.shaping.state_machine import TABLE, TRIP, StateMachine, transitions
from canshaper.shaping.states import MOVING, REACTION_OF, CommandInput, Reaction, Reason, State

STOPS = [reason for reason, one in REACTION_OF.items() if one is Reaction.SHAPED_STOP]
# ENABLE_LOST comes by the switch.
TRIPS = [reason for reason, one in REACTION_OF.items() if one is Reaction.NEUTRAL][1:]
INPUTS = st.builds(
    CommandInput,
    command=st.sampled_from([0.0, 0.0, 1.0]),
    fault=st.sampled_from([None, None, None, *STOPS]),
    enabled=st.sampled_from([True, True, True, False]),
    bypass=st.booleans(),
    reset=st.booleans(),
    trip=st.sampled_from([None] * 30 + TRIPS),
)
STEPS = st.lists(
    st.tuples(INPUTS, st.sampled_from([False, False, True]), st.booleans()), max_size=60
)


@given(steps=STEPS)
def test_every_change_of_state_is_declared(
    steps: list[tuple[CommandInput, bool, bool]],
) -> None:
    declared = transitions()
    machine = StateMachine(0.02, 5)
    for given_joystick, added, at_rest in steps:
        joystick = given_joystick
        if machine.state is State.BYPASS_ON and joystick.fault is Reason.LOOP_OVERRUN:
            joystick = joystick._replace(fault=None)  # a controller goes on then
        old = machine.state
        new = machine.step(joystick, at_rest, added)
        assert new is machine.state
        if new is not old:
            assert machine.reason in declared[old, new]
            input_reason = joystick.trip or joystick.fault
            assert new is not State.TRIPPED or machine.reason in (input_reason, Reason.ENABLE_LOST)


def in_state(state: State) -> StateMachine:
    machine = StateMachine(0.02, 5)
    moved = CommandInput(1.0, bypass=state is State.BYPASS_ON)
    steps = {
        State.NEUTRAL_WAIT: [],
        State.READY: [CommandInput()],
        State.STOPPING: [CommandInput(), moved, CommandInput(fault=Reason.JOYSTICK_TIMEOUT)],
        State.TRIPPED: [CommandInput(trip=Reason.SEND_FAILED)],
    }.get(state, [CommandInput(), moved])
    for joystick in steps:
        machine.step(joystick, at_rest=False, added=False)
    assert machine.state is state
    return machine


def test_every_declared_reason_is_one_that_an_input_gives() -> None:
    """A row of the table that nothing reaches would be a lie of the page."""
    joysticks = [
        CommandInput(command, fault, enabled, bypass, reset, trip)
        for command in (0.0, 1.0)
        for fault in (None, *STOPS, Reason.EMERGENCY_STOP_LOST)
        for enabled in (True, False)
        for bypass in (True, False)
        for reset in (True, False)
        for trip in (None, *TRIPS)
    ]
    reasons_of: dict[tuple[State, State], set[Reason]] = {}
    for state in State:
        for joystick in joysticks:
            for added, at_rest in ((False, False), (False, True), (True, False)):
                machine = in_state(state)
                if state is State.TRIPPED:
                    machine.step(CommandInput(enabled=False), at_rest=True, added=False)
                    assert machine.state is state  # and no switch is held
                if state is State.STOPPING and at_rest:
                    machine.hold(5)
                new = machine.step(joystick, at_rest, added)
                if new is State.TRIPPED is not state and machine.reason is not joystick.trip:
                    # What a controller never gives to an axis in that state ends here too.
                    never = (Reason.EMERGENCY_STOP_LOST, Reason.LOOP_OVERRUN)
                    assert machine.reason in (Reason.ENABLE_LOST, *never), (state, joystick)
                if new is not state:
                    reasons_of.setdefault((state, new), set()).add(machine.reason)
    for way, reasons in transitions().items():
        assert reasons <= reasons_of[way], way


def test_a_cause_that_no_row_accepts_ends_neutral_and_latched() -> None:
    for state in (State.ACTIVE, State.BYPASS_ON, State.READY):
        machine = in_state(state)
        machine.step(CommandInput(1.0, fault=Reason.RESET), at_rest=False, added=False)
        assert (machine.state, machine.reason) == (State.TRIPPED, Reason.RESET)


@pytest.mark.parametrize("fault", [None, Reason.JOYSTICK_TIMEOUT])
@pytest.mark.parametrize("enabled", [False, True])
@pytest.mark.parametrize("command", [0.0, 1.0])
@pytest.mark.parametrize("state", [state for state in State if state is not State.TRIPPED])
def test_a_cause_for_neutral_at_once_wins(
    state: State, command: float, enabled: bool, fault: Reason | None
) -> None:
    machine = in_state(state)
    joystick = CommandInput(command, fault, enabled, trip=Reason.EMERGENCY_STOP)
    machine.step(joystick, at_rest=True, added=False)
    assert (machine.state, machine.reason) == (State.TRIPPED, Reason.EMERGENCY_STOP)


def test_missed_ticks_before_a_stop_do_not_shorten_it() -> None:
    machine = in_state(State.ACTIVE)
    machine.hold(100)
    lost = CommandInput(fault=Reason.JOYSTICK_TIMEOUT)
    states = [machine.step(lost, at_rest=False, added=False) for _ in range(6)]
    assert states == [State.STOPPING] * 5 + [State.NEUTRAL_WAIT]


def test_the_table_keeps_the_promises_of_its_page() -> None:
    """Of motion, of trips and of the way out of them."""
    ways = transitions()
    assert sorted(ways, key=lambda way: State.TRIPPED in way) == list(ways)  # trips last
    into_motion = {old for old, new in ways if new in MOVING and old not in MOVING}
    assert into_motion == {State.READY}
    assert {old for old, new in ways if new is State.READY} - MOVING == {State.NEUTRAL_WAIT}
    assert {new for old, new in ways if old is State.TRIPPED} == {State.NEUTRAL_WAIT}
    for state, rows in TABLE.items():
        if state is not State.TRIPPED:
            assert (rows[0].when, rows[0].new) == (TRIP, State.TRIPPED)
            assert not any(row.when & TRIP for row in rows[1:])
        assert all(row.new is not state for row in rows) or state is State.NEUTRAL_WAIT
