"""Which switches enable a joystick in a deployment: each problem is one whole line."""

import pytest

from tests.rigs.files import Machine

SEAT_DBC = """BO_ 288 Seat: 2 JOYSTICKS
 SG_ Seated : 0|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Door : 2|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Count : 4|4@1+ (1,0) [0|15] "" SHAPER
 SG_ Mode : 8|8@1+ (1,0) [0|255] "" SHAPER

BO_ 289 JoystickThird: 2 JOYSTICKS
 SG_ Enable : 0|2@1+ (1,0) [0|3] "" SHAPER

"""
SWITCHES = """switches:
  seat: { bus: crane, message: Seat, signal: Seated, alive_counter: Count, timeout_ms: 200 }
  door: { bus: crane, message: Seat, signal: Door, code: 3, alive_counter: Count, timeout_ms: 200 }

axes:
"""
THIRD = "  third: { bus: crane, message: JoystickThird, enable_of: right, timeout_ms: 200 }\n"
ENABLE = "enable: [Enable, right.Enable, seat, door]"
LEFT = "joysticks.left.enable"


@pytest.fixture
def switched(machine: Machine) -> Machine:
    """The left joystick needs seat, door and the switch of the right one besides its own."""
    machine.in_dbc("BO_ 512 SlewCommand", SEAT_DBC + "BO_ 512 SlewCommand")
    cycle = 'BA_ "GenMsgCycleTime" BO_ 272 20;\n'
    machine.in_dbc(cycle, cycle + "".join(cycle.replace("272", n) for n in ("288", "289")))
    machine.in_yaml("axes:\n", SWITCHES)
    machine.in_yaml("enable: Enable", ENABLE)
    return machine


def test_the_switches_of_one_message_are_bound_together(switched: Machine) -> None:
    switched.in_yaml("switches:\n", f"{THIRD}\nswitches:\n")
    (bound,) = switched.load().switches
    assert bound.message.name == "Seat"
    assert bound.switches == {"seat": ("Seated", 1), "door": ("Door", 3)}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "right.Enable",
            "rihgt.En.able",
            f"{LEFT}.1: expected a joystick, got 'rihgt'; there are left, right",
        ),
        (
            ENABLE,
            "enable: [rihgt.Enable, door]",
            f"{LEFT}.0: expected a joystick, got 'rihgt'; there are left, right",
        ),
        (
            "right.Enable",
            "right.Enabel",
            f"{LEFT}.1: expected a signal of JoystickRight, got 'Enabel'; there are Lift, Rotate,"
            " Enable, AntiSwayOff, Reset, AliveCounter; did you mean Enable?",
        ),
        (
            "door]",
            "door, Enable]",
            f"{LEFT}.4: expected each switch once, got 'Enable' again",
        ),
        (
            "seat, door]",
            "door]",
            "switches.seat: expected a joystick that seat enables, got none",
        ),
        (
            "signal: Seated",
            "signal: Count",
            "switches.seat.alive_counter: expected a free signal, got 'Count', which is signal"
            " already",
        ),
        (
            "signal: Seated",
            "signal: Sat",
            "switches.seat.signal: expected a signal of Seat, got 'Sat'; there are Seated, Door,"
            " Count, Mode; did you mean Seated?",
        ),
        (
            "signal: Door",
            "signal: Seated",
            "switches.door.signal: expected a free signal, got 'Seated', which is signal already",
        ),
        (
            "code: 3, alive_counter: Count, timeout_ms: 200",
            "code: 3, alive_counter: Count, timeout_ms: 300",
            "switches.door.timeout_ms: expected the same as switches.seat, which reads the message"
            " too",
        ),
        (
            "code: 3",
            "code: 4",
            "switches.door.code: Door can never be 4: expected a signal that has it, got 0 to 3",
        ),
    ],
)
def test_what_is_wrong_is_one_whole_line(switched: Machine, old: str, new: str, says: str) -> None:
    switched.in_yaml(old, new)
    problems = switched.faults()
    assert says in problems, problems


@pytest.mark.parametrize("text", ["rihgt.Enable", "[rihgt.Enable]"])
def test_a_place_of_one_name_has_no_number(machine: Machine, text: str) -> None:
    machine.in_yaml("enable: Enable", f"enable: {text}")
    assert machine.faults() == [f"{LEFT}: expected a joystick, got 'rihgt'; there are left, right"]


@pytest.mark.parametrize("of", ["front", "third"])
def test_the_joystick_whose_switches_count_has_some(switched: Machine, of: str) -> None:
    third = THIRD.replace("enable_of: right", f"enable_of: {of}")
    switched.in_yaml("switches:\n", f"{third}\nswitches:\n")
    problems = switched.faults()
    assert problems == [
        f"joysticks.third.enable_of: expected a joystick with enable, got '{of}';"
        " there are left, right"
    ]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("door]", "seet]", "expected a signal of JoystickLeft, got 'seet'"),
        ("right.Enable", "right.Lift", "expected a free signal, got 'Lift', which is enable"),
        ("message: Seat, signal: Door", "message: JoystickLeft, signal: Door", "is used already"),
        (ENABLE, "enable: []", "enable: expected 1 or more entries"),
        (ENABLE, f"enable_of: right\n    {ENABLE}", "enable and enable_of, got both"),
        (f"    {ENABLE}\n", "", "enable_of, got neither"),
        (ENABLE, "enable_of: left", "enable_of: expected a joystick with enable, got 'left'"),
        ("signal: Seated,", "signal: Seated, cycle_ms: 200,", "timeout_ms: expected 400 ms"),
    ],
)
def test_switches_that_cannot_be(switched: Machine, old: str, new: str, says: str) -> None:
    switched.in_yaml(old, new)
    assert any(says in problem for problem in switched.problems()), switched.problems()


def test_the_way_to_stop_counts_the_slowest_switch(switched: Machine) -> None:
    shortest_m = 4.8 * (0.2 + 0.04 + 0.1)  # timeout, two periods, the fall
    switched.in_yaml("stop_distance_m: 200", f"stop_distance_m: {shortest_m + 0.01:.2f}")
    switched.load()
    switched.yaml = switched.yaml.replace("timeout_ms: 200 }", "timeout_ms: 300 }")
    assert "axes.slew.limits.stop_distance_m: expected" in switched.problems()[0]
