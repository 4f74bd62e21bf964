"""Reasons and states in words: for the page, the monitor and docs/states.md."""

from collections.abc import Mapping
from typing import NamedTuple

from canshaper.shaping.states import Reason, State


class ReasonText(NamedTuple):
    """A reason in words.

    Attributes:
        words: a few, for a display.
        cause: when the axis has this reason.
        remedy: what helps; the way back.
        fmi: failure mode of SAE J1939-73 that DM1 names; None where it is no fault, such as what
            the operator does: 2 erratic, 9 abnormal update rate, 12 bad device, 14 special
            instructions, 19 received network data in error.
    """

    words: str
    cause: str
    remedy: str = ""
    fmi: int | None = None


class StateText(NamedTuple):
    """A state in words.

    Attributes:
        words: a few, for a display.
        valve: what the valve gets.
        meaning: what the axis does.
    """

    words: str
    valve: str
    meaning: str


REASON_TEXTS: Mapping[Reason, ReasonText] = {
    Reason.START: ReasonText(
        "nothing received yet",
        "nothing received yet",
        "joysticks on, bus up; `candump can0` shows the joystick's id, and the DBC has that id, "
        "29-bit ids with bit 31 set",
    ),
    Reason.JOYSTICK_NEUTRAL: ReasonText(
        "joystick in neutral",
        "the joystick is valid, fresh, enabled and in neutral",
    ),
    Reason.JOYSTICK_MOVED: ReasonText(
        "joystick moved",
        "the joystick left neutral",
    ),
    Reason.AT_REST: ReasonText(
        "at rest",
        "the joystick is in neutral, neutral is sent, and the tail is over",
    ),
    Reason.BYPASS_REQUESTED: ReasonText(
        "anti-sway is off",
        "the anti-sway switch is off and the joystick is moved",
    ),
    Reason.BYPASS_RELEASED: ReasonText(
        "anti-sway is on again",
        "the anti-sway switch is on again",
    ),
    Reason.STOP_DONE: ReasonText(
        "stopped",
        "stopped, or `stop_s` is over",
        "joystick in neutral; the cause is in the log",
    ),
    Reason.RESET: ReasonText(
        "reset",
        "cause of a trip gone, joystick in neutral, then a rising edge of reset or enable",
    ),
    Reason.COMPENSATING: ReasonText(
        "moves for another axis",
        "another axis moves this one without its own joystick, within "
        "[bounds](safety.md#added-velocity)",
    ),
    Reason.FLOW_LIMITED: ReasonText(
        "slower: the pump gives no more",
        "the axes ask for more oil than the pump delivers: all are slowed by one factor "
        "([`hydraulics`](deployment.md#hydraulics))",
    ),
    Reason.END_STOP: ReasonText(
        "slower: an end stop is near",
        "slowed or stopped ahead of an end stop ([`limits.ends`](deployment.md#end-stops))",
    ),
    Reason.JOYSTICK_NOT_NEUTRAL: ReasonText(
        "let go of the joystick",
        "the joystick is deflected before the axis is ready",
        "let go of the joystick; one that rests off centre: repair or calibrate it, or "
        "`neutral_pct` up to what it needs, no further",
    ),
    Reason.ENABLE_OFF: ReasonText(
        "enable is off",
        "enable switch off",
        "press enable with the joystick in neutral",
    ),
    Reason.JOYSTICK_TIMEOUT: ReasonText(
        "no joystick message",
        "no joystick message within `timeout_ms`",
        "joystick, wiring, bus load (`canshaper check FILE`), `canshaper doctor FILE --listen 60`",
        fmi=9,
    ),
    Reason.JOYSTICK_ERROR: ReasonText(
        "the joystick reports an error",
        "the signal carries its error code",
        "joystick",
        fmi=19,
    ),
    Reason.JOYSTICK_NOT_AVAILABLE: ReasonText(
        "the joystick is not available",
        "the signal carries its not-available code",
        "joystick, DBC",
        fmi=19,
    ),
    Reason.JOYSTICK_OUT_OF_RANGE: ReasonText(
        "the joystick is out of range",
        "beyond the range of the DBC",
        "joystick, DBC",
        fmi=2,
    ),
    Reason.JOYSTICK_NOT_A_NUMBER: ReasonText(
        "the joystick is no number",
        "a float signal without a number",
        "joystick",
        fmi=2,
    ),
    Reason.SWITCH_INVALID: ReasonText(
        "a switch is invalid",
        "enable is neither 0 nor 1",
        "joystick; the right signal? Two bits with 2 = error, 3 = not available are normal on "
        "J1939",
        fmi=2,
    ),
    Reason.JOYSTICK_CONTRADICTORY: ReasonText(
        "flags and joystick do not agree",
        "direction flags and position do not agree, or a rocker is pressed both ways",
        "joystick, DBC",
        fmi=2,
    ),
    Reason.JOYSTICK_FROZEN: ReasonText(
        "the joystick has not changed for too long",
        "the joystick is deflected and has not changed for longer than `stuck_s`",
        "move the joystick, then neutral; joystick",
        fmi=2,
    ),
    Reason.JOYSTICK_UNTRUSTED: ReasonText(
        "joystick messages are not right",
        "wrong checksum, repeated or jumping alive counter, or too few good ones for `qualify`",
        "joystick, a gateway that repeats, two senders of one id; its manual: width and start of "
        "the counter, kind of checksum, data ID",
        fmi=2,
    ),
    Reason.LOOP_OVERRUN: ReasonText(
        "the daemon is too late",
        "ten ticks in a row missed a deadline, or more than one in six for long; over "
        "after fifty punctual ones. An axis in BYPASS_ON goes on",
        "load of the PC: `sudo canshaper doctor FILE`",
        fmi=12,
    ),
    Reason.ADDRESS_NOT_CLAIMED: ReasonText(
        "our address is being claimed",
        "we claim our address on the bus of the valve: 250 ms",
        "nothing; else the bus",
    ),
    Reason.NODE_FAULT: ReasonText(
        "a CANopen node is not operational",
        "CANopen: the node of the joystick or, at rest, of the valve is not "
        "operational, silent, or sends an emergency",
        "the log names node and code; see [canopen.md](canopen.md)",
        fmi=9,
    ),
    Reason.VALVE_NOT_READY: ReasonText(
        "the valve is not ready",
        "a valve of CiA 408 is brought up, or has a fault, or its status word is lost",
        "nothing; else the valve",
    ),
    Reason.LENGTH_LOST: ReasonText(
        "the length of the rope is not known",
        "the length of the rope is silent, no length, or has jumped, and the file says "
        "`lost: neutral`",
        "sensor of the length; it counts again a second after a jump",
        fmi=9,
    ),
    Reason.ENABLE_LOST: ReasonText(
        "enable released in motion",
        "enable released in motion",
        "press enable again with the joystick in neutral; a switch that bounces: J1939 buttons may "
        "report 2 or 3 for a moment",
    ),
    Reason.OUTPUT_INVALID: ReasonText(
        "the filter failed",
        "the filter raised an error, or gave no number; log and black box name the exception with "
        "its text, file and line",
        "report it with the log to the author of the filter; reset",
        fmi=12,
    ),
    Reason.SEND_FAILED: ReasonText(
        "a valve frame did not go out",
        "the valve frame did not go out in motion",
        "bit rate, cable, 120 ohms at both ends, `restart-ms 100`, queue: "
        "`ip -details -statistics link show can0`; reset",
        fmi=9,
    ),
    Reason.LOOP_STALLED: ReasonText(
        "the daemon stood still",
        "the loop stood still for longer than the shortest `timeout_ms` of a joystick, the "
        "emergency stop, or a valve (less the ticks that it may have waited for its frame)",
        "load of the PC: `sudo canshaper doctor FILE`; reset",
        fmi=12,
    ),
    Reason.EMERGENCY_STOP: ReasonText(
        "emergency stop",
        "the emergency stop on the bus is pressed, or was for a moment",
        "release it; reset",
    ),
    Reason.EMERGENCY_STOP_LOST: ReasonText(
        "emergency stop silent",
        "no accepted message of the emergency stop within its `timeout_ms`. In motion "
        "latched; at rest the axis waits for it",
        "its sender, bus; reset",
        fmi=9,
    ),
    Reason.SECOND_SENDER: ReasonText(
        "somebody else commands this valve",
        "a frame with the id of this axis' valve, in J1939 with its group, came from another node",
        "end the other one, such as the controller of before (until it is off `--listen-only`); "
        "reset after 1 s without its frames",
        fmi=14,
    ),
    Reason.ADDRESS_LOST: ReasonText(
        "another node has our address",
        "another node has claimed our address; we are silent",
        "end it, or change address or NAME; reload, then reset",
    ),
    Reason.VALVE_FAULT: ReasonText(
        "the valve reports a fault",
        "a valve of CANopen in motion left its state active, sent an emergency, "
        "restarted, or was silent",
        "the valve, see [canopen.md](canopen.md); reset",
        fmi=12,
    ),
    Reason.OUTPUT_REFUSED: ReasonText(
        "the gate refused a command",
        "the gate refused a frame of this valve: beyond a limit, or not commanded; the log says "
        "which",
        "report it with the log; reset",
        fmi=12,
    ),
}

STATE_TEXTS: Mapping[State, StateText] = {
    State.NEUTRAL_WAIT: StateText(
        "waiting for neutral",
        "neutral",
        "waits for a valid, enabled joystick in neutral; the reason says what is missing",
    ),
    State.READY: StateText(
        "ready",
        "neutral",
        "the next movement of the joystick moves the axis",
    ),
    State.ACTIVE: StateText(
        "moving, shaped",
        "shaped",
        "the joystick drives the axis through the filter; also the run-on after release",
    ),
    State.BYPASS_ON: StateText(
        "moving, unshaped",
        "limited",
        "the joystick drives the axis through the output limits only",
    ),
    State.STOPPING: StateText(
        "stopping",
        "shaped",
        "the input is lost or invalid: command to zero through the filter",
    ),
    State.TRIPPED: StateText(
        "tripped: neutral",
        "neutral",
        "neutral at once, latched",
    ),
}
