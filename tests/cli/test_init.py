"""``canshaper init``: questions answered by a script, and the file that comes of it."""

import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine.binding import load_deployment
from tests.cli.init_script import DBC, QUESTIONS, answers, changed_dbc, init, with_answers
from tests.rigs.files import ROOT


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


@pytest.mark.slow
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


# Of the status of an axis, of the service, of the identity; and the radius of the tip.
@pytest.mark.parametrize("can_id", [768, 784, 785, 1025])
def test_a_message_that_is_no_command_makes_the_bus_one_of_can_fd(
    can_id: int, tmp_path: Path
) -> None:
    text = DBC.read_text(encoding="utf-8")
    kinds = ",".join(f'"{number}"' for number in range(14)) + ',"StandardCAN_FD"'
    for line, more in (
        ("BA_DEF_ BO_", f'BA_DEF_ BO_ "VFrameFormat" ENUM {kinds};'),
        ("BA_DEF_DEF_", 'BA_DEF_DEF_ "VFrameFormat" "0";'),
        ("BA_ ", f'BA_ "VFrameFormat" BO_ {can_id} 14;'),
    ):
        text = text.replace(f"\n{line}", f"\n{more}\n{line}", 1)
    dbc, file = tmp_path / "1.dbc", tmp_path / "machine.yaml"
    dbc.write_text(text, encoding="utf-8")
    arguments = ["init", str(file), "--dbc", str(dbc)]
    result = CliRunner().invoke(app, arguments, input="\n" * 60, prog_name="canshaper")
    assert result.exit_code == 0, result.output
    assert "message: TipPosition, signal: Radius" in file.read_text(encoding="utf-8")
    assert load_deployment(file).config.buses["crane"].data_bitrate == 2_000_000


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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
    assert config.motion == {}, "not on the first day"
    file.write_text(file.read_text().replace("    waits: true\n", ""))
    crane = shipped.motion["crane"].model_copy(update={"aim": None})  # a display's; not asked for
    assert load_deployment(file).config.motion == {"crane": crane}


@pytest.mark.slow
def test_a_crane_that_no_axis_turns_has_no_motion(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    lines = answers({"slew turns": "n"}).splitlines()
    turned = QUESTIONS.index("slew turn speed")
    given = "\n".join(lines[:turned] + lines[turned + 2 : -2]) + "\n"
    result = CliRunner().invoke(app, ["init", str(file), "--dbc", str(DBC)], input=given)
    assert result.exit_code == 0, result.output
    config = load_deployment(file).config
    assert (config.axes["slew"].slewing, config.motion) == (None, {})


@pytest.mark.slow
@pytest.mark.parametrize("seconds", ["2.2", "178.5"])
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


def test_a_slow_valve_takes_slow_swings_only(tmp_path: Path) -> None:
    file, dbc = tmp_path / "machine.yaml", changed_dbc(tmp_path, 200)
    given = answers({"slew ten": "19.7\n19.8", "slew timeout": "600"})
    result = CliRunner().invoke(app, ["init", str(file), "--dbc", str(dbc)], input=given)
    assert "expected a number, 19.8 to 178.5, got '19.7'" in result.output
    assert result.exit_code == 0, result.output
    assert axis(file, "slew").sway.period_s == 1.98
    # Adjusted as far as is written, a robust shaper could not run at this tick.
    assert "axis slew: no robust shaper yet:" in result.output
    assert (axis(file, "slew").filter.kind, axis(file, "near_far").filter.kind) == ("gff", "robust")


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


@pytest.mark.slow
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
