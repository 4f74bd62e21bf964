"""Tests of each claim of docs/safety.md that is no reaction; the others: tools/reactions.py."""

from collections.abc import Iterator, Mapping

from tools.reactions import quoted

TESTS: Mapping[str, str] = {
    "P1": "promises/test_1",
    "P2": "promises/test_2 controller/test_bypass_released shaping/test_cut_off",
    "P3": "promises/test_3",
    "P4": "promises/test_4",
    "P5": "promises/test_5",
    "P6": "promises/test_6 daemon/test_internal_error",
    "H1": "systemd/test_instance::killed_in_motion promises/test_1::at_the_start",
    "H2": "promises/test_1::every_reason promises/test_5",
    "H3": "systemd/test_instance::hang hil/test_interface_faults::piled_up",
    "H4": (
        "commissioning/procedure/test_hands::first_motion inputs/test_feedback::goes_the_other_way"
    ),
    "H5": "cli/test_check::which_axis_moves hil/test_calibrate::asks_before_anything_moves",
    "H6": "protocols/gateway/test_line::every_other_bit machine/test_start_values",
    "H7": "shaping/test_run_on",
    "H8": "shaping/test_run_on::against_the_joystick",
    "H9": "none: by the ECU",
    "H10": "hil/test_device",
    "H11": (
        "daemon/test_daemon::reload_in_motion controller/test_adjust controller/test_adjust_limits"
    ),
    "H12": "blackbox/test_killed::is_on_the_disk",
    "H13": (
        "daemon/test_control_server::only_its_owner daemon/test_control_requests::log_says_who"
        " studio/test_numbers::only_who_has_the_address"
    ),
    "H14": "controller/test_overrun hil/test_faults::comes_twice",
    "H15": (
        "shaping/test_axis_changes::no_change_beats_the_rates"
        " controller/test_listening::only_status"
    ),
    "H16": (
        "protocols/j1939/test_network::first_of_two_joysticks inputs/test_input::jumps_without_end"
    ),
    "A1": "controller/test_motion_ends",
    "A2": "shaping/test_added shaping/test_added_after_stop shaping/test_run_on::added",
    "A3": "closed_loop/test_motion::no_farther_than_check_says shaping/test_other_plane",
    "A4": (
        "shaping/test_added::missed_ticks_use_up_time shaping/test_motion_bounds::way_begins_again"
    ),
    "A5": "shaping/test_motion::no_step_of_the_added_part",
    "A6": "closed_loop/test_motion::moves_no_axis_back",
    "A7": "shaping/test_added_ends shaping/test_motion::ends_in_a_fifth_of_a_second",
    "A8": "shaping/test_motion_luffing::adds_in_the_range_of_its_demands",
    "G1": "gate/test_stops",
    "G2": "gate/test_received promises/test_1::every_reason",
    "G3": "proof/test_gate_rules::neutral_first",
    "G4": "gate/test_rules proof/test_gate_rules::direction_and_size",
    "G5": "gate/test_rates::valve_that_has_closed proof/test_gate_rules::rise_and_fall",
    "G6": "gate/test_rates::fall_to_neutral",
    "G7": "gate/test_distance gate/test_added",
    "G8": "gate/test_bytes gate/test_checks promises/test_5::no_wrong_frame",
    "G9": "promises/test_4::one_frame_of_a_valve",
    "G10": "gate/test_bytes::leaves_besides gate/test_bytes::some_times_in_a_tick",
}
"""Tests of each claim that is no reaction, as tests/docs/test_claims.py reads them."""


def claim_rows() -> Iterator[str]:
    """Yield the Markdown table of the tests of the claims that are no reactions."""
    yield "| claim | tests |"
    yield "|---|---|"
    for claim, tests in TESTS.items():
        yield f"| {claim} | {quoted(tests) if '/' in tests else tests} |"
