"""``canshaper sensor``: on the simulated crane, from a log, and what it writes."""

import os
import re
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import can
import numpy as np
import pytest
from typer.testing import CliRunner

from canshaper.bus.multicast import LocalMulticastBus
from canshaper.cli.app import app
from canshaper.commissioning.identification.driven import Driven
from canshaper.commissioning.identification.series import Command, Kind, Series, Unit
from canshaper.commissioning.procedure.bench import log_simulated
from canshaper.commissioning.sensor.fit import SensorFit, hand_driven
from canshaper.commissioning.sensor.verdict import SensorFinding, write_sensors
from canshaper.controller.controller import Controller
from canshaper.design.lockstep import LockStep
from canshaper.machine.binding import load_deployment
from canshaper.recording.log import LogFile
from canshaper_sim.crane import CraneParameters
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import SCRIPTS
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script
from canshaper_sim.sway_sensor import SwaySensorParameters
from tests.commissioning.sensor.drives import FILE, machine
from tests.rigs.files import ROOT, machine_file

REAL = CraneParameters(sway_sensor=SwaySensorParameters(gain=-1.0, delay_s=0.1))


def sensor(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, ["sensor", *map(str, arguments)])
    assert result.exit_code == code, result.output
    return result.output


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return machine_file(tmp_path, FILE)


def trust(file: Path) -> list[str]:
    """State of the sensor of near-far in the daemon during a drive."""
    deployment = load_deployment(file)
    controller, plant = Controller(deployment), PlantNode(deployment, REAL)
    hands = [JoystickNode(deployment, SCRIPTS["pulse-near_far"])]
    lock_step = LockStep(deployment, controller, plant, hands)
    while lock_step.time_ms < 8000:
        lock_step.step()
    start = "axis=near_far sway_sensor="
    texts = [event.text for event in controller.events]
    return [text.removeprefix(start) for text in texts if text.startswith(start)]


@pytest.mark.slow
def test_on_the_simulated_crane(tmp_path: Path) -> None:
    text = sensor(FILE, "--axis", "near_far", "--set", "sway_sensor.delay_s=0.1", "--out", tmp_path)
    assert "Near-far, sensor.log: SwayAngle.Along: 2 driven stretches, 100 % explained" in text
    (delay,) = [line.split() for line in text.splitlines() if line.startswith(" delay")]
    assert delay[2] == "20"
    assert abs(float(delay[3]) - 100) < 15
    assert f"Picture: {tmp_path / 'sensor.png'}" in text.replace("\n", "")
    assert (tmp_path / "sensor.png").stat().st_size > 20_000
    assert "Written" not in text


@pytest.mark.slow
def test_what_a_log_shows_is_written_and_then_trusted(tmp_path: Path, file: Path) -> None:
    assert "TRUSTED" not in trust(file)
    log = tmp_path / "drive.log"
    log_simulated(log, load_deployment(file), REAL, hand_driven(["slew", "near_far"]))
    text = sensor(file, log, "--write", "--out", tmp_path)
    section = "sway_sensor: { bus: crane, message: SwayAngle, signal: Along, kind: angle, use: damp"
    assert f"-    {section}, timeout_ms: 80 }}" in text
    (new,) = [line for line in text.splitlines() if line.startswith(f"+    {section}")]
    assert "origin: { date: " in new and "log: drive.log, by: canshaper sensor " in new
    assert "source: simulated }" in new
    for value in ("invert: true", "delay_ms: 10", "noise_deg: 0.1"):
        assert value in new
    assert f"Written to {file}" in text.replace("\n", "")
    assert trust(file) == ["UNPROVED", "TRUSTED"]


@pytest.mark.slow
def test_without_enough_data_nothing_is_written(tmp_path: Path, file: Path) -> None:
    log, before = tmp_path / "drive.log", file.read_bytes()
    log_simulated(log, load_deployment(file), REAL, Script("rest", (), 20.0))
    text = sensor(file, log, "--write", "--out", tmp_path, code=1)
    assert "Slew, drive.log: SwayAngle.Across: nothing found" in text
    assert "not enough data: expected near_far driven alone for 2 s or more, got 0.0 s" in text
    assert "Picture" not in text
    assert file.read_bytes() == before


def test_what_was_measured_is_assumed_no_more(file: Path) -> None:
    kept, measured = "axes.near_far.sway.period_s", "axes.near_far.sway_sensor.delay_ms"
    file.write_text(f"{file.read_text()}assumed: [{kept}, {measured}]\n")
    every = np.arange(100) * 0.02
    data = Driven("log", 0.0, every, every, Kind.ANGLE, Command(every, every))
    fit = SensorFit(1.0, 0.04, 2.0, 0.1, np.zeros(1), [every], 1.0, 0.0, 100, (1e-3,) * 4)
    series = Series("log", Unit(Kind.ANGLE, 1.0, "rad"), every, every)
    finding = SensorFinding("near_far", series, [data], fit, noise=0.1)
    write_sensors(load_deployment(file), [finding], None, live=False)
    assert load_deployment(file).config.assumed == [kept]


@pytest.mark.slow
def test_one_axis_that_is_good_is_written_without_the_other(tmp_path: Path, file: Path) -> None:
    log = tmp_path / "drive.log"
    log_simulated(log, load_deployment(file), REAL, hand_driven(["slew"]))
    text = sensor(file, log, "--write", "--out", tmp_path, code=1)
    assert "+    sway_sensor: { bus: crane, message: SwayAngle, signal: Across" in text
    assert "signal: Along" not in text


@pytest.mark.slow
@pytest.mark.parametrize("name", ["j1939-sensor.yaml", "canopen-sensor.yaml"])
def test_sensors_of_other_protocols(tmp_path: Path, name: str) -> None:
    text = sensor(ROOT / "config" / name, "--axis", "near_far", "--out", tmp_path)
    assert "100 % explained" in text or "99 % explained" in text


@pytest.mark.slow
def test_of_j1939_the_address_of_the_file_counts(tmp_path: Path) -> None:
    """Another inclinometer on the bus, that of the cab, sends the same message."""
    name = ROOT / "config" / "j1939-sensor.yaml"
    log = tmp_path / "drive.log"
    log_simulated(log, load_deployment(name), CraneParameters(), hand_driven(["near_far"]))
    text = re.sub(r"(.*0CF029)19#.*\n", r"\g<0>\g<1>1A#00007D00007D0000\n", log.read_text())
    assert "1A#" in text
    log.write_text(text)
    assert "99 % explained" in sensor(name, log, "--axis", "near_far", "--out", tmp_path)


def test_arguments_that_cannot_be(tmp_path: Path, file: Path) -> None:
    log = tmp_path / "drive.log"
    assert "expected a log or --live" in sensor(file, log, "--live", code=2)
    assert "--axis: expected one with a sway sensor, got 'lift'; there are slew, near_far" in (
        sensor(file, "--axis", "lift", code=2)
    )
    without = ROOT / "config" / "forwarder.yaml"
    assert "expected an axis with a sway_sensor, got none" in sensor(without, code=2)
    assert "shipped with the package" in sensor("forwarder-sensor.yaml", "--write", code=2)
    assert "No such file" in sensor(file, log, code=2)


def test_what_says_nothing_of_a_log_or_of_the_simulated_crane_is_refused(
    tmp_path: Path, file: Path
) -> None:
    """Its sign is that of the simulation: written into the file it could drive the swing."""
    log, before = tmp_path / "drive.log", file.read_text(encoding="utf-8")
    written = "--write: expected a log or --live, got the simulated crane\n"
    assert sensor(file, "--write", "--out", tmp_path, code=2) == written
    assert file.read_text(encoding="utf-8") == before
    changed = ("--set", "sway_sensor.delay_s=0.1")
    assert sensor(file, log, *changed, code=2) == (
        f"--set: expected the simulated crane, got {log}\n"
    )
    assert sensor(file, "--live", *changed, code=2) == (
        "--set: expected the simulated crane, got --live\n"
    )
    assert sensor(file, log, "--seconds", 3, code=2) == "--seconds: expected --live too, got none\n"


@pytest.fixture
def own_signals() -> Iterator[None]:
    """Restore the handlers of signals that the verb sets."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.slow
@pytest.mark.usefixtures("own_signals")
def test_live_it_listens_to_what_is_driven(tmp_path: Path) -> None:
    """A rest of three seconds of another program: kept as a log, what is missing is reported."""
    group = f"239.73.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
    rest = tmp_path / "rest.log"
    log_simulated(rest, machine(), REAL, Script("rest", (), 3.0))
    stop = threading.Event()

    def send() -> None:
        with LocalMulticastBus(channel=group) as bus:
            while not stop.is_set():
                for frame in LogFile(rest):
                    bus.send(
                        can.Message(
                            arbitration_id=frame.can_id,
                            is_extended_id=frame.extended,
                            data=frame.data,
                        )
                    )
                    stop.wait(0.001)

    sender = threading.Thread(target=send)
    sender.start()
    try:
        bus = ("--interface", "udp_multicast", "--channel", group)
        text = sensor(FILE, "--live", "--seconds", 3, *bus, "--out", tmp_path, code=1)
    finally:
        stop.set()
        sender.join()
    assert "expected near_far driven alone for 2 s or more, got 0.0 s" in text
    assert " 410#" in (tmp_path / "sensor.log").read_text()


@pytest.mark.slow
def test_a_log_without_the_sensor(tmp_path: Path, file: Path) -> None:
    log = tmp_path / "drive.log"
    log_simulated(log, machine(), CraneParameters(), hand_driven(["near_far"]))
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(line for line in lines if " 410#" not in line))
    assert "expected frames of SwayAngle (id 0x410)" in sensor(file, log, code=2)
