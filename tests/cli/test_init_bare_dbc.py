"""``canshaper init`` on DBC files that say little: what is asked instead."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine.binding import load_deployment
from tests.cli.init_script import BARE, DBC, of_dbc
from tests.rigs.files import ROOT


def test_what_the_dbc_does_not_say_is_asked(tmp_path: Path) -> None:
    dbc, file = tmp_path / "bare.dbc", tmp_path / "machine.yaml"
    dbc.write_text(BARE, encoding="cp1252")
    replies = [
        "",
        "",
        "Stick",
        "10",
        "",
        "100",
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
        "Messages of the joysticks, such as Stick",
        "Stick: period in ms, which the DBC does not say",
        "Stick: enable switch, such as Panel.Enable",
        "Panel: period in ms, which the DBC does not say",
        "Boom: period in ms, which the DBC does not say",
        "X: its value at full",
        "Flow: its value at full",
    ):
        assert question in result.output
    deployment = load_deployment(file)
    joystick = deployment.config.joysticks["stick"]
    assert (joystick.cycle_ms, joystick.enable) == (10, ["stick_enable"])
    switch = deployment.config.switches["stick_enable"]
    assert (switch.message, switch.cycle_ms, switch.timeout_ms) == ("Panel", 100, 500)
    axis = deployment.config.axes["boom"]
    assert (axis.command.full, axis.valve.full, axis.valve.cycle_ms) == (100.0, 1000.0, 20)
    assert (axis.command.invert, axis.valve.invert) == (True, False)


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
    replies = ["", "", "", "Stick", "10", "Panel.Mode", reply, "", "", ""]
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
Flow: is this signal reversed = yes
Axis of CabLeft.NearFar = near_far
NearFar: its value at full = 1000
near_far: valve command = EcuNearFar.Flow
Flow: its value at full = 125
Axis of CabRight.Lift = lift
Lift: its value at full = 1000
lift: valve command = EcuLift.Flow
Flow: its value at full = 125
"""


@pytest.mark.slow
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


def test_what_has_no_proposal_is_asked_at_once(tmp_path: Path) -> None:
    dbc = tmp_path / "bare.dbc"
    dbc.write_text(BARE, encoding="cp1252")
    words = ["init", str(tmp_path / "machine.yaml"), "--dbc", str(dbc)]
    result = CliRunner().invoke(app, words, input="can7\n")
    assert result.output.splitlines()[1].startswith("CAN interface [can0]:")
    assert "Is all of it right" not in result.output
