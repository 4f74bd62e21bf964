"""The table of reactions with the tests that show them: for docs/safety.md."""

from collections.abc import Iterator

from canshaper.commissioning.rehearsal.reactions import ROWS

# As tests/docs/test_claims.py reads them, by the ids of a row.
TESTS = {
    "JOYSTICK_TIMEOUT": "hil/frame_faults::silent hil/frame_faults::wrong_length",
    "R1": "hil/test_gateway::lost_joystick",
    "JOYSTICK_UNTRUSTED": (
        "hil/frame_faults::frozen_counter hil/frame_faults::jumping_counter "
        "hil/frame_faults::wrong_checksum"
    ),
    "JOYSTICK_FROZEN": "hil/test_faults::frozen_joystick",
    "JOYSTICK_ERROR, JOYSTICK_NOT_AVAILABLE, JOYSTICK_OUT_OF_RANGE, SWITCH_INVALID": (
        "hil/frame_faults::error_code hil/frame_faults::not_available "
        "hil/frame_faults::out_of_range hil/frame_faults::enable_invalid"
    ),
    "JOYSTICK_NOT_A_NUMBER": "codec/test_codecs::float_joysticks",
    "JOYSTICK_CONTRADICTORY": (
        "hil/frame_faults::contradictory_flags controller/test_two_cranes::both_ways"
    ),
    "NODE_FAULT": (
        "hil/test_canopen::joystick protocols/canopen/test_canopen::lost_heartbeat_of_a_joystick"
    ),
    "LOOP_OVERRUN": (
        "hil/test_process_faults::repeated_overruns controller/test_overrun::bypass_goes_on"
    ),
    "ADDRESS_NOT_CLAIMED": "hil/test_j1939::after_an_outage",
    "VALVE_NOT_READY": "protocols/canopen/test_cia408::waits_until_the_valve_is_active",
    "ENABLE_LOST": "hil/frame_faults::enable_lost",
    "R2": "controller/test_enable controller/test_enable_press",
    "EMERGENCY_STOP": "hil/frame_faults::emergency_stop",
    "EMERGENCY_STOP_LOST": "hil/frame_faults::emergency_stop_lost",
    "SECOND_SENDER": (
        "hil/test_faults::second_sender protocols/j1939/test_network::commands_our_valve "
        "protocols/gateway/test_line::another_sender hil/test_gateway_rules::left_in_place"
    ),
    "ADDRESS_LOST": "hil/test_j1939::silences_us",
    "VALVE_FAULT": (
        "hil/test_canopen::emergency hil/test_canopen::restarts hil/test_canopen::heartbeat "
        "protocols/canopen/test_cia408::fault_in_motion "
        "protocols/canopen/test_cia408::status_word"
    ),
    "LOOP_STALLED": (
        "hil/test_process_faults::stopped daemon/test_standstill hil/test_canopen::standstill"
    ),
    "SEND_FAILED": "hil/test_interface_faults::full_queue",
    "NOT_CONFIRMED": "hil/test_interface_faults::piled_up hil/test_lying_buses::by_consent_only",
    "BUS_DOWN": "hil/test_daemon::down_and_up",
    "BUS_GONE": "hil/test_interface_faults::removed_and_back",
    "BUS_OFF": "hil/test_interface_faults::bus_off hil/test_lying_buses::bus_off_without_echo",
    "BUS_WRONG_DEVICE": (
        "hil/test_device::changed_hands hil/test_device::leaves_its_name "
        "bus/test_raw_interface::another_device"
    ),
    "OUTPUT_REFUSED": "promises/test_5::neutral_leaves",
    "DECODERS_DISAGREE": "gate/test_guarded::disagree",
    "OUTPUT_INVALID": "shaping/test_axis_error daemon/test_internal_error::setpoint",
    "R3": "systemd/test_instance::killed_in_motion systemd/test_instance::hang",
    "R4": "daemon/test_late_frame",
    "R5": (
        "hil/test_device::at_the_start systemd/test_device hil/test_lying_buses::service_waits "
        "hil/test_lying_buses::without_can_fd"
    ),
    "R6": "hil/test_gateway::killed systemd/test_gateway",
    "R7": "hil/test_faults::comes_twice inputs/test_checksum::one_wrong_checksum",
    "JOYSTICK_NOT_NEUTRAL": "promises/test_1",
    "R8": (
        "protocols/j1939/test_network::first_of_two_joysticks "
        "protocols/j1939/test_network::change_of_joysticks"
    ),
    "R9": "hil/test_canopen::second_one",
    "NOT_FOLLOWING, FEEDBACK_LOST": "inputs/test_feedback",
    "R10": (
        "closed_loop/test_sway_sensor_faults closed_loop/test_sway_contact "
        "closed_loop/test_sensor_protocols"
    ),
    "R11": "hil/test_gateway_rules::missing_rules daemon/test_gateway_wait::rules_are_looked_at",
    "R12": "hil/test_faults::flood hil/test_lying_buses::flood",
    "FRAMES_LOST": "bus/test_raw::run_over",
    "MISSED_DEADLINE": "controller/test_controller_faults::missed_ticks",
    "BUS_PASSIVE, ERROR_FRAME": "hil/test_interface_faults::passive",
    "R13": "daemon/test_control_server controller/test_adjust::refused",
    "R14": "hil/test_daemon::reload hostile/test_files daemon/test_config_reload",
    "R15": "hil/test_process_faults::full_disk hil/test_process_faults::hangs",
}


def reaction_rows() -> Iterator[str]:
    """Table of the reactions.

    Raises:
        ValueError: a reason says another reaction than its row.
    """
    yield "| claim | fault | reaction | within | tests |"
    yield "|---|---|---|---|---|"
    for row in ROWS:
        tests = " ".join(f"`{one}`" for one in TESTS[row.ids].split())
        yield f"| {row.ids} | {row.what} | {row.reaction} | {row.within} | {tests} |"
