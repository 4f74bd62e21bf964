"""Faults of frames and buses, and trust in a sensor, in words: for states.md and sensor.md."""

from collections.abc import Mapping

from canshaper.codec.frame import FrameFault
from canshaper.shaping.states import Trust

FAULT_TEXTS: Mapping[FrameFault, str] = {
    FrameFault.NONE: "none so far",
    FrameFault.WRONG_LENGTH: "the DBC has another length; remote frames",
    FrameFault.UNKNOWN_ID: (
        "no DBC file of the deployment has the id; at most 20 in a tick are counted"
    ),
    FrameFault.ERROR_FRAME: "the controller reports an error of the bus",
    FrameFault.INVALID_SIGNAL: "an error code, a value out of range, an invalid switch",
    FrameFault.SEND_FAILED: "a frame did not go out; it is never sent later",
    FrameFault.MISSED_DEADLINE: "a tick of the loop was left out",
    FrameFault.BUS_ERROR: "reading or sending failed",
    FrameFault.CHECKSUM: "wrong checksum",
    FrameFault.COUNTER_REPEATED: "the alive counter of the last message again",
    FrameFault.COUNTER_JUMP: "a step of the alive counter beyond `alive_max_step`",
    FrameFault.SECOND_SENDER: (
        "another node sent one of our frames, a status message too; in J1939 also a second "
        "joystick with the same message"
    ),
    FrameFault.BUS_OFF: "the controller left the bus; one frame every 0.5 s tries it",
    FrameFault.BUS_PASSIVE: "the controller counts many errors",
    FrameFault.FRAMES_LOST: "a receive queue of kernel or controller ran over",
    FrameFault.NOT_CONFIRMED: (
        "no node acknowledges our frames; after a valve's, one every 0.5 s tries it"
    ),
    FrameFault.BUS_GONE: "the interface was removed; tried every 0.2 s",
    FrameFault.BUS_DOWN: "the interface is down",
    FrameFault.ADDRESS_LOST: "another node has our [address](j1939.md#the-address)",
    FrameFault.NOT_FOLLOWING: (
        "the [feedback](j1939.md#feedback-of-a-valve) of a valve is elsewhere than any of its "
        "last commands"
    ),
    FrameFault.FEEDBACK_LOST: "the feedback of a valve is not received",
    FrameFault.HEARTBEAT_LOST: "a watched node of CANopen is silent",
    FrameFault.NODE_EMERGENCY: (
        "a watched node of CANopen sends an emergency; the log names its code"
    ),
    FrameFault.BUS_WRONG_DEVICE: (
        "the interface is not the device of `match`; compared every 0.2 s"
    ),
    FrameFault.OUTPUT_REFUSED: "the gate refused a valve frame; neutral went out in its place",
    FrameFault.DECODERS_DISAGREE: (
        "gate and codecs read different things in a frame of a joystick: our own mistake"
    ),
}
"""What each fault of the status message means."""

_PROVED = "received, proved"
TRUST_TEXTS: Mapping[Trust, tuple[str, str]] = {
    Trust.NO_DATA: ("no message yet", _PROVED),
    Trust.UNPROVED: ("no motion has proved it yet", "proved"),
    Trust.TRUSTED: ("motion has proved it", ""),
    Trust.LOST: ("no message within `timeout_ms`", _PROVED),
    Trust.STUCK: ("the same value while the grapple swings", "proved"),
    Trust.JUMP: ("further than a grapple can jump", "at rest, proved"),
    Trust.WRONG_SIGN: ("it contradicts motion", "proved"),
    Trust.OFFSET: ("its offset is above `offset_max_deg`", "within it again"),
    Trust.CONTACT: ("it shows nothing of motion: the grapple leans on something", "proved"),
    Trust.RESTLESS: ("the command goes to and fro far more than the joystick", "at rest, proved"),
}
"""Why a sway sensor is in each state of trust, and what ends it."""
