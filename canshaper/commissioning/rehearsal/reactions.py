"""The reactions to every fault: of docs/safety.md, and what a rehearsal expects.

The name of a reason decides its reaction; a fault without a reason has a number, R1 and so on.
"""

from typing import NamedTuple

from canshaper.shaping.states import REACTION_OF, Reaction, Reason

WORDS = {Reaction.SHAPED_STOP: "shaped stop", Reaction.NEUTRAL: "trip"}
STOP, TRIP, SILENCE, NONE = "shaped stop", "trip", "silence", "no stop"


class Row(NamedTuple):
    """Claims about the reaction to a fault.

    Attributes:
        ids: names of reasons or faults, or a number.
        what: the fault, where its name does not say it, and what else happens.
        within: longest time until the reaction.
        said: the reaction, where no reason decides it.
    """

    ids: str
    what: str = ""
    within: str = ""
    said: str = ""

    @property
    def reaction(self) -> str:
        """The reaction.

        Raises:
            ValueError: its reasons have several, or another one than it says.
        """
        reasons = [Reason[one] for one in self.ids.split(", ") if one in Reason.__members__]
        said = {WORDS.get(REACTION_OF[one], NONE) for one in reasons} | {self.said} - {""}
        if len(said) != 1:
            raise ValueError(f"expected one reaction of {self.ids}, got {sorted(said)}")
        return said.pop()


ROWS = (
    Row("JOYSTICK_TIMEOUT", "silent, or only frames of wrong length", "T + tick"),
    Row(
        "R1",
        "lost joystick in a gateway: stop in frames of our own, then the ECU's timeout",
        "T + tick",
        STOP,
    ),
    Row(
        "JOYSTICK_UNTRUSTED",
        "counter or checksum wrong for long; each such frame is refused at once",
        "T + tick",
    ),
    Row("JOYSTICK_FROZEN", "", "`stuck_s`"),
    Row(
        "JOYSTICK_ERROR, JOYSTICK_NOT_AVAILABLE, JOYSTICK_OUT_OF_RANGE, SWITCH_INVALID",
        "",
        "tick",
    ),
    Row("JOYSTICK_NOT_A_NUMBER", "", "tick"),
    Row("JOYSTICK_CONTRADICTORY", "", "tick"),
    Row(
        "NODE_FAULT",
        "joystick: emergency, restart; heartbeat lost",
        "tick; `heartbeat_ms` + two ticks",
    ),
    Row("LOOP_OVERRUN", "not in BYPASS_ON", "tenth late tick"),
    Row(
        "ADDRESS_NOT_CLAIMED",
        "no axis READY for 250 ms, at the start and after an outage; what moved has tripped",
    ),
    Row("VALVE_NOT_READY", "no axis READY"),
    Row("ENABLE_LOST", "also in a frame out of sequence", "tick"),
    Row(
        "R2",
        "another enabling switch off, however short; that it agrees again is no reset",
        "tick; its timeout + tick",
        TRIP,
    ),
    Row("EMERGENCY_STOP", "however short", "tick"),
    Row("EMERGENCY_STOP_LOST", "", "its timeout + tick"),
    Row(
        "SECOND_SENDER",
        "of a valve's id, also by another address (J1939), behind a gateway, by a fallback left "
        "in place; silent for 1 s before a reset",
        "tick",
    ),
    Row("ADDRESS_LOST", "and silence; way back: end the other, reload or restart", "tick"),
    Row(
        "VALVE_FAULT",
        "emergency, restart, stop, state active gone; heartbeat lost; status word lost",
        "tick; `heartbeat_ms` + two ticks; its timeout + tick",
    ),
    Row(
        "LOOP_STALLED",
        "longer than T, or than the rest of a valve's timeout: SIGSTOP, "
        "[suspend](service.md#suspend)",
        "first tick after",
    ),
    Row("SEND_FAILED", "send queue full", "tick"),
    Row(
        "NOT_CONFIRMED",
        "bus blocked, nothing more is queued; where the driver confirms nothing (slcan) no "
        "valve is driven, but for `unconfirmed: true`",
        "fourth frame of a valve, 20 ms or more",
        TRIP,
    ),
    Row("BUS_DOWN", within="tick", said=TRIP),
    Row("BUS_GONE", within="tick", said=TRIP),
    Row(
        "BUS_OFF",
        "by slcan until its controller restarts or it was down; no carrier is the same, a "
        "second later",
        "tick",
        TRIP,
    ),
    Row(
        "BUS_WRONG_DEVICE",
        "with `match`; and silence, nothing is received",
        "0.2 s, before the first frame",
        TRIP,
    ),
    Row("OUTPUT_REFUSED", "the gate refuses", "at once"),
    Row("DECODERS_DISAGREE", "gate and codec", "at once", TRIP),
    Row("OUTPUT_INVALID", "filter error, no number, a setpoint that no frame carries", "tick"),
    Row("R3", "process dies, or hangs for 1 s (watchdog); systemd restarts it", said=SILENCE),
    Row(
        "R4",
        "process stopped between computing and sending: a moving frame late by more than a tick "
        "(at least 10 ms) does not leave",
        said=SILENCE,
    ),
    Row(
        "R5",
        "bus missing, unfit (back without CAN FD) or another device than `match`: the service "
        "waits at the start; by hand exit code 3",
        said=SILENCE,
    ),
    Row("R6", "daemon away (gateway): silence, or what `fallback` says", said=SILENCE),
    Row("R7", "one frame repeated, jumping, of wrong checksum or length: refused", said=NONE),
    Row("JOYSTICK_NOT_NEUTRAL", "neutral until released", said=NONE),
    Row(
        "R8",
        "second joystick with the same message (J1939): the first one counts; after its silence "
        "a stop, then the other",
        said=NONE,
    ),
    Row(
        "R9",
        "second sender of our heartbeat, or of NMT where we are the master: reported",
        said=NONE,
    ),
    Row("NOT_FOLLOWING, FEEDBACK_LOST", "reported", said=NONE),
    Row(
        "R10",
        "sway sensor or its node at fault, grapple leans: [on without "
        "it](sensor.md#when-it-is-trusted)",
        said=NONE,
    ),
    Row(
        "R11",
        "rules of can-gw wrong: logged; looked at every 10 s while nothing moves",
        said=NONE,
    ),
    Row(
        "R12",
        "flood of foreign frames: sockets of their own; of error frames: left to the kernel",
        said=NONE,
    ),
    Row("FRAMES_LOST", "a lost frame is a silent input", said=NONE),
    Row("MISSED_DEADLINE", "filter and limits count the time", said=NONE),
    Row("BUS_PASSIVE, ERROR_FRAME", "reported", said=NONE),
    Row("R13", "control socket, nonsense, too much, out of range: refused", said=NONE),
    Row(
        "R14",
        "broken or hostile file at SIGHUP: refused; its reader has limits of memory, processor "
        "and time",
        said=NONE,
    ),
    Row("R15", "disk full, log reader gone or hanging: lines are dropped and counted", said=NONE),
)

_INTERFACE = "it is seen at the interface: pull its cable, or `ip link set can0 down`"
_PROGRAM = "an error of the program, which no input makes"
_PROCESS = "end the daemon with `kill -9`, or stop it with SIGSTOP"
_START = "start the daemon without its bus"
NEVER = {
    "NOT_CONFIRMED": _INTERFACE,
    "BUS_DOWN": _INTERFACE,
    "BUS_GONE": _INTERFACE,
    "BUS_WRONG_DEVICE": _INTERFACE,
    "OUTPUT_REFUSED": _PROGRAM,
    "DECODERS_DISAGREE": _PROGRAM,
    "OUTPUT_INVALID": _PROGRAM,
    "R3": _PROCESS,
    "R4": _PROCESS,
    "R5": _START,
    "R6": _PROCESS,
    "JOYSTICK_NOT_NEUTRAL": "no fault: hold the joystick after a shaped stop, nothing moves",
    "R11": "remove the rules with `cangw -F`",
    "R12": "flooding frames never reach the daemon: `cangen can0 -g 0`",
    "R13": "no fault of an input: `canshaper set` with a number out of range",
    "R14": "no fault of an input: SIGHUP with a broken file",
    "R15": "fill the disk",
}
"""Why what no input makes is not rehearsed, or how else it is tried."""


def row_of(claim: str) -> Row:
    """The row of a reason, a fault or a number."""
    return next(row for row in ROWS if claim in row.ids.split(", "))
