"""Signals and commands out of CAN logs, right and wrong ones."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canshaper.commissioning.identification.canlog import bind, read_can
from canshaper.commissioning.identification.series import Kind
from canshaper.errors import ConfigError, IdentificationError, LogError
from canshaper.machine.binding import load_deployment
from canshaper.machine.database import Messages, load_dbc
from canshaper.machine.deployment import Deployment
from tests.commissioning.identification.machine import FILE, Push, candump, driven
from tests.rigs.files import ROOT, machine_file

PUSHES = [Push("slew", 2.0, 1.0, 0.5), Push("near_far", 6.0, 1.0, -0.4)]
DRIVE = driven(12.0, PUSHES)
SWAY = {"slew": "GrappleSway.SwayPerpendicular", "near_far": "GrappleSway.SwayParallel"}


@pytest.fixture(scope="module")
def deployment() -> Deployment:
    return load_deployment(FILE)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return candump(tmp_path / "a.log", DRIVE, noise_deg=0.0)


def write(log: Path, lines: list[str]) -> None:
    log.write_text("\n".join(lines) + "\n")


def test_signals_and_commands(log: Path, deployment: Deployment) -> None:
    done: list[float] = []
    messages = deployment.messages
    recorded = read_can(log, SWAY, messages, deployment=deployment, on_progress=done.append)
    assert done[-1] == 1.0
    slew, near = recorded["slew"], recorded["near_far"]
    assert slew.source == "a.log: GrappleSway.SwayPerpendicular"
    assert slew.unit.kind is Kind.ANGLE
    expected = np.array([state.theta5_rad for state, _ in DRIVE])
    assert slew.value == pytest.approx(expected, abs=math.radians(0.006))
    assert np.diff(slew.time_s) == pytest.approx(0.02, abs=1e-5)
    assert slew.command and near.command
    # 5 % dead band of the deployment, on the grid of the frame.
    assert slew.command.speed.max() == pytest.approx((0.496 - 0.05) / 0.95)
    assert near.command.speed.min() == pytest.approx(-(0.4 - 0.05) / 0.95)
    at = slew.command.time_s[slew.command.speed > 0.0]
    assert (at[0], at[-1]) == pytest.approx((2.0, 2.98), abs=0.03)
    # No axis may move where the swing counts as free.
    assert slew.idle == near.idle
    assert slew.idle is not None
    assert [a for a, _ in slew.idle] == pytest.approx([0.0, 3.0, 7.0], abs=0.04)
    assert [b for _, b in slew.idle] == pytest.approx([2.0, 6.0, 12.0], abs=0.04)


def test_without_commands_nothing_is_known_of_them(tmp_path: Path, deployment: Deployment) -> None:
    log = candump(tmp_path / "a.log", DRIVE, valves=False)
    slew = read_can(log, SWAY, deployment.messages, deployment=deployment)["slew"]
    assert slew.command is None
    assert slew.idle is None


def test_commands_that_fall_silent_are_not_taken_for_standing(
    tmp_path: Path, deployment: Deployment
) -> None:
    log = candump(tmp_path / "a.log", DRIVE)
    kept = [
        line
        for line in log.read_text().splitlines()
        if " 200#" not in line or not 1.7e9 + 8.0 < float(line[1:18]) < 1.7e9 + 11.0
    ]
    write(log, kept)
    slew = read_can(log, SWAY, deployment.messages, deployment=deployment)["slew"]
    assert slew.idle is not None
    assert [b for _, b in slew.idle] == pytest.approx([2.0, 6.0, 8.0, 12.0], abs=0.05)


def test_joysticks_report_the_commands_where_no_valve_does(
    tmp_path: Path, deployment: Deployment
) -> None:
    """A machine on which canshaper does not run yet: the joystick goes to the valve as it is."""
    log = candump(tmp_path / "a.log", DRIVE, valves=False)
    lines = log.read_text().splitlines()
    for tick in range(600):
        joystick = 500 if 100 <= tick < 150 else 15  # 1.5 %, still neutral
        data = joystick.to_bytes(2, "little", signed=True) + bytes(6)
        lines.append(f"({1.7e9 + 0.02 * tick + 0.001:.6f}) can0 110#{data.hex().upper()}")
    write(log, sorted(lines))
    slew = read_can(log, SWAY, deployment.messages, deployment=deployment)["slew"]
    assert slew.command
    assert slew.command.speed.max() == pytest.approx(0.5)
    assert slew.idle is not None
    assert [a for a, _ in slew.idle] == pytest.approx([0.0, 3.0], abs=0.05)


def test_a_log_without_the_signal(log: Path, deployment: Deployment) -> None:
    kept = [line for line in log.read_text().splitlines() if " 400#" not in line]
    write(log, kept)
    with pytest.raises(IdentificationError) as error:
        read_can(log, SWAY, deployment.messages)
    assert "expected frames of GrappleSway (id 0x400), got 1800 of " in str(error.value)
    assert "LiftCommand, NearFarCommand, SlewCommand" in str(error.value)


def test_a_log_that_is_cut_off_is_used_up_to_there(log: Path, deployment: Deployment) -> None:
    text = log.read_text()
    log.write_text(text[: len(text) // 2 - 7])
    signal = read_can(log, SWAY, deployment.messages)["slew"]
    assert 295 <= len(signal.value) <= 300
    assert any("cut off" in note and str(log) in note for note in signal.notes), signal.notes


def test_no_values_are_left_out_and_reported(tmp_path: Path) -> None:
    """Codes that the DBC names, values beyond its range, and frames that are too short."""
    text = (ROOT / "dbc" / "forwarder.dbc").read_text()
    dbc = tmp_path / "a.dbc"
    dbc.write_text(text + 'VAL_ 1024 SwayPerpendicular 9000 "Error" ;\n')
    messages = messages_of(dbc)
    log = candump(tmp_path / "a.log", DRIVE)
    lines = log.read_text().splitlines()
    for k, data in ((7, "FF7F0000"), (11, "FE7F0000"), (15, "00"), (19, "28230000")):
        lines[k] = lines[k].partition("#")[0] + "#" + data
    write(log, lines)
    signal = read_can(log, {"slew": SWAY["slew"]}, messages)["slew"]
    assert len(signal.value) == 600 - 4
    assert np.abs(signal.value).max() < 1.0
    short, none = signal.notes
    assert "1 frames were too short" in short
    assert "3 values were not available, errors or out of range" in none


def messages_of(path: Path) -> Messages:
    file, problems = load_dbc(path)
    if file is None:
        raise ConfigError(problems)
    return Messages([file])


def test_two_senders_need_a_choice(tmp_path: Path, deployment: Deployment) -> None:
    one = candump(tmp_path / "a.log", DRIVE).read_text().splitlines()
    two = candump(tmp_path / "b.log", DRIVE, channel="can1", seed=5).read_text().splitlines()
    log = tmp_path / "c.log"
    write(log, [line for pair in zip(one, two, strict=True) for line in pair])
    with pytest.raises(IdentificationError, match=r"0x400 on can0, 0x400 on can1; .*--channel"):
        read_can(log, SWAY, deployment.messages)
    chosen = read_can(log, SWAY, deployment.messages, channel="can1")["slew"]
    assert len(chosen.value) == 600
    with pytest.raises(LogError, match=r"expected the bus 'can7', got frames of 'can0', 'can1'"):
        read_can(log, SWAY, deployment.messages, channel="can7")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("Sway", "expected AXIS=MESSAGE.SIGNAL, got"),
        ("Nothing.Here", "expected a message of the DBC files, got 'Nothing'; there are"),
        ("GrappleSway.Nothing", "has the signals SwayPerpendicular, SwayParallel"),
    ],
)
def test_signals_that_are_not_there(deployment: Deployment, name: str, text: str) -> None:
    with pytest.raises(IdentificationError, match=text):
        bind(name, deployment.messages)


def test_an_acceleration_is_refused(tmp_path: Path) -> None:
    text = (ROOT / "dbc" / "forwarder.dbc").read_text()
    dbc = tmp_path / "a.dbc"
    dbc.write_text(text.replace('[-180|180] "deg" SHAPER', '[-180|180] "m/s^2" SHAPER'))
    with pytest.raises(IdentificationError, match="does not show the swing"):
        bind("GrappleSway.SwayParallel", messages_of(dbc))


def test_j1939_takes_any_priority_and_reports_two_addresses(tmp_path: Path) -> None:
    dbc = tmp_path / "a.dbc"
    dbc.write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: A\n'
        "BO_ 2566856190 Incline: 8 A\n"  # 18FF1DFE, from any address
        ' SG_ Pitch : 0|16@1- (0.01,0) [-90|90] "deg" A\n'
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
        'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\n'
        'BA_ "VFrameFormat" BO_ 2566856190 3;\n'
    )
    rows = [f"({1.7e9 + 0.01 * k:.6f}) can0 0CFF1D21#{k:02X}00FFFFFFFFFFFF" for k in range(90)]
    log = tmp_path / "a.log"
    write(log, rows)
    signal = read_can(log, {"slew": "Incline.Pitch"}, messages_of(dbc))["slew"]
    assert signal.value[:3] == pytest.approx([0.0, math.radians(0.01), math.radians(0.02)])
    write(log, [*rows, rows[-1].replace("0CFF1D21", "0CFF1D22")])
    with pytest.raises(IdentificationError, match=r"0xcff1d21 on can0, 0xcff1d22 on can0"):
        read_can(log, {"slew": "Incline.Pitch"}, messages_of(dbc))


def test_the_signal_of_the_grapple_is_read_next_to(tmp_path: Path) -> None:
    # Any cyclic message will do for the weight.
    grapple = "load_state: { bus: crane, message: TipPosition, signal: Radius, timeout_ms: 500 }\n"
    file = machine_file(tmp_path, FILE, more=grapple)
    deployment = load_deployment(file)
    log = candump(tmp_path / "a.log", DRIVE)
    lines = log.read_text().splitlines()
    lines += [f"({1.7e9 + 13 + 0.1 * k:.6f}) can0 401#0000F40B0000" for k in range(10)]
    write(log, lines)
    signal = read_can(log, SWAY, deployment.messages, deployment=deployment)["slew"]
    assert signal.at == pytest.approx(3.06)


def test_a_measurement_of_poor_merit_is_left_out(tmp_path: Path) -> None:
    """Of a sway sensor with a figure of merit, as the daemon leaves it out."""
    deployment = load_deployment(ROOT / "config" / "j1939-sensor.yaml")
    entry = deployment.messages.find("SSI2")
    assert not isinstance(entry, str)
    message = entry[1]
    rows = []
    for number in range(40):
        raw = {s.name: 0 for s in message.signals} | {"PitchAngle": 4_000_000 + number}
        raw["PitchMerit"] = 2 if number in (7, 8) else 0
        raw["RollMerit"] = 1 if number == 9 else 0
        data = message.encode(raw, scaling=False, strict=False)
        can_id = message.frame_id & 0x1FFFFF00 | 0x19
        rows.append(f"({1000 + 0.02 * number:.6f}) can0 {can_id:08X}#{data.hex()}")
    log = tmp_path / "a.log"
    write(log, rows)
    names = {"near_far": "SSI2.PitchAngle"}
    sources = {"near_far": 0x19}
    bound: dict[str, Any] = {"deployment": deployment, "sources": sources}
    series = read_can(log, names, deployment.messages, **bound)["near_far"]
    assert len(series.value) == 38
    assert not [t for t in series.time_s if 0.13 < t < 0.17]
    assert "2 values were not available, errors or out of range and left out" in series.notes[0]
    plain = read_can(log, names, deployment.messages, sources=sources)["near_far"]
    assert len(plain.value) == 40
