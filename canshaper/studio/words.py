"""States, reasons and faults in words for people; docs/states.md says more of each."""

from canshaper.codec.frame import FrameFault
from canshaper.shaping.states import Reason, State

STATES = {
    State.NEUTRAL_WAIT: "waiting for neutral",
    State.READY: "ready",
    State.ACTIVE: "moving, shaped",
    State.BYPASS_ON: "moving, unshaped",
    State.STOPPING: "stopping",
    State.TRIPPED: "tripped: neutral",
}

REASONS = {
    Reason.START: "nothing received yet",
    Reason.STICK_NEUTRAL: "stick in neutral",
    Reason.STICK_MOVED: "stick moved",
    Reason.AT_REST: "at rest",
    Reason.BYPASS_REQUESTED: "anti-sway is off",
    Reason.BYPASS_RELEASED: "anti-sway is on again",
    Reason.STOP_DONE: "stopped",
    Reason.RESET: "reset",
    Reason.COMPENSATING: "moves for slewing, without its own stick",
    Reason.STICK_NOT_NEUTRAL: "let go of the stick",
    Reason.ENABLE_OFF: "enable is off",
    Reason.STICK_TIMEOUT: "no joystick message",
    Reason.STICK_ERROR: "the joystick tells an error",
    Reason.STICK_NOT_AVAILABLE: "the stick is not available",
    Reason.STICK_OUT_OF_RANGE: "the stick is out of range",
    Reason.STICK_NOT_A_NUMBER: "the stick is no number",
    Reason.SWITCH_INVALID: "a switch is invalid",
    Reason.STICK_CONTRADICTORY: "flags and stick do not agree",
    Reason.STICK_FROZEN: "the stick has not changed for too long",
    Reason.STICK_UNTRUSTED: "joystick messages are not right",
    Reason.LOOP_OVERRUN: "the daemon is too late",
    Reason.ADDRESS_NOT_CLAIMED: "our address is being claimed",
    Reason.NODE_FAULT: "a CANopen node is not operational",
    Reason.VALVE_NOT_READY: "the valve is not ready",
    Reason.ENABLE_LOST: "enable released in motion",
    Reason.OUTPUT_INVALID: "the filter gave no number",
    Reason.SEND_FAILED: "a valve frame did not go out",
    Reason.LOOP_STALLED: "the daemon stood still",
    Reason.EMERGENCY_STOP: "emergency stop",
    Reason.EMERGENCY_STOP_LOST: "emergency stop not heard",
    Reason.SECOND_SENDER: "somebody else commands this valve",
    Reason.ADDRESS_LOST: "another node has our address",
    Reason.VALVE_FAULT: "the valve tells a fault",
    Reason.OUTPUT_REFUSED: "the output guard refused a command",
}

FAULTS = {
    fault: "" if fault is FrameFault.NONE else fault.name.lower().replace("_", " ")
    for fault in FrameFault
}


def state_words(number: int) -> str:
    """A state by its number."""
    return STATES[State(number)] if number in _STATES else f"state {number}"


def reason_words(number: int) -> str:
    """A reason by its number."""
    return REASONS[Reason(number)] if number in _REASONS else f"reason {number}"


def fault_words(number: int) -> str:
    """A fault by its number; nothing for none."""
    return FAULTS[FrameFault(number)] if number in _FAULTS else f"fault {number}"


_STATES, _REASONS, _FAULTS = frozenset(State), frozenset(Reason), frozenset(FrameFault)
