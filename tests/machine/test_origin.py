"""Values measured on a simulated crane are reported by check, and move no valve of a machine."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.commissioning.origins import is_simulated
from canshaper.config.bus import Bus
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.cli.invocation import invoke
from tests.rigs.files import ROOT, line_of, text_of

MADE = "date: 2026-11-23, by: canshaper calibrate 0.1.0, source:"
CURVE = "curve_command_pct: [-100, -5, 5, 100], curve_speed_pct: [-100, 0, 0, 100]"


def machine(tmp_path: Path, *, curve: str = "", sway: str = "", channel: str = "can0") -> Path:
    """The shipped machine with origins."""
    text = text_of("forwarder").replace("vcan0", channel)
    if curve:
        new = f"limits: {{ {CURVE}, curve_origin: {{ {MADE} {curve} }}"
        text = text.replace("limits: { deadband_pct: 5", new, 1)
    if sway:
        text = text.replace("full_speed_m_s: 1.5 }", f"full_speed_m_s: 1.5, origin: {sway} }}", 1)
    file = tmp_path / "machine.yaml"
    file.write_text(text)
    return file


def test_check_warns_of_each_section_of_a_simulated_crane(tmp_path: Path) -> None:
    file = machine(tmp_path, curve="simulated", sway=f"{{ {MADE} simulated }}")
    warnings = [w for w in invoke("check", file).stdout.splitlines() if "simulated" in w]
    text = "measured on a simulated crane; measure it on the machine"
    assert warnings == [
        f"WARNING: {file}:{line_of(file, 'full_speed_m_s: 1.5')}: axes.slew.sway.origin: {text}",
        f"WARNING: {file}:{line_of(file, 'curve_origin')}: axes.slew.limits.curve_origin: {text}",
    ]


@pytest.mark.parametrize("sway", [f"{{ {MADE} machine }}", f"{{ {MADE.rpartition(',')[0]} }}"])
def test_check_says_nothing_of_a_machine(tmp_path: Path, sway: str) -> None:
    assert "simulated" not in invoke("check", machine(tmp_path, sway=sway)).output


def test_run_refuses_a_simulated_valve_on_a_real_bus(tmp_path: Path) -> None:
    file = machine(tmp_path, curve="simulated", channel="none0")
    result = invoke("run", file)
    assert result.exit_code == 2
    assert result.stderr.startswith(
        f"{file}:{line_of(file, 'curve_origin')}: axes.slew.limits.curve_origin: expected a valve"
        " measured on the machine, got one of a simulated crane, on socketcan none0; canshaper"
        " calibrate --live measures it, canshaper run --simulated takes it as it is\n"
    )
    for option in ("--simulated", "--listen-only"):
        assert invoke("run", file, option).exit_code == 3  # there is no such bus


@pytest.mark.parametrize("words", [("--channel", "vcan99"), ("--interface", "no_such_interface")])
def test_the_bus_of_the_command_line_counts(tmp_path: Path, words: tuple[str, str]) -> None:
    file = machine(tmp_path, curve="simulated", channel="none0")
    assert ("curve_origin" in invoke("run", file, *words).output) == (words[0] == "--interface")


def test_run_takes_a_simulated_swing_and_a_valve_of_the_machine(tmp_path: Path) -> None:
    file = machine(tmp_path, curve="machine", sway=f"{{ {MADE} simulated }}", channel="none0")
    assert invoke("run", file).exit_code == 3


@pytest.mark.parametrize(
    ("interface", "channel", "virtual"),
    [
        ("socketcan", "can0", False),
        ("socketcan", "vcan0", True),
        ("socketcan", "vxcan1", True),
        ("pcan", "vcan0", False),
        ("virtual", "can0", True),
        ("udp_multicast", "239.74.163.2", True),
    ],
)
def test_which_bus_can_be_of_a_machine(interface: str, channel: str, virtual: bool) -> None:
    assert Bus(interface=interface, channel=channel).is_virtual == virtual


def test_a_day_that_is_none_and_an_origin_without_a_curve(tmp_path: Path) -> None:
    file = machine(tmp_path, sway="{ date: 2026-13-01, by: me }")
    with pytest.raises(ConfigError, match=re.escape("expected one such as 2026-11-23, got")):
        load_deployment(file)
    file = machine(tmp_path, curve="machine")
    file.write_text(file.read_text().replace(CURVE + ", ", ""))
    with pytest.raises(ConfigError, match="curve_origin: expected a curve with it, got none"):
        load_deployment(file)


@pytest.mark.parametrize(
    ("file", "own", "line", "simulated"),
    [
        ("forwarder", "GrappleSway", "(1.000000) can0 123#00", False),
        ("forwarder", "GrappleSway", "(1.000000) vcan0 123#00", True),
        ("forwarder", "GrappleSway", "(1.000000) 239.74.163.2 123#00", True),
        ("forwarder", "GrappleSway", "(1.000000) can0 {own:03X}#0000000000000000", True),
        ("bridge-crane", "LoadSway", "(1.000000) can0 {own:03X}#0000000000000000", True),
    ],
)
def test_logs_of_a_simulated_crane(
    tmp_path: Path, file: str, own: str, line: str, simulated: bool
) -> None:
    messages = load_deployment(ROOT / "config" / f"{file}.yaml").messages
    sway = messages.find(own)
    assert not isinstance(sway, str)
    log = tmp_path / "drive.log"
    log.write_text(line.format(own=sway[1].frame_id) + "\n")
    assert is_simulated(log, messages) == simulated
    table = tmp_path / "gyro.csv"
    table.write_text("time,x\n0,1\n")
    assert not is_simulated(table, messages)


def test_a_reload_refuses_what_a_start_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loads: list[Callable[[], Deployment]] = []

    class Running:
        def __init__(self, load: Callable[[], Deployment], _folder: Path | None) -> None:
            loads.append(load)

        def run(self) -> None:
            """Nothing: the file is read again by the test."""

    monkeypatch.setattr("canshaper.daemon.daemon.Daemon", Running)
    file = machine(tmp_path)
    for words in ((), ("--simulated",)):
        assert invoke("run", file, *words).exit_code == 0
    refuses, takes = loads
    refuses()
    machine(tmp_path, curve="simulated")
    with pytest.raises(ConfigError, match="curve_origin: expected a valve measured on the machine"):
        refuses()
    takes()
