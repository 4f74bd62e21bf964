"""Enable switches in a deployment: what is wrong is one line."""

import pytest

from tests.rigs.files import Machine


def test_the_way_to_stop_counts_the_slowest_switch(switched: Machine) -> None:
    shortest_m = 4.8 * (0.3 + 0.04 + 0.1)  # timeout, two periods, the fall
    switched.in_yaml("stop_distance_m: 200", f"stop_distance_m: {shortest_m + 0.01:.2f}")
    switched.load()
    switched.in_yaml("code: 3, timeout_ms: 300", "code: 3, timeout_ms: 400")
    assert "axes.slew.limits.stop_distance_m: expected" in switched.problems()[0]


# -- what the file may not say -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("right.Enable]", "rihgt.Enable]", "enable.4: expected a joystick, got 'rihgt'"),
        ("right.Enable]", "right.Enabel]", "expected a signal of JoystickRight, got 'Enabel'"),
        ("right.Enable]", "seet]", "expected a signal of JoystickLeft, got 'seet'"),
        ("right.Enable]", "seat]", "enable.4: expected each switch once, got 'seat' again"),
        ("right.Enable]", "right.Lift]", "expected a free signal, got 'Lift', which is enable"),
        (", mode,", ",", "switches.mode: expected a joystick that mode enables, got none"),
        ("signal: Door", "signal: Seated", "expected a free signal, got 'Seated'"),
        ("signal: Mode, code", "signal: Mode, cycle_ms: 200, code", "timeout_ms: expected 400 ms"),
        (
            "code: 3",
            "code: 256",
            "mode.code: Mode can never be 256: expected a signal that has it, got 0 to 255",
        ),
        (
            "signal: Door",
            "signal: Door, code: 4",
            "door.code: Door can never be 4: expected a signal that has it, got 0 to 3",
        ),
        ("Door, alive_counter: Count,", "Door,", "the same as switches.seat, which reads the"),
        ("message: Ecu", "message: JoystickLeft", "which is used already by"),
        ("[Enable, seat, door, mode, right.Enable]", "[]", "enable: expected 1 or more entries"),
        ("    enable: [", "    enable_of: right\n    enable: [", "enable and enable_of, got both"),
        ("    enable: [Enable, seat, door, mode, right.Enable]\n", "", "enable_of, got neither"),
        ("enable: [Enable, seat, door, mode, right.Enable]", "enable_of: left", "got both"),
        (
            "enable: [Enable, seat, door, mode, right.Enable]",
            "enable_of: front",
            "enable_of: expected a joystick with enable, got 'front'; there are right",
        ),
    ],
)
def test_what_is_wrong_is_one_line(switched: Machine, old: str, new: str, says: str) -> None:
    if says == "got both" and "enable_of: left" in new:
        new, says = "enable_of: left", "enable_of: expected a joystick with enable, got 'left'"
    switched.in_yaml(old, new)
    assert any(says in problem for problem in switched.problems()), switched.problems()


def test_a_message_without_a_cycle_is_no_switch(switched: Machine) -> None:
    switched.in_dbc('BA_ "GenMsgCycleTime" BO_ 289 100;\n', "")
    line = switched.in_dbc("BO_ 289", "BO_ 289")
    assert switched.problems() == [
        f"machine.dbc:{line}: Ecu: has no GenMsgCycleTime; cycle_ms may say it"
    ]
