"""``canshaper init``: questions answered by a script, and the file that comes of it."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from cantools.database import load_string
from cantools.database.can import Signal
from click.testing import Result
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine import suggest
from canshaper.machine.binding import load_deployment

ROOT = Path(__file__).parents[2]
DBC = ROOT / "dbc" / "forwarder.dbc"
# The questions in their order, with the first words of each.
QUESTIONS = (
    "Is all of it right",
    "CAN interface",
    "Bit rate",
    "Messages of the joysticks",
    *(
        f"{joystick}: {text}"
        for joystick in ("JoystickLeft", "JoystickRight")
        for text in ("e", "r", "a")
    ),
    "Axis of JoystickLeft.Slew",
    "slew valve",
    "slew timeout",
    "slew swings",
    "slew ten",
    "slew first",
    "slew last",
    "slew speed",
    "slew turns",
    "slew turn speed",
    "slew radius",
    "slew sensor",
    "Axis of JoystickLeft.NearFar",
    "near_far valve",
    "near_far timeout",
    "near_far swings",
    "near_far ten",
    "near_far first",
    "near_far last",
    "near_far speed",
    "near_far turns",
    "near_far sensor",
    "Axis of JoystickRight.Lift",
    "lift valve",
    "lift timeout",
    "lift swings",
    "Axis of JoystickRight.Rotate",
    "rotate valve",
    "Axis that moves the tip",
    "Measured radius",
)


def answers(given: Mapping[str, str]) -> str:
    """Enter for every question but these; several tries are separated by a line."""
    assert {*given} <= {*QUESTIONS}
    given = {"Is all of it right": "n", **given}
    return "".join(f"{given.get(question, '')}\n" for question in QUESTIONS)


def init(file: Path, given: Mapping[str, str] | None = None, *options: str) -> Result:
    arguments = ["init", str(file), "--dbc", str(DBC), *options]
    return CliRunner().invoke(app, arguments, input=answers(given or {}), prog_name="canshaper")


def axis(file: Path, name: str) -> Any:
    return load_deployment(file).config.axes[name]


def test_enter_throughout_gives_a_machine_with_what_was_found(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    result = init(file)
    assert result.exit_code == 0, result.output
    config = load_deployment(file).config
    assert list(config.axes) == ["slew", "near_far", "lift"]
    slew = config.axes["slew"]
    assert (slew.command.signal, slew.valve.message) == ("Slew", "SlewCommand")
    assert slew.status is not None
    assert slew.status.message == "SlewStatus"
    assert slew.limits.max_pct == 40
    assert slew.sway_sensor is None
    assert config.axes["lift"].filter.kind == "off"
    left = config.joysticks["joystick_left"]
    assert (left.enable, left.reset, left.anti_sway_off) == (["Enable"], "Reset", "AntiSwayOff")
    assert (left.timeout_ms, left.alive_counter) == (100, "AliveCounter")
    assert config.status is not None
    assert f"canshaper check {file}" in result.output


def test_messages_of_can_fd_make_the_bus_one(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    arguments = ["init", str(file), "--dbc", str(ROOT / "dbc" / "canfd.dbc")]
    result = CliRunner().invoke(app, arguments, input="\n" * 60, prog_name="canshaper")
    assert result.exit_code == 0, result.output
    bus = load_deployment(file).config.buses["crane"]
    assert (bus.fd, bus.data_bitrate) == (True, 2_000_000)
    assert "CAN FD: bit rate of the data" in result.output
    classical = tmp_path / "classical.yaml"
    assert "CAN FD" not in init(classical).output
    assert load_deployment(classical).config.buses["crane"].fd is False


def test_messages_that_cannot_be_used_are_shown_and_left_out(tmp_path: Path) -> None:
    other = tmp_path / "other.dbc"
    signal = 'SG_ S : 0|9@1+ (1,0) [0|0] "" A'
    other.write_text(f'VERSION ""\n\nBO_ 5 Other: 1 A\n {signal}\n', encoding="cp1252")
    file = tmp_path / "machine.yaml"
    shown = init(file, None, "--dbc", str(other))
    assert shown.exit_code == 0, shown.output
    assert "  1 WARNING in messages and tables that are left out:\n" in shown.output
    assert f"    {other}:3: Other: has 1 bytes, and the signal S is not" in shown.output
    load_deployment(file)


def test_sway_sensors_are_offered_and_watched_first(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    across, along = "GrappleSway.SwayPerpendicular", "GrappleSway.SwayParallel"
    # The second one is asked what it is too: an inclination, with a time constant.
    given = {
        "slew sensor": f"{across}\n",
        "near_far sensor": f"{across}\n{along}\ninclination\n1\n4",
    }
    result = init(file, given)
    assert result.exit_code == 0, result.output
    assert f"slew: sway sensor on the tool, such as {across}, {along}, " in result.output
    assert f"got '{across}'" in result.output  # it is that of slew
    assert "expected a number, 3.54 to 1000, got '1'" in result.output
    slew, near_far = (axis(file, name).sway_sensor for name in ("slew", "near_far"))
    assert (slew.message, slew.signal) == ("GrappleSway", "SwayPerpendicular")
    assert (slew.kind, slew.use, slew.timeout_ms) == ("angle", "watch", 80)
    assert (near_far.signal, near_far.kind, near_far.fusion_s) == (
        "SwayParallel",
        "inclination",
        4.0,
    )


def test_a_gyro_is_a_rate(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    dbc = str(ROOT / "dbc" / "sway-sensor.dbc")
    assert init(file, {"slew sensor": "SwayRate.Across"}, "--dbc", dbc).exit_code == 0
    assert axis(file, "slew").sway_sensor.kind == "rate"


def test_the_stopwatch_becomes_sway_data_and_a_filter(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    given = {"slew ten": "30", "slew first": "20", "slew last": "5", "slew speed": "2.5"}
    assert init(file, given).exit_code == 0
    sway = axis(file, "slew").sway
    assert sway.period_s == pytest.approx(3.0)
    assert (1 - sway.decay_per_swing) ** 10 == pytest.approx(0.25, rel=0.01)
    assert sway.full_speed_m_s == 2.5
    assert axis(file, "slew").filter.kind == "robust"
    assert load_deployment(file).config.control is not None


def test_without_the_tools_the_filter_is_one_to_begin_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(*_arguments: object, **_options: object) -> None:
        raise ModuleNotFoundError("No module named 'scipy.optimize'", name="scipy.optimize")

    monkeypatch.setattr("canshaper.commissioning.robust.design_robust", missing)
    file = tmp_path / "machine.yaml"
    result = init(file, {"slew ten": "30"})
    assert result.exit_code == 0, result.output
    what = f"{sys.executable} -m pip install canopen casadi matplotlib numpy scipy"
    assert f"no robust shaper yet, scipy is missing: {what}" in result.output
    assert f"canshaper robust {file} --axis near_far --write" in result.output
    poles = axis(file, "slew").filter.parameters()["poles_rad_s"]
    # The first step of the filter, 1 / (a2 w^2), is no more than what was asked.
    assert poles[0] * poles[1] / (2 * 3.14159265 / 3.0) ** 2 <= 1.0
    assert load_deployment(file).config.control is not None


def test_a_first_deployment_is_of_the_kind_that_is_recommended(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    assert init(file).exit_code == 0
    config = load_deployment(file).config
    shipped = load_deployment(ROOT / "config" / "forwarder-robust.yaml").config
    for name in ("slew", "near_far", "lift"):
        ours, theirs = config.axes[name], shipped.axes[name]
        assert ours.filter.kind == theirs.filter.kind
        assert ours.limits.reversal == theirs.limits.reversal
        assert (ours.slewing is None) == (theirs.slewing is None)
    assert config.motion == shipped.motion


def test_a_crane_that_no_axis_turns_has_no_motion(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    lines = answers({"slew turns": "n"}).splitlines()
    turned = QUESTIONS.index("slew turn speed")
    given = "\n".join(lines[:turned] + lines[turned + 2 : -2]) + "\n"
    result = CliRunner().invoke(app, ["init", str(file), "--dbc", str(DBC)], input=given)
    assert result.exit_code == 0, result.output
    config = load_deployment(file).config
    assert (config.axes["slew"].slewing, config.motion) == (None, {})


def test_a_wrong_answer_is_reported_and_asked_again(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    given = {
        "CAN interface": "can 0\ncan0",
        "Bit rate": "fast\n500000",
        "Messages of the joysticks": "Left\nJoystickLeft JoystickRight",
        "JoystickLeft: e": "Slew\nEnable",
        "JoystickLeft: r": "Enable\nReset",
        "Axis of JoystickLeft.Slew": "big slew\nnull\nturn",
        "Axis of JoystickLeft.NearFar": "turn\nnear_far",
        "slew valve": "Valve\nSlewCommand.Velocity",
        "slew timeout": "50\n300",
        "slew swings": "y",
        "slew turns": "y",
        "slew turn speed": "90\n2",
        "slew radius": "30\n10",
        "Axis that moves the tip": "turn\nnear_far",
        "Measured radius": "Radius\n-",
        "slew ten": "0\n2.1\n86\n20",
        "slew last": "21\n10",
    }
    result = init(file, given)
    assert result.exit_code == 0, result.output
    for reported in (
        "expected a whole number, 10000 to 1000000, got 'fast'",
        "expected some of JoystickLeft, JoystickRight, ",
        "got 'Left'",
        "expected one of Enable, AntiSwayOff, Reset, got 'Slew'",
        "expected a name without spaces, such as can0, got 'can 0'",
        "expected one of AntiSwayOff, Reset, -, got 'Enable'",
        "expected a word of letters, digits and _, other than true, false and null, got 'big slew'",
        "expected a word of letters, digits and _, other than true, false and null, got 'null'",
        "expected another one than turn, got 'turn'",
        "expected a number, 2.2 to 85.7, got '2.1'",
        "expected a number, 2.2 to 85.7, got '86'",
        "expected one of SlewCommand.Velocity, ",
        "expected a whole number, 60 to 5000, got '50'",
        "expected a number, 2.2 to 85.7, got '0'",
        "expected a number, 0.02 to 20, got '21'",
        "expected a number, 0.05 to 3, got '90'",
        "expected a number, 0.5 to 20, got '30'",
        "expected one of near_far, -, got 'turn'",
        "expected one of TipPosition.Radius, -, got 'Radius'",
    ):
        assert reported in result.output
    config = load_deployment(file).config
    assert config.buses["crane"].bitrate == 500_000
    assert config.axes["turn"].valve.timeout_ms == 300
    motion = config.motion["crane"]
    assert (motion.slew, motion.near_far, motion.radius) == ("turn", "near_far", None)


@pytest.mark.parametrize("seconds", ["2.2", "85.7"])
@pytest.mark.parametrize("channel", ["5", "true", "x'y", "a:b", "1e3", "größe"])
def test_every_answer_that_is_accepted_makes_a_good_file(
    tmp_path: Path, channel: str, seconds: str
) -> None:
    file = tmp_path / "machine.yaml"
    given = {"CAN interface": channel, "slew ten": seconds, "near_far ten": seconds}
    given |= {"slew turn speed": "3", "slew radius": "13.3"}
    result = init(file, given | {"near_far last": "20", "slew last": "0.02"})
    assert result.exit_code == 0, result.output
    assert load_deployment(file).config.buses["crane"].channel == channel
    assert axis(file, "slew").sway.period_s == pytest.approx(float(seconds) / 10)


def changed_dbc(tmp_path: Path, cycle_ms: int) -> Path:
    """The machine's DBC with another cycle of the slew valve."""
    old, new = (f'BA_ "GenMsgCycleTime" BO_ 512 {ms};' for ms in (20, cycle_ms))
    text = DBC.read_text(encoding="utf-8")
    assert old in text
    dbc = tmp_path / "1.dbc"
    dbc.write_text(text.replace(old, new), encoding="utf-8")
    return dbc


def test_a_slow_valve_takes_slow_swings_only(tmp_path: Path) -> None:
    file, dbc = tmp_path / "machine.yaml", changed_dbc(tmp_path, 200)
    given = answers({"slew ten": "19.7\n19.8", "slew timeout": "600"})
    result = CliRunner().invoke(app, ["init", str(file), "--dbc", str(dbc)], input=given)
    assert "expected a number, 19.8 to 85.7, got '19.7'" in result.output
    assert result.exit_code == 0, result.output
    assert axis(file, "slew").sway.period_s == 1.98
    # Adjusted as far as is written, a robust shaper could not run at this tick.
    assert "axis slew: no robust shaper yet:" in result.output
    assert (axis(file, "slew").filter.kind, axis(file, "near_far").filter.kind) == ("gff", "robust")


def test_what_is_found_at_the_end_leaves_a_draft_with_the_answers(tmp_path: Path) -> None:
    file, dbc = tmp_path / "machine.yaml", changed_dbc(tmp_path, 50)
    draft = tmp_path / "machine.draft.yaml"
    arguments = ["init", str(file), "--dbc", str(dbc)]
    given = answers({"CAN interface": "can7"})
    result = CliRunner().invoke(app, arguments, input=given)
    assert result.exit_code == 2
    reported = [line for line in result.output.splitlines() if str(tmp_path) in line][1:]
    assert "GenMsgCycleTime: expected a multiple of tick_ms, 20 ms, got 50 ms" in reported[0]
    assert reported[1:] == [f"{draft}: kept with all answers; fix it there and rename it to {file}"]
    assert not file.exists()
    again = CliRunner().invoke(app, arguments, input=given)
    assert (again.exit_code, f"{draft}: is there already" in again.output) == (2, True)
    draft.write_text(draft.read_text(encoding="utf-8").replace("tick_ms: 20", "tick_ms: 10"))
    assert load_deployment(draft).config.buses["crane"].channel == "can7"


def test_axes_and_switches_can_be_left_out(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    text = answers({"JoystickLeft: r": "-", "Axis of JoystickLeft.NearFar": "-"}).splitlines()
    dropped = QUESTIONS.index("near_far valve")
    lines = text[:dropped] + text[dropped + 8 :]
    arguments = ["init", str(file), "--dbc", str(DBC)]
    result = CliRunner().invoke(app, arguments, input="\n".join(lines) + "\n")
    assert result.exit_code == 0, result.output
    config = load_deployment(file).config
    assert list(config.axes) == ["slew", "lift"]
    assert not config.motion  # of one axis there is none
    assert config.joysticks["joystick_left"].reset is None


def test_a_file_that_is_there_stays(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    file.write_text("mine", encoding="utf-8")
    result = init(file)
    assert (result.exit_code, file.read_text(encoding="utf-8")) == (2, "mine")
    assert "--force" in result.output
    assert init(file, None, "--force").exit_code == 0
    assert load_deployment(file)


@pytest.mark.parametrize("folder", ["none", "file"])
def test_where_nothing_can_be_written_nothing_is_asked(tmp_path: Path, folder: str) -> None:
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    result = init(tmp_path / folder / "machine.yaml")
    assert result.exit_code == 2
    says = f"{tmp_path / folder}: expected a folder that can be written to"
    assert result.output.strip() == says


def test_answers_that_end_early_write_nothing(tmp_path: Path) -> None:
    arguments = ["init", str(tmp_path / "machine.yaml"), "--dbc", str(DBC)]
    result = CliRunner().invoke(app, arguments, input="n\n\n\n")
    assert result.exit_code == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (None, "none.dbc: No such file"),
        ("nonsense", "not a DBC file"),
        ('VERSION ""\nBO_ 1 Status: 8 ECU\n SG_ A : 0|2@1+ (1,0) [0|1] "" ECU\n', "no message has"),
        ('VERSION ""\nBO_ 1 S: 1 E\n SG_ A : 0|9@1+ (1,0) [0|1] "" E\n', "can be used"),
    ],
)
def test_a_dbc_that_will_not_do(tmp_path: Path, content: str | None, why: str) -> None:
    dbc = tmp_path / "none.dbc"
    if content is not None:
        dbc.write_text(content, encoding="utf-8")
    result = CliRunner().invoke(app, ["init", str(tmp_path / "m.yaml"), "--dbc", str(dbc)])
    assert result.exit_code == 2
    assert why in result.output
    assert not (tmp_path / "m.yaml").exists()
    assert "Traceback" not in result.output


def with_answers(folder: Path, text: str) -> Result:
    """Nothing is typed: a question would end it."""
    (folder / "answers.txt").write_text(text, "utf-8", "surrogateescape")
    words = ["init", str(folder / "machine.yaml"), "--dbc", str(DBC)]
    words += ["--answers", str(folder / "answers.txt")]
    return CliRunner().invoke(app, words, input="", prog_name="canshaper")


def test_answers_out_of_a_file_give_the_same_machine_as_typed_ones(tmp_path: Path) -> None:
    typed, filed = tmp_path / "typed", tmp_path / "filed"
    typed.mkdir()
    filed.mkdir()
    init(
        typed / "machine.yaml",
        {"CAN interface": "can7", "near_far ten": "25.5", "lift swings": "n"},
    )
    result = with_answers(
        filed,
        """\ufeff# of the machine
CAN interface = can7     # the second plug
near_far: time of ten = 25.5
lift: does it make the grapple swing = no
""",
    )
    assert result.exit_code == 0, result.output
    assert (filed / "machine.yaml").read_text() == (typed / "machine.yaml").read_text()
    assert axis(filed / "machine.yaml", "near_far").sway.period_s == pytest.approx(2.55)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("\nBit rate = fast", "answers.txt:2: Bit rate: expected a whole number"),
        ("slew: does it make = perhaps", "slew: does it make: expected one of yes, no"),
        ("Bit rates = 500000", "answers.txt:1: Bit rates: expected a question of this command"),
        (
            "Bit rate = 500000\nBit rate = 250000",
            "answers.txt:2: Bit rate: expected a question of this command, once",
        ),
        ("\nBit rate = \udcff", "answers.txt:2: expected UTF-8, got the byte 0xFF"),
        ("just words", "answers.txt:1: expected QUESTION = ANSWER, got 'just words'"),
    ],
)
def test_answers_that_are_wrong_are_named_with_their_line_and_nothing_is_written(
    tmp_path: Path, text: str, fault: str
) -> None:
    result = with_answers(tmp_path, text)
    assert result.exit_code == 2
    assert fault in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["answers.txt"]


BARE = """VERSION ""

BU_: A B

BO_ 256 Stick: 4 A
 SG_ X : 0|8@1- (1,0) [0|0] "" B
 SG_ Y : 8|8@1- (1,0) [-100|90] "" B

BO_ 257 Panel: 1 A
 SG_ Enable : 0|1@1+ (1,0) [0|0] "" B

BO_ 512 Boom: 2 B
 SG_ Flow : 0|16@1- (1,0) [0|0] "" A
"""


def test_what_the_dbc_does_not_say_is_asked(tmp_path: Path) -> None:
    dbc, file = tmp_path / "bare.dbc", tmp_path / "machine.yaml"
    dbc.write_text(BARE, encoding="cp1252")
    replies = [
        "",
        "",
        "Stick",
        "10",
        "",
        "",
        "",
        "boom",
        "Boom.Flow",
        "20",
        "100",
        "y",
        "1000",
        "",
        "",
        "n",
        "-",
    ]
    result = CliRunner().invoke(
        app, ["init", str(file), "--dbc", str(dbc)], input="\n".join(replies) + "\n" * 20
    )
    assert result.exit_code == 0, result.output
    for question in (
        "Messages of the joysticks, such as Stick, Boom",
        "Stick: period in ms, which the DBC does not say",
        "Stick: enable switch, such as Panel.Enable",
        "Boom: period in ms, which the DBC does not say",
        "X: its value at full",
        "Flow: its value at full",
    ):
        assert question in result.output
    deployment = load_deployment(file)
    joystick = deployment.config.joysticks["stick"]
    assert (joystick.cycle_ms, joystick.enable) == (10, ["stick_enable"])
    assert deployment.config.switches["stick_enable"].message == "Panel"
    axis = deployment.config.axes["boom"]
    assert (axis.command.full, axis.valve.full, axis.valve.cycle_ms) == (100.0, 1000.0, 20)
    assert (axis.command.invert, axis.valve.invert) == (True, False)


def test_without_any_switch_there_is_no_joystick(tmp_path: Path) -> None:
    dbc = tmp_path / "bare.dbc"
    dbc.write_text(BARE.replace("Enable : 0|1", "Level : 0|8"), encoding="cp1252")
    result = CliRunner().invoke(
        app, ["init", str(tmp_path / "machine.yaml"), "--dbc", str(dbc)], input="\n" * 10
    )
    assert result.exit_code == 2
    says = "no message has a signal of one or two bits, or with named values (VAL_), which could be"
    assert says in result.output


MODES = {
    "Inactive": 'VAL_ 257 Mode 0 "Off" 2 "Inactive" 3 "Crane active" 15 "Error" ;\n',
    "several": 'VAL_ 257 Mode 0 "Off" 3 "Active" 4 "Ready" ;\n',
}


@pytest.mark.parametrize(("names", "reply", "code"), [("Inactive", "", 3), ("several", "4", 4)])
def test_a_state_of_another_ecu_may_enable_by_one_of_its_named_values(
    tmp_path: Path, names: str, reply: str, code: int
) -> None:
    """The one that says so is offered; where several do there is no default."""
    dbc, file = tmp_path / "bare.dbc", tmp_path / "machine.yaml"
    text = BARE.replace("Enable : 0|1", "Mode : 0|4") + MODES[names]
    dbc.write_text(text, encoding="cp1252")
    replies = ["", "", "", "Stick", "10", "Panel.Mode", reply, "", ""]
    replies += ["boom", "Boom.Flow", "20", "100", "y", "1000", "", "", "n", "-"]
    if names == "several":
        replies.insert(6, "")  # no answer is none
    result = CliRunner().invoke(
        app, ["init", str(file), "--dbc", str(dbc)], input="\n".join(replies) + "\n" * 20
    )
    assert result.exit_code == 0, result.output
    assert "Mode: value that enables, of 0 Off, " in result.output
    switch = load_deployment(file).config.switches["stick_enable"]
    assert (switch.message, switch.signal, switch.code) == ("Panel", "Mode", code)


def of_dbc(folder: Path, dbc: Sequence[Path], answers: str) -> Result:
    (folder / "answers.txt").write_text(answers)
    words = ["init", str(folder / "machine.yaml"), "--answers", str(folder / "answers.txt")]
    words += [word for path in dbc for word in ("--dbc", str(path))]
    return CliRunner().invoke(app, words, input="", prog_name="canshaper")


ECU = """
Messages of the joysticks = CabLeft CabRight
CabLeft: value of Page = 1
CabRight: enable switch = cab_left
Axis of CabLeft.Slew = slew
Slew: its value in the middle = 1024
Slew: its value at full = 1000
slew: valve command = EcuSlew.Flow
Flow: its value in the middle = 128
Flow: its value at full = 125
Flow: does it count = yes
Axis of CabLeft.NearFar = near_far
NearFar: its value at full = 1000
near_far: valve command = EcuNearFar.Flow
Flow: its value at full = 125
Axis of CabRight.Lift = lift
Lift: its value at full = 1000
lift: valve command = EcuLift.Flow
Flow: its value at full = 125
"""


def test_a_machine_of_offsets_and_pages_without_ranges_or_cycles(tmp_path: Path) -> None:
    """The shipped ecu.dbc, whose DBC says least; what the shipped deployment has is asked."""
    result = of_dbc(tmp_path, [ROOT / "dbc" / "ecu.dbc", DBC], ECU)
    assert result.exit_code == 0, result.output
    config = load_deployment(tmp_path / "machine.yaml").config
    left, right = config.joysticks["cab_left"], config.joysticks["cab_right"]
    assert (left.multiplexor, left.cycle_ms, left.enable) == (1, 20, ["Enable"])
    assert (right.enable, right.enable_of) == (None, "cab_left")
    shipped = load_deployment(ROOT / "config" / "ecu-forwarder.yaml").config
    for name in ("slew", "near_far", "lift"):
        ours, theirs = config.axes[name], shipped.axes[name]
        assert (ours.command.full, ours.command.zero) == (theirs.command.full, theirs.command.zero)
        assert (ours.valve.full, ours.valve.zero) == (theirs.valve.full, theirs.valve.zero)
    assert [config.axes[name].valve.invert for name in ("slew", "lift")] == [True, False]


FLAGS = """VERSION ""

BU_: A B

BO_ 256 Stick: 4 A
 SG_ XNeutral : 0|2@1+ (1,0) [0|3] "" B
 SG_ XLeft : 2|2@1+ (1,0) [0|3] "" B
 SG_ XRight : 4|2@1+ (1,0) [0|3] "" B
 SG_ X : 6|10@1+ (0.1,0) [0|100] "%" B
 SG_ Enable : 16|2@1+ (1,0) [0|3] "" B
 SG_ In : 18|6@1+ (1,0) [0|0] "" B
 SG_ Out : 24|6@1+ (1,0) [0|0] "" B

BO_ 512 Boom: 2 B
 SG_ Flow : 0|16@1- (1,0) [-1000|1000] "" A

BO_ 513 Arm: 2 B
 SG_ Flow : 0|16@1- (1,0) [-1000|1000] "" A

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 20;
"""
WITH_FLAGS = """
Messages of the joysticks = Stick
Stick: enable switch = Enable
Axis of Stick.X = boom
boom: valve command = Boom.Flow
Axis of Stick.In = arm
In: direction = second
In: the signal of the other direction = Out
In: its value at full = 60
arm: valve command = Arm.Flow
"""


def test_a_magnitude_with_flags_and_a_rocker_of_two_signals(tmp_path: Path) -> None:
    dbc = tmp_path / "flags.dbc"
    dbc.write_text(FLAGS, encoding="cp1252")
    result = of_dbc(tmp_path, [dbc], WITH_FLAGS)
    assert result.exit_code == 0, result.output
    boom, arm = (load_deployment(tmp_path / "machine.yaml").config.axes[n] for n in ("boom", "arm"))
    assert boom.command.flags is not None
    assert boom.command.flags.model_dump() == {
        "neutral": "XNeutral",
        "negative": "XLeft",
        "positive": "XRight",
    }
    assert (arm.command.negative, arm.command.full, boom.command.full) == ("Out", 60, None)


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        ("X: flags = XNeutral XLeft XLeft", "X: flags: expected three of XNeutral, XLeft, XRight,"),
        ("X: direction = flag", "X: direction: expected one of middle, flags, second, got 'flag'"),
        ("In: the signal = In", "In: the signal: expected one of X, Out, got 'In'"),
    ],
)
def test_wrong_directions_are_named(answer: str, fault: str, tmp_path: Path) -> None:
    dbc = tmp_path / "flags.dbc"
    dbc.write_text(FLAGS, encoding="cp1252")
    key = answer.partition(" =")[0]
    others = "\n".join(line for line in WITH_FLAGS.splitlines() if not line.startswith(key))
    result = of_dbc(tmp_path, [dbc], f"{answer}\n{others}")
    assert result.exit_code == 2
    assert fault in result.output


@pytest.mark.parametrize(
    "bits", ["0|8@1- (1,0) [0|0]", "0|8@1- (0.5,0) [-3|120]", "0|9@1+ (1,-9) [-9|9]"]
)
@pytest.mark.parametrize("cycle", [0, 5000])
def test_every_two_sided_signal_is_a_candidate(bits: str, cycle: int, tmp_path: Path) -> None:
    """Whatever its range or cycle, and next to messages that the DBC describes well."""
    from canshaper.machine.database import load_dbc

    dbc = tmp_path / "one.dbc"
    dbc.write_text(
        FLAGS.replace('DEF_DEF_ "GenMsgCycleTime" 20', f'DEF_DEF_ "GenMsgCycleTime" {cycle}')
        + f'\nBO_ 700 Other: 8 A\n SG_ Odd : {bits} "" B\n'
    )
    file, problems = load_dbc(dbc)
    assert file is not None
    assert not problems
    assert "Other" in [m.name for m in suggest.joysticks(file.messages)]
    (other,) = (m for m in file.messages if m.name == "Other")
    assert [s.name for s in suggest.velocities(other)] == ["Odd"]


def signal_of(text: str) -> Signal:
    dbc = f'VERSION ""\n\nBO_ 1 M: 8 A\n SG_ S : {text} "" A\n'
    return load_string(dbc).messages[0].signals[0]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("text", "full", "middle"),
    [
        ("0|8@1- (1,0) [0|0]", 127.0, None),
        ("0|12@1- (0.03125,0) [-1024|1023]", 63.96875, None),  # a range beyond the bits
        ("0|8@1+ (0.75,-48) [-48|143]", 48.0, None),
        ("0|8@1- (0.5,0) [-3|120]", 3.0, None),
        ("0|11@1+ (1,0) [0|0]", 1023.0, 1024.0),
        ("0|8@1+ (0.4,0) [0|100]", 50.0, 50.0),
        ("0|4@1+ (1,0) [-7|7]", 3.0, 4.0),  # its bits go one way only
        ("0|32@1- (0.1,0) [0|0]", 214748364.7, None),
    ],
)
def test_what_is_proposed_is_within_the_bits(text: str, full: float, middle: float | None) -> None:
    signal = signal_of(text)
    assert suggest.two_sided(signal) == (middle is None)
    assert suggest.likely_full(signal, middle or 0.0) == pytest.approx(full, rel=1e-12)
    if middle is not None:
        assert suggest.likely_middle(signal) == pytest.approx(middle)


def test_a_message_with_too_few_steps_or_the_switch_of_a_joystick_is_no_valve(
    tmp_path: Path,
) -> None:
    dbc = tmp_path / "bare.dbc"
    coarse = '\nBO_ 513 Coarse: 1 B\n SG_ Step : 0|4@1- (1,0) [0|0] "" A\n'
    panel = ' SG_ Enable : 0|1@1+ (1,0) [0|0] "" B\n SG_ Lamp : 1|7@1- (1,0) [0|0] "" B\n'
    text = BARE.replace(BARE[BARE.index(" SG_ Enable") : BARE.index("\nBO_ 512")], panel)
    dbc.write_text(text + coarse, encoding="cp1252")
    answers = "Messages of the joysticks = Stick\nAxis of Stick.X = boom\nboom: valve command = "
    result = of_dbc(tmp_path, [dbc], f"{answers}Coarse.Step\n")
    assert "boom: valve command: expected one of Boom.Flow, -, got 'Coarse.Step'" in result.output
    result = of_dbc(tmp_path, [dbc], f"{answers}Boom.Flow\nAxis of Stick.Y = -\n")
    assert result.exit_code == 0, result.output


def test_one_enter_takes_the_whole_proposal(tmp_path: Path) -> None:
    """It is shown first, and gives the machine of Enter for each question."""
    whole, each = tmp_path / "whole.yaml", tmp_path / "each.yaml"
    result = CliRunner().invoke(app, ["init", str(whole), "--dbc", str(DBC)], input="\n")
    assert result.exit_code == 0, result.output
    shown = [" ".join(line.split()) for line in result.output.splitlines()]
    for row in (
        "JoystickLeft: enable switch Enable",
        "Axis of JoystickLeft.Slew slew",
        "time of ten full swings, s 23.6",
        "rotate: valve command none",
        "Measured radius of the tip TipPosition.Radius",
    ):
        assert row in shown
    assert init(each).exit_code == 0
    assert whole.read_text() == each.read_text()


def test_what_has_no_proposal_is_asked_at_once(tmp_path: Path) -> None:
    dbc = tmp_path / "bare.dbc"
    dbc.write_text(BARE, encoding="cp1252")
    words = ["init", str(tmp_path / "machine.yaml"), "--dbc", str(dbc)]
    result = CliRunner().invoke(app, words, input="can7\n")
    assert result.output.splitlines()[1].startswith("CAN interface [can0]:")
    assert "Is all of it right" not in result.output
