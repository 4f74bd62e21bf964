"""The state machine makes no change that is not declared, and makes every one that is."""

from hypothesis import given
from hypothesis import strategies as st

from canshaper.shaping.state_machine import StateMachine
from canshaper.shaping.states import (
    REACTION_OF,
    TRANSITIONS,
    CommandInput,
    Reaction,
    Reason,
    State,
)

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
STEPS = st.lists(st.tuples(INPUTS, st.sampled_from([0.0, 0.0, 0.1]), st.booleans()), max_size=60)


@given(steps=STEPS)
def test_every_change_of_state_is_declared(
    steps: list[tuple[CommandInput, float, bool]],
) -> None:
    machine = StateMachine(0.02, 5)
    for given_joystick, added, at_rest in steps:
        joystick = given_joystick
        if machine.state is State.BYPASS_ON and joystick.fault is Reason.LOOP_OVERRUN:
            joystick = joystick._replace(fault=None)  # a controller goes on then
        old = machine.state
        new = machine.step(joystick, added, at_rest)
        assert new is machine.state
        if new is not old:
            assert machine.reason in TRANSITIONS[old, new]
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
        machine.step(joystick, 0.0, False)
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
            for added, at_rest in ((0.0, False), (0.0, True), (0.1, False)):
                machine = in_state(state)
                if state is State.TRIPPED:
                    machine.step(CommandInput(enabled=False), 0.0, True)  # no switch is held
                if state is State.STOPPING and at_rest:
                    machine.hold(5)
                new = machine.step(joystick, added, at_rest)
                if new is State.TRIPPED is not state and machine.reason is not joystick.trip:
                    # What a controller never gives to an axis in that state ends here too.
                    never = (Reason.EMERGENCY_STOP_LOST, Reason.LOOP_OVERRUN)
                    assert machine.reason in (Reason.ENABLE_LOST, *never), (state, joystick)
                if new is not state:
                    reasons_of.setdefault((state, new), set()).add(machine.reason)
    for way, reasons in TRANSITIONS.items():
        assert reasons <= reasons_of[way], way


def test_a_change_that_is_not_declared_ends_neutral_and_latched() -> None:
    for state in (State.ACTIVE, State.BYPASS_ON, State.READY):
        machine = in_state(state)
        assert machine.step(CommandInput(1.0, fault=Reason.RESET), 0.0, False) is State.TRIPPED
        assert machine.reason is Reason.RESET


def test_nor_does_a_way_that_no_row_has_lead_anywhere_else() -> None:
    """Above all not from latched into motion."""
    ways = [(old, new) for old in State for new in State if (old, new) not in TRANSITIONS]
    assert (State.TRIPPED, State.ACTIVE) in ways
    for old, new in ways:
        machine = in_state(old)
        machine._go(new, Reason.JOYSTICK_MOVED)
        assert machine.state is State.TRIPPED
