"""Values that the DBC names, of all that is read but joysticks: refused, or what they mean."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.inputs.value import MeasuredSignal, measurable
from canshaper.machine.used_message import NamedCode
from tests.cli.init_script import DBC as SHIPPED
from tests.machine.test_deployment_parts import chosen as chosen  # noqa: PLC0414
from tests.machine.test_sway_sensor_binding import ALONG, sensing
from tests.machine.test_value_inputs import FEEDBACK, LOAD, PROFILE, RADIUS, STOP, VALUES, valued
from tests.rigs.files import Machine

__all__ = ["chosen", "valued"]
COMMAND = "command: { joystick: left, signal: Slew,"
SWITCH = 'VAL_ 272 Enable 0 "Off" 1 "On" 2 "Error" 3 "NotAvailable" ;'
Section = tuple[str, str, str]
sections = pytest.mark.parametrize(
    ("section", "signal"), [(LOAD, "Weight"), (RADIUS, "Radius"), (FEEDBACK, "Weight")]
)


def named(machine: Machine, signal: str, table: str, section: Section, keys: str = "") -> None:
    """A message with a value whose codes have names, read by a section."""
    machine.in_dbc("VAL_ 272 Slew", f"VAL_ 288 {signal} {table} ;\nVAL_ 272 Slew")
    _, before, text = section
    machine.in_yaml(before, text % f"{VALUES}, signal: {signal}{keys}" + before)


@sections
def test_a_name_within_the_range_has_to_be_listed(
    valued: Machine, section: Section, signal: str
) -> None:
    named(valued, signal, '100 "Virhe"', section)
    (problem,) = valued.problems()
    assert problem.startswith(f"machine.dbc:30: Values: {signal}: expected {section[0]}.codes to")
    assert (
        '100 "Virhe" is a value (10 m)' in problem or '100 "Virhe" is a value (100 kg)' in problem
    )


@sections
@pytest.mark.parametrize(("meaning", "is_value"), [("fault", False), ("value", True)])
def test_the_file_says_what_a_name_means(
    valued: Machine, section: Section, signal: str, meaning: str, is_value: bool
) -> None:
    named(valued, signal, '100 "Virhe" 150 "Error"', section, f", codes: {{ Virhe: {meaning} }}")
    deployment = valued.load()
    (message,) = (one for one in deployment.inputs() if one.message.name == "Values")
    read = message.message.get_signal_by_name(signal)
    measured = MeasuredSignal(read, *measurable(read))
    assert (measured.value({signal: 100}) is not None) == is_value
    assert measured.value({signal: 99}) is not None
    assert measured.value({signal: 150}) is None
    means = {code.name: code.means for code in deployment.codes if code.signal == signal}
    assert means["Error"] == "fault"
    assert (means["Virhe"] == "fault") != is_value


def test_a_name_that_there_is_not(machine: Machine) -> None:
    line = machine.in_yaml(COMMAND, f"{COMMAND} codes: {{ Broken: fault }},")
    expected = "expected a value of Slew that the DBC names, got 'Broken'"
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.slew.command.codes.Broken: {expected}; there are Error,"
        " NotAvailable"
    ]


@pytest.mark.parametrize(
    ("code", "name", "meaning", "says"),
    [
        (
            1200,
            "Far",
            "value",
            "expected fault for 120 of Slew, which is out of the range, got value",
        ),
        (0, "Neutral", "fault", "expected value for 0 of Slew, which is neutral, got fault"),
    ],
)
def test_what_the_file_may_not_say(
    machine: Machine, code: int, name: str, meaning: str, says: str
) -> None:
    machine.in_dbc("VAL_ 272 Slew", f'VAL_ 272 Slew {code} "{name}"')
    line = machine.in_yaml(COMMAND, f"{COMMAND} codes: {{ {name}: {meaning} }},")
    assert machine.problems() == [f"machine.yaml:{line}: axes.slew.command.codes.{name}: {says}"]


def test_axes_that_share_a_signal_say_the_same_of_it(machine: Machine) -> None:
    machine.in_yaml("signal: NearFar,", "signal: Slew, codes: { Error: fault },")
    (problem,) = machine.problems()
    assert "axes.near_far.command.codes: expected the same as axes.slew.command" in problem


def test_the_names_of_both_directions_of_a_rocker(machine: Machine) -> None:
    machine.in_dbc(
        'Slew : 0|16@1- (0.1,0) [-100|100] "%" SHAPER',
        'Slew : 0|8@1+ (1,0) [0|1] "" SHAPER\n SG_ Back : 8|8@1+ (1,0) [0|1] "" SHAPER',
    )
    table = '0 "Released" 1 "Pressed"'
    machine.in_dbc(
        'Slew 32766 "Error" 32767 "NotAvailable" ;', f"Slew {table} ;\nVAL_ 272 Back {table} ;"
    )
    machine.in_yaml(COMMAND, f"{COMMAND} negative: Back,")
    assert [one.count("to say whether 1") for one in machine.problems()] == [1, 1]
    machine.in_yaml("negative: Back,", "negative: Back, codes: { Pressed: value },")
    means = [(c.signal, c.code, c.means) for c in machine.load().codes][:4]
    assert means == [
        ("Slew", 0, "neutral"),
        ("Slew", 1, "moves slew at 100 %"),
        ("Back", 0, "neutral"),
        ("Back", 1, "moves slew at -100 %"),
    ]


def test_a_breakpoint_lists_its_value(chosen: Machine) -> None:
    chosen.in_dbc("VAL_ 1296 Weight", 'VAL_ 1296 Weight 0 "Open" 1000 "Closed"')
    load = chosen.load().load_state
    assert load is not None
    assert "Closed" not in map(str, (load.message.signals[0].choices or {}).values())


def test_of_a_profile_only_an_error_is_none(valued: Machine) -> None:
    profile = (PROFILE[0], PROFILE[1], PROFILE[2].replace("calm: 1", "soft: 1"))
    named(valued, "Page", '0 "Normal" 1 "Soft" 7 "Error"', profile)
    codes = valued.load().codes
    assert [code.means for code in codes if code.signal == "Page"] == ["0", "1", "fault"]


def test_a_sway_sensor(machine: Machine) -> None:
    sensing(machine, ALONG)
    machine.in_dbc("VAL_ 272 Slew", 'VAL_ 1024 SwayParallel 9000 "Kaputt" ;\nVAL_ 272 Slew')
    (problem,) = machine.problems()
    assert "axes.near_far.sway_sensor.codes to say whether 9000" in problem


@pytest.mark.parametrize(
    "name",
    ["Error", "NotAvailable", "ShortCircuit", "Open circuit", "Fehler", "SIGNAL_LOST", "Virhe"],
)
def test_a_code_that_enables_has_no_name_of_an_error(machine: Machine, name: str) -> None:
    machine.in_dbc(SWITCH, f'VAL_ 272 Enable 0 "Off" 1 "{name}" ;')
    (problem,) = machine.problems()
    expected = "expected a signal whose 1 is on, got 'Enable', whose 1 is"
    assert problem.endswith(f'joysticks.left.enable: {expected} "{name}" in the DBC')


def test_a_stop_that_is_free_has_no_name_of_an_error(valued: Machine) -> None:
    named(valued, "Page", '0 "Error" 1 "Pressed"', STOP)
    (problem,) = valued.problems()
    assert "emergency_stop.signal: expected a signal whose 0 is free, got 'Page'" in problem


def test_what_codes_mean_is_listed(machine: Machine) -> None:
    codes = machine.load().codes
    assert NamedCode("JoystickLeft", "Enable", 1, "On", "on") in codes


def test_init_asks_for_what_names_mean(tmp_path: Path) -> None:
    text = SHIPPED.read_text(encoding="cp1252").replace(
        "VAL_ 272 Slew", 'VAL_ 272 Slew 1000 "Full" -1000 "Open circuit" 0 "Neutral"', 1
    )
    (tmp_path / "names.dbc").write_text(text, encoding="cp1252")
    (tmp_path / "answers.txt").write_text('Slew: 1000 is "Full" = value\n', encoding="utf-8")
    file = tmp_path / "machine.yaml"
    words = ["init", str(file), "--dbc", str(tmp_path / "names.dbc")]
    shown = CliRunner().invoke(app, [*words, "--answers", str(tmp_path / "answers.txt")])
    assert shown.exit_code == 0, shown.output
    assert 'codes: { "Full": value, "Open circuit": fault }' in file.read_text(encoding="utf-8")
