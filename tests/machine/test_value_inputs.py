"""Messages with a value: load state, profile, radius and feedback; each problem with its place."""

import pytest

from canshaper.codec.layout import Chosen
from tests.rigs.files import Machine

VALUES_DBC = """BO_ 288 Values: 8 JOYSTICKS
 SG_ Weight : 0|16@1+ (1,0) [0|1000] "kg" SHAPER
 SG_ Radius : 16|8@1+ (0.1,0) [0|20] "m" SHAPER
 SG_ Page : 24|8@1+ (1,0) [0|255] "" SHAPER
 SG_ Force : 32|32@1- (1,0) [0|1] "" SHAPER

"""
THERE = "there are Weight, Radius, Page, Force"
VALUES = "bus: crane, message: Values, timeout_ms: 100"
STATUS = "    status: { bus: crane, message: LiftStatus }\n"
# Place and text of each section, before which piece it stands, and what goes before it.
LOAD = ("load_state", "axes:\n", "load_state: { %s }\n\n")
PROFILE = ("profile", "axes:\n", "profile: { %s, codes: { calm: 1 } }\n\n")
RADIUS = (
    "motion.crane.radius",
    "axes:\n",
    "motion: { crane: { slew: slew, near_far: near_far, radius: { %s } } }\n\n",
)
FEEDBACK = ("axes.lift.feedback", STATUS, "    feedback: { %s, full: 100, tolerance_pct: 10 }\n")
STOP = ("emergency_stop", "axes:\n", "emergency_stop: { %s }\n\n")


@pytest.fixture
def valued(machine: Machine) -> Machine:
    """The shipped machine with a message of values, not yet named."""
    machine.in_dbc("BO_ 512 SlewCommand", VALUES_DBC + "BO_ 512 SlewCommand")
    cycle = 'BA_ "GenMsgCycleTime" BO_ 272 20;\n'
    machine.in_dbc(cycle, cycle + cycle.replace("272", "288"))
    machine.in_dbc("VAL_ 272 Slew 32766", "SIG_VALTYPE_ 288 Force : 1;\nVAL_ 272 Slew 32766")
    return machine


def answers(machine: Machine, section: tuple[str, str, str], keys: str) -> list[str]:
    """Problems of the machine with a section of these keys, without file and line."""
    _, before, text = section
    machine.in_yaml(before, text % f"{VALUES}, {keys}" + before)
    return machine.faults()


@pytest.mark.parametrize("section", [LOAD, PROFILE, RADIUS, FEEDBACK])
def test_the_value_is_a_signal_of_the_message(
    valued: Machine, section: tuple[str, str, str]
) -> None:
    place = section[0]
    expected = f"{place}.signal: expected a signal of Values, got 'Nothing'; {THERE}"
    assert expected in answers(valued, section, "signal: Nothing")


@pytest.mark.parametrize(
    ("section", "signal"),
    [(LOAD, "Weight"), (PROFILE, "Page"), (RADIUS, "Radius"), (FEEDBACK, "Weight")],
)
def test_the_value_is_no_counter(
    valued: Machine, section: tuple[str, str, str], signal: str
) -> None:
    place = section[0]
    expected = f"{place}.alive_counter: expected a free signal, got '{signal}', which is signal"
    keys = f"signal: {signal}, alive_counter: {signal}"
    assert f"{expected} already" in answers(valued, section, keys)


def test_the_number_of_a_profile_is_an_integer(valued: Machine) -> None:
    expected = "profile.signal: Force: expected an integer signal, got a float"
    assert expected in answers(valued, PROFILE, "signal: Force")


def test_a_multiplexed_message_is_read_from_the_chosen_frames(valued: Machine) -> None:
    valued.in_dbc("SG_ Page : 24", "SG_ Page M : 24")
    valued.in_dbc("SG_ Weight : 0", "SG_ Weight m3 : 0")
    _, before, text = STOP
    valued.in_yaml(before, text % f"{VALUES}, signal: Weight, multiplexor: 3" + before)
    stop = valued.load().emergency_stop
    assert stop is not None
    assert stop.chosen == Chosen("Page", 3, False)
