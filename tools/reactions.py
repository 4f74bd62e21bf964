"""Reactions to faults, and the tests that show them: for docs/safety.md.

The name of a reason decides its reaction; a fault without a reason has a number, R1 and so on.
"""

from collections.abc import Iterator
from typing import NamedTuple

from canshaper.shaping.states import REACTION_OF, Reaction, Reason

WORDS = {Reaction.SHAPED_STOP: "shaped stop", Reaction.NEUTRAL: "trip"}
TRIP, SILENCE, NONE = "trip", "silence", "no stop"


class Row(NamedTuple):
    """Claims about the reaction to a fault.

    Attributes:
        ids: names of reasons or faults, with commas between, or a number such as R1.
        what: the fault, where its name does not say it, and what else happens.
        tests: ROOM/FILE or ROOM/FILE::WORDS of a test's name, with blanks between.
        within: longest time until the reaction, such as "T + tick"; T: timeout of a joystick.
        reaction: where no reason decides it.
    """

    ids: str
    what: str
    tests: str
    within: str = ""
    reaction: str = ""


ROWS = (
    Row(
        "JOYSTICK_TIMEOUT",
        "silent, or only frames of wrong length",
        "hil/frame_faults::silent hil/frame_faults::wrong_length",
        "T + tick",
    ),
    Row(
        "R1",
        "lost joystick in a gateway: stop in frames of our own, then the ECU's timeout",
        "hil/test_gateway::lost_joystick",
        "T + tick",
        "shaped stop",
    ),
    Row(
        "JOYSTICK_UNTRUSTED",
        "counter or checksum wrong for long; each such frame is refused at once",
        "hil/frame_faults::frozen_counter hil/frame_faults::jumping_counter"
        " hil/frame_faults::wrong_checksum",
        "T + tick",
    ),
    Row("JOYSTICK_FROZEN", "", "hil/test_faults::frozen_joystick", "`stuck_s`"),
    Row(
        "JOYSTICK_ERROR, JOYSTICK_NOT_AVAILABLE, JOYSTICK_OUT_OF_RANGE, SWITCH_INVALID",
        "",
        "hil/frame_faults::error_code hil/frame_faults::not_available"
        " hil/frame_faults::out_of_range hil/frame_faults::enable_invalid",
        "tick",
    ),
    Row("JOYSTICK_NOT_A_NUMBER", "", "codec/test_codecs::float_joysticks", "tick"),
    Row(
        "JOYSTICK_CONTRADICTORY",
        "",
        "hil/frame_faults::contradictory_flags controller/test_two_cranes::both_ways",
        "tick",
    ),
    Row(
        "NODE_FAULT",
        "joystick: emergency, restart; heartbeat lost",
        "hil/test_canopen::joystick protocols/canopen/test_canopen::lost_heartbeat_of_a_joystick",
        "tick; `heartbeat_ms` + two ticks",
    ),
    Row(
        "LOOP_OVERRUN",
        "not in BYPASS_ON",
        "hil/test_process_faults::repeated_overruns controller/test_overrun::bypass_goes_on",
        "tenth late tick",
    ),
    Row(
        "ADDRESS_NOT_CLAIMED",
        "no axis READY for 250 ms, at the start and after an outage; what moved has tripped",
        "hil/test_j1939::after_an_outage",
    ),
    Row(
        "VALVE_NOT_READY",
        "no axis READY",
        "protocols/canopen/test_cia408::waits_until_the_valve_is_active",
    ),
    Row(
        "LENGTH_LOST",
        "with `lost: neutral`",
        "controller/test_rope::neutral_stops",
        "its timeout + tick",
    ),
    Row("ENABLE_LOST", "also in a frame out of sequence", "hil/frame_faults::enable_lost", "tick"),
    Row(
        "R2",
        "another enabling switch off, however short; that it agrees again is no reset",
        "controller/test_enable controller/test_enable_press",
        "tick; its timeout + tick",
        TRIP,
    ),
    Row("EMERGENCY_STOP", "however short", "hil/frame_faults::emergency_stop", "tick"),
    Row("EMERGENCY_STOP_LOST", "", "hil/frame_faults::emergency_stop_lost", "its timeout + tick"),
    Row(
        "SECOND_SENDER",
        "of a valve's id, also by another address (J1939), behind a gateway, by a fallback left"
        " in place; silent for 1 s before a reset",
        "hil/test_faults::second_sender protocols/j1939/test_network::commands_our_valve"
        " protocols/gateway/test_line::another_sender hil/test_gateway_rules::left_in_place",
        "tick",
    ),
    Row(
        "ADDRESS_LOST",
        "and silence; way back: end the other, reload or restart",
        "hil/test_j1939::silences_us",
        "tick",
    ),
    Row(
        "VALVE_FAULT",
        "emergency, restart, stop, state active gone; heartbeat lost; status word lost",
        "hil/test_canopen::emergency hil/test_canopen::restarts hil/test_canopen::heartbeat"
        " protocols/canopen/test_cia408::fault_in_motion"
        " protocols/canopen/test_cia408::status_word",
        "tick; `heartbeat_ms` + two ticks; its timeout + tick",
    ),
    Row(
        "LOOP_STALLED",
        "longer than T, or than the rest of a valve's timeout: SIGSTOP,"
        " [suspend](service.md#suspend)",
        "hil/test_process_faults::stopped daemon/test_standstill hil/test_canopen::standstill",
        "first tick after",
    ),
    Row("SEND_FAILED", "send queue full", "hil/test_interface_faults::full_queue", "tick"),
    Row(
        "NOT_CONFIRMED",
        "bus blocked, nothing more is queued; where the driver confirms nothing (slcan) no valve is"
        " driven, but for `unconfirmed: true`",
        "hil/test_interface_faults::piled_up hil/test_lying_buses::by_consent_only",
        "fourth frame of a valve, 20 ms or more",
        TRIP,
    ),
    Row("BUS_DOWN", "", "hil/test_daemon::down_and_up", "tick", TRIP),
    Row("BUS_GONE", "", "hil/test_interface_faults::removed_and_back", "tick", TRIP),
    Row(
        "BUS_OFF",
        "by slcan until its controller restarts or it was down; no carrier is the same, a second"
        " later",
        "hil/test_interface_faults::bus_off hil/test_lying_buses::bus_off_without_echo",
        "tick",
        TRIP,
    ),
    Row(
        "BUS_WRONG_DEVICE",
        "with `match`; and silence, nothing is received",
        "hil/test_device::changed_hands hil/test_device::leaves_its_name"
        " bus/test_raw_interface::another_device",
        "0.2 s, before the first frame",
        TRIP,
    ),
    Row("OUTPUT_REFUSED", "the gate refuses", "promises/test_5::neutral_leaves", "at once"),
    Row("DECODERS_DISAGREE", "gate and codec", "gate/test_gated::disagree", "at once", TRIP),
    Row(
        "OUTPUT_INVALID",
        "filter error, no number, a setpoint that no frame carries",
        "shaping/test_axis_error daemon/test_internal_error::setpoint",
        "tick",
    ),
    Row(
        "R3",
        "process dies, or hangs for 1 s (watchdog); systemd restarts it",
        "systemd/test_instance::killed_in_motion systemd/test_instance::hang",
        reaction=SILENCE,
    ),
    Row(
        "R4",
        "process stopped between computing and sending: a moving frame late by more than a tick"
        " (at least 10 ms) does not leave",
        "daemon/test_late_frame",
        reaction=SILENCE,
    ),
    Row(
        "R5",
        "bus missing, unfit (back without CAN FD) or another device than `match`: the service waits"
        " at the start; by hand exit code 3",
        "hil/test_device::at_the_start systemd/test_device hil/test_lying_buses::service_waits"
        " hil/test_lying_buses::without_can_fd",
        reaction=SILENCE,
    ),
    Row(
        "R6",
        "daemon away (gateway): silence, or what `fallback` says",
        "hil/test_gateway::killed systemd/test_gateway",
        reaction=SILENCE,
    ),
    Row(
        "R7",
        "one frame repeated, jumping, of wrong checksum or length: refused",
        "hil/test_faults::comes_twice inputs/test_checksum::one_wrong_checksum",
        reaction=NONE,
    ),
    Row("JOYSTICK_NOT_NEUTRAL", "neutral until released", "promises/test_1", reaction=NONE),
    Row(
        "R8",
        "second joystick with the same message (J1939): the first one counts; after its silence a"
        " stop, then the other",
        "protocols/j1939/test_network::first_of_two_joysticks"
        " protocols/j1939/test_network::change_of_joysticks",
        reaction=NONE,
    ),
    Row(
        "R9",
        "second sender of our heartbeat, or of NMT where we are the master: reported",
        "hil/test_canopen::second_one",
        reaction=NONE,
    ),
    Row("NOT_FOLLOWING, FEEDBACK_LOST", "reported", "inputs/test_feedback", reaction=NONE),
    Row(
        "R10",
        "sway sensor or its node at fault, grapple leans: [on without"
        " it](sensor.md#when-it-is-trusted)",
        "closed_loop/test_sway_sensor_faults closed_loop/test_sway_contact"
        " closed_loop/test_sensor_protocols",
        reaction=NONE,
    ),
    Row(
        "R11",
        "rules of can-gw wrong: logged; looked at every 10 s while nothing moves",
        "hil/test_gateway_rules::missing_rules daemon/test_gateway_wait::rules_are_looked_at",
        reaction=NONE,
    ),
    Row(
        "R12",
        "flood of foreign frames: sockets of their own; of error frames: left to the kernel",
        "hil/test_faults::flood hil/test_lying_buses::flood",
        reaction=NONE,
    ),
    Row("FRAMES_LOST", "a lost frame is a silent input", "bus/test_raw::run_over", reaction=NONE),
    Row(
        "MISSED_DEADLINE",
        "filter and limits count the time",
        "controller/test_controller_faults::missed_ticks",
        reaction=NONE,
    ),
    Row(
        "BUS_PASSIVE, ERROR_FRAME", "reported", "hil/test_interface_faults::passive", reaction=NONE
    ),
    Row(
        "R13",
        "control socket, nonsense, too much, out of range: refused",
        "daemon/test_control_server controller/test_adjust::refused",
        reaction=NONE,
    ),
    Row(
        "R14",
        "broken or hostile file at SIGHUP: refused; its reader has limits of memory, processor"
        " and time",
        "hil/test_daemon::reload hostile/test_files daemon/test_config_reload",
        reaction=NONE,
    ),
    Row(
        "R15",
        "disk full, log reader gone or hanging: lines are dropped and counted",
        "hil/test_process_faults::full_disk hil/test_process_faults::hangs",
        reaction=NONE,
    ),
)


def quoted(tests: str) -> str:
    """Return names of tests, with blanks between, each in backquotes."""
    return " ".join(f"`{one}`" for one in tests.split())


def reaction_rows() -> Iterator[str]:
    """Yield the Markdown table of the reactions.

    Raises:
        ValueError: reasons and text of a row say several reactions, or none.
    """
    yield "| claim | fault | reaction | within | tests |"
    yield "|---|---|---|---|---|"
    for row in ROWS:
        reasons = [Reason[one] for one in row.ids.split(", ") if one in Reason.__members__]
        said = {WORDS.get(REACTION_OF[one], NONE) for one in reasons} | {row.reaction} - {""}
        if len(said) != 1:
            raise ValueError(f"expected one reaction of {row.ids}, got {sorted(said)}")
        yield f"| {row.ids} | {row.what} | {said.pop()} | {row.within} | {quoted(row.tests)} |"
