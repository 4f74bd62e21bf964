"""Faults of a file that no other test has: each one line that names the place."""

from pathlib import Path

import pytest

from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from tests.machine.gateway_files import j1939_gateway
from tests.machine.gateway_files import problems as of_gateway
from tests.rigs.files import ROOT, Machine, faults, machine_file

STATUS = "status: { bus: crane, message: ShaperStatus }"
FEEDBACK = "    status: { bus: crane, message: LiftStatus }\n"


@pytest.mark.parametrize(
    ("old", "new", "place", "text"),
    [
        (
            STATUS,
            f"{STATUS}\nload_state: {{ bus: crane, message: Nothing, signal: W, timeout_ms: 500 }}",
            "load_state.message",
            "Nothing",
        ),
        (
            FEEDBACK,
            f"{FEEDBACK}    feedback: {{ bus: crane, message: Nothing, signal: V,"
            " tolerance_pct: 10, timeout_ms: 100 }\n",
            "axes.lift.feedback.message",
            "Nothing",
        ),
        (
            "axes:\n",
            "switches:\n  seat: { bus: crane, message: Nothing, signal: Seated, timeout_ms: 200 }\n"
            "axes:\n",
            "switches.seat.message",
            "Nothing",
        ),
    ],
)
def test_it_is_answered(machine: Machine, old: str, new: str, place: str, text: str) -> None:
    machine.in_yaml(old, new)
    answers = machine.problems()
    assert any(f" {place}: " in one and text in one for one in answers), answers


@pytest.mark.parametrize(
    ("old", "new", "place", "text"),
    [
        (
            "signal: SetPoint",
            "signal: Nothing",
            "axes.slew.valve.signal",
            "Nothing",
        ),
        (
            "status: { bus: crane, message: SlewValve",
            "status: { bus: crane, message: Nothing",
            "axes.slew.valve.cia408.status.message",
            "Nothing",
        ),
        (
            "signal: StatusWord",
            "signal: Nothing",
            "axes.slew.valve.cia408.status.signal",
            "Nothing",
        ),
    ],
)
def test_it_is_answered_of_a_valve_of_cia_408(
    tmp_path: Path, old: str, new: str, place: str, text: str
) -> None:
    answers = faults(machine_file(tmp_path, "canopen-forwarder", (old, new)))
    assert any(one.startswith(f"{place}: ") and text in one for one in answers), answers


def test_a_gateway_needs_the_switch_in_the_message_that_it_passes_on(tmp_path: Path) -> None:
    switch = "switches:\n  seat: { bus: joysticks, message: JoystickRight, signal: Enable,"
    (*_, answer) = of_gateway(
        tmp_path,
        ("    enable: Enable\n", "    enable: seat\n"),
        ("axes:\n", f"{switch} timeout_ms: 100 }}\n\naxes:\n"),
    )
    assert "joysticks.left.enable: expected one switch of its own message" in answer


def test_a_feedback_needs_a_full_scale(machine: Machine) -> None:
    feedback = "feedback: { bus: crane, message: TipVelocity, signal: SlewRate, timeout_ms: 100 }"
    machine.in_yaml(FEEDBACK, f"{FEEDBACK}    {feedback}\n")
    machine.in_dbc("SlewRate : 0|16@1- (0.0001,0) [-3|3]", "SlewRate : 0|16@1- (0.0001,0) [0|0]")
    (answer,) = machine.problems()
    assert answer.endswith("SlewRate: expected a range in the DBC, or full, got neither")


def test_a_gateway_needs_two_like_signals_of_a_rocker(tmp_path: Path) -> None:
    near_far = "signal: NearFar, "
    answers = of_gateway(
        tmp_path,
        (f"{near_far}neutral_pct: 2", f"{near_far}negative: Back, neutral_pct: 2"),
        dbc=(
            ' SG_ NearFar : 16|16@1- (0.1,0) [-100|100] "%" SHAPER\n',
            ' SG_ NearFar : 16|16@1+ (0.1,0) [0|100] "%" SHAPER\n'
            ' SG_ Back : 48|8@1+ (1,0) [0|100] "%" SHAPER\n',
        ),
    )
    like = "Back: expected a signal like NearFar, got another kind"
    assert any(like in answer for answer in answers), answers


def test_a_gateway_needs_the_address_of_a_joystick_of_j1939(tmp_path: Path) -> None:
    """It leaves under the joystick's."""
    needs = "in the DBC BJM1 may come from any source address; where its frames leave, its joystick"
    answers = faults(j1939_gateway(tmp_path))
    assert f"axes.slew.valve.message: {needs} needs the key source" in answers, answers


@pytest.mark.parametrize("signal", ["Slew", "NearFar"])
def test_a_float_has_the_full_scale_of_the_file_alone(machine: Machine, signal: str) -> None:
    """No step of it goes beyond that, as one of two's complement does."""
    machine.in_yaml(f"signal: {signal}, neutral_pct", f"signal: {signal}, full: 80, neutral_pct")
    other = "NearFar" if signal == "Slew" else "Slew"
    place = {"Slew": 0, "NearFar": 16}
    machine.in_dbc(f"{other} : {place[other]}|16@1-", f"{other} : 40|16@1-")
    machine.in_dbc(f"{signal} : {place[signal]}|16@1- (0.1,0)", f"{signal} : 0|32@1- (1,0)")
    machine.dbc += f"SIG_VALTYPE_ 272 {signal} : 1;\n"
    message = machine.load().joysticks["left"].message
    of_file = next(one for one in message.signals if one.name == signal)
    assert (of_file.minimum, of_file.maximum) == (-80.0, 80.0)


def test_dbc_files_of_a_bundle_are_inside_it(machine: Machine) -> None:
    machine.load()
    file = machine.directory / "machine.yaml"
    assert load_deployment(file, inside=machine.directory)
    other = machine.directory / "elsewhere"
    other.mkdir()
    # From Python 3.13 on a circle of links is inside, and cannot be read.
    for name, says in (("../machine.dbc", "a file of the bundle, got"), ("loop.dbc", "a file")):
        (other / "machine.yaml").write_text(machine.yaml.replace("machine.dbc", name))
        if not (other / "loop.dbc").is_symlink():
            (other / "loop.dbc").symlink_to(other / "loop.dbc")
        with pytest.raises(ConfigError, match=f"dbc.0: expected {says}"):
            load_deployment(other / "machine.yaml", inside=other)


def test_a_sway_sensor_is_named_by_message_and_signal() -> None:
    axes = load_deployment(ROOT / "config" / "forwarder-sensor.yaml").axes
    assert axes["slew"].sway_sensor is not None
    assert axes["slew"].sway_sensor.name == "SwayAngle.Across"
