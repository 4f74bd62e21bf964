"""``canshaper init`` where the dead man's switch is no signal of its own, or axes have no sign."""

from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from tests.cli.init_script import of_dbc

MACHINE = """VERSION ""
BU_: CAB PC VALVES
BO_ 256 Cab: 8 CAB
 SG_ Slew : 0|8@1{sign} PC
{switch}
BO_ 512 SlewValve: 2 PC
 SG_ Velocity : 0|8@1- (0.8,0) [-100|100] "%" VALVES

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 20;
"""
SIGNED, UNSIGNED = '- (1,0) [-100|100] "%"', '+ (1,0) [0|255] ""'
BYTE = ' SG_ Deadman : 8|8@1+ (1,0) [0|0] "" PC\n'
BUTTONS = ' SG_ Buttons : 8|8@1+ (1,0) [0|0] "" PC\n'
BIT = ' SG_ Deadman : 8|1@1- (1,0) [0|0] "" PC\n'
OTHER = '\nBO_ 257 Panel: 1 CAB\n SG_ Keys : 7|8@0+ (1,0) [0|0] "" PC\n'
ONE = ' SG_ Deadman : 8|1@1+ (1,0) [0|1] "" PC\n'


def made(folder: Path, switch: str, sign: str = SIGNED) -> Path:
    dbc = folder / "cab.dbc"
    dbc.write_text(MACHINE.format(switch=switch, sign=sign), encoding="cp1252")
    return dbc


@pytest.mark.parametrize(
    ("switch", "answer", "enable", "held"),
    [
        (BYTE, "", "Deadman", b"\0\1"),
        (BYTE, "Deadman/7", "Deadman/7", b"\0\x80"),
        (BUTTONS, "Buttons/3", "Buttons/3", b"\0\x08"),
        (BIT, "", "Deadman/0", b"\0\1"),
    ],
)
def test_a_part_of_a_signal_may_enable(
    tmp_path: Path, switch: str, answer: str, enable: str, held: bytes
) -> None:
    text = f"Cab: enable switch = {answer}\n" if answer else ""
    result = of_dbc(tmp_path, [made(tmp_path, switch)], text)
    assert result.exit_code == 0, result.output
    joystick = load_deployment(tmp_path / "machine.yaml").joysticks["cab"]
    assert joystick.config.enable == [enable]
    assert joystick.decode(held.ljust(8, b"\0"))[0][enable] == 1
    assert joystick.decode(bytes(8))[0][enable] == 0


def test_a_bit_of_another_message_may_enable(tmp_path: Path) -> None:
    answers = "Cab: enable switch = Panel.Keys/2\n"
    result = of_dbc(tmp_path, [made(tmp_path, OTHER)], answers)
    assert result.exit_code == 0, result.output
    (switches,) = load_deployment(tmp_path / "machine.yaml").switches
    assert switches.switches == {"cab_enable": ("Keys/2", 1)}
    assert switches.layout.decode(b"\x04") == {"Keys/2": 1}


@pytest.mark.parametrize("cab_ms", [20, 0])
def test_a_switch_elsewhere_has_the_cycle_of_its_own_message(tmp_path: Path, cab_ms: int) -> None:
    dbc = made(tmp_path, OTHER)
    cycles = 'BA_ "GenMsgCycleTime" BO_ 256 {};\nBA_ "GenMsgCycleTime" BO_ 257 100;\n'
    dbc.write_text(dbc.read_text() + cycles.format(cab_ms))
    answers = "Cab: enable switch = Panel.Keys/2\n" + "Cab: period = 20\n" * (not cab_ms)
    result = of_dbc(tmp_path, [dbc], answers)
    assert result.exit_code == 0, result.output
    config = load_deployment(tmp_path / "machine.yaml").config
    cab, panel = config.joysticks["cab"], config.switches["cab_enable"]
    assert (cab.cycle_ms, cab.timeout_ms) == (None if cab_ms else 20, 100)
    assert (panel.cycle_ms, panel.timeout_ms) == (None, 500)


@pytest.mark.parametrize("right", ["Panel.Keys/3", "cab"])
def test_stop_distances_count_on_a_slow_switch_whose_period_is_asked_once(
    tmp_path: Path, right: str
) -> None:
    second = '\nBO_ 258 Right: 8 CAB\n SG_ NearFar : 0|8@1- (1,0) [-100|100] "%" PC\n'
    second += '\nBO_ 513 NearFarValve: 2 PC\n SG_ V : 0|8@1- (0.8,0) [-100|100] "%" VALVES\n'
    text = made(tmp_path, OTHER).read_text().replace("\nBA_DEF_ ", f"{second}\nBA_DEF_ ", 1)
    distances: list[list[float]] = []
    for panel_ms in (20, 200):
        (folder := tmp_path / str(panel_ms)).mkdir()
        (dbc := folder / "cab.dbc").write_text(text + 'BA_ "GenMsgCycleTime" BO_ 257 0;\n')
        answers = f"Messages of the joysticks = Cab Right\nPanel: period = {panel_ms}\n"
        answers += f"Cab: enable switch = Panel.Keys/2\nRight: enable switch = {right}\n"
        assert of_dbc(folder, [dbc], answers).exit_code == 0
        config = load_deployment(folder / "machine.yaml").config
        times = {(one.cycle_ms, one.timeout_ms) for one in config.switches.values()}
        assert times == {(panel_ms, 5 * panel_ms)}
        distances += [[one.limits.stop_distance_m or 0.0 for one in config.axes.values()]]
    assert [len(one) for one in distances] == [2, 2]
    assert all(fast < slow for fast, slow in zip(*distances, strict=True))


@pytest.mark.parametrize(("switch", "answer"), [("", ""), (BUTTONS, "-"), (OTHER, "-")])
def test_without_a_switch_a_draft_names_the_ways_out(
    tmp_path: Path, switch: str, answer: str
) -> None:
    text = f"Cab: enable switch = {answer}\n" if answer else ""
    result = of_dbc(tmp_path, [made(tmp_path, switch)], text)
    assert result.exit_code == 2
    for way in ("enable: SIGNAL, or SIGNAL/BIT", "a section in switches", "enable_of"):
        assert way in result.output
    assert (tmp_path / "machine.draft.yaml").exists()
    assert not (tmp_path / "machine.yaml").exists()


def test_a_switch_that_is_turned_round_is_not_proposed(tmp_path: Path) -> None:
    dbc = made(tmp_path, ONE.replace("Deadman", "Grip") + ONE.replace("8|1", "9|1"))
    dbc.write_text(dbc.read_text() + 'VAL_ 256 Deadman 0 "Pressed" 1 "Released" ;\n')
    result = of_dbc(tmp_path, [dbc], "")
    assert result.exit_code == 2
    assert "Cab: enable switch, of Grip, Deadman, -: expected one of" in result.output
    result = of_dbc(tmp_path, [dbc], "Cab: enable switch = Deadman\n")
    assert 'it would enable while "Released"' in result.output


def test_axes_without_a_sign_are_the_joystick_all_the_same(tmp_path: Path) -> None:
    result = of_dbc(tmp_path, [made(tmp_path, ONE, UNSIGNED)], "Axis of Cab.Slew = slew\n")
    assert result.exit_code == 0, result.output
    config = load_deployment(tmp_path / "machine.yaml").config
    assert config.joysticks["cab"].message == "Cab"
    assert config.axes["slew"].valve.message == "SlewValve"


def test_what_has_no_word_in_common_is_not_proposed(tmp_path: Path) -> None:
    dbc = made(tmp_path, ONE)
    text = dbc.read_text().replace("SG_ Slew", "SG_ STEER_RATE").replace("SlewValve", "STEER2")
    dbc.write_text(text)
    assert "no axis has a valve command" in of_dbc(tmp_path, [dbc], "").output
    answers = "steer_rate: valve command = STEER2.Velocity\n"
    assert of_dbc(tmp_path, [dbc], answers).exit_code == 0


def test_guesses_are_assumed_until_someone_says_otherwise(tmp_path: Path) -> None:
    dbc = made(tmp_path, ONE)
    answers = "slew: silence = 300\nslew: speed at full = 0.4\nslew: largest = 8\n"
    result = of_dbc(tmp_path, [dbc], answers)
    assert result.exit_code == 0, result.output
    keys = [f"axes.slew.sway.{key}" for key in ("period_s", "decay_per_swing", "full_speed_m_s")]
    keys.append("axes.slew.limits.stop_distance_m")
    assert f"Assumed until someone measures or types them: {', '.join(keys)}." in result.output
    assert load_deployment(tmp_path / "machine.yaml").config.assumed == keys


def test_bits_of_one_byte_are_switches_of_their_own(tmp_path: Path) -> None:
    answers = "Cab: enable switch = Buttons/3\nCab: switch that resets = Buttons/4\n"
    result = of_dbc(tmp_path, [made(tmp_path, BUTTONS)], answers)
    assert result.exit_code == 0, result.output
    joystick = load_deployment(tmp_path / "machine.yaml").joysticks["cab"].config
    assert (joystick.enable, joystick.reset) == (["Buttons/3"], "Buttons/4")
