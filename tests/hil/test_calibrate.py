"""``canshaper calibrate --live`` on real SocketCAN: simulated crane, hand that holds the enable."""

import signal
from pathlib import Path

import can
import pytest

from canshaper.machine.binding import load_deployment
from tests.hil.machine import (
    DBC,
    FILE,
    Joysticks,
    Service,
    candump,
    joysticks_on,
    logged,
    open_bus,
    service,
)
from tests.rigs.files import machine_file

VALVES = {DBC.get_message_by_name(f"{a}Command").frame_id for a in ("Slew", "NearFar", "Lift")}
QUICK = ["--axis", "slew", "--rate", "10", "--top", "15", "--live", "--yes"]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return machine_file(tmp_path, FILE)


def moving(message: can.Message) -> bool:
    return message.arbitration_id in VALVES and message.data[0] != 0


def last_of_each(log: Path) -> list[int]:
    """The last command that each valve was sent."""
    commands = {m.arbitration_id: m.data[0] for m in logged(log) if m.arbitration_id in VALVES}
    return [commands[valve] for valve in sorted(VALVES)]


def moves(bus: can.BusABC, running: Service) -> bool:
    """Wait for motion; False where the measurement ends before."""
    while running.process.poll() is None:
        message = bus.recv(0.2)
        if message is not None and moving(message):
            return True
    return False


def test_a_valve_on_the_bus_is_measured(file: Path, tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    options = ["--set", "slew.deadband=0.08"]
    with (
        service(tmp_path / "sim.log", "sim", str(file), *options),
        joysticks_on("vcan0"),
        candump(log, "vcan0"),
        service(tmp_path / "calibrate.log", "calibrate", str(file), *QUICK, "--write") as running,
    ):
        assert running.process.wait() == 0, running.text()
    limits = load_deployment(file).axes["slew"].config.limits
    curve = limits.curve()
    assert curve is not None, running.text()
    # A machine that stands still now and then does not measure as well as lock-step does.
    opens = [curve.command(v) for v in (-1e-9, 1e-9)]
    assert opens == pytest.approx([-0.08, 0.08], abs=0.03)
    moved = {m.arbitration_id for m in logged(log) if moving(m)}
    assert moved == {DBC.get_message_by_name("SlewCommand").frame_id}
    assert last_of_each(log) == [0, 0, 0]


@pytest.mark.parametrize("end", ["enable", "silence", "joystick", "ctrl-c", "hang-up"])
def test_however_it_ends_the_valves_are_neutral(file: Path, tmp_path: Path, end: str) -> None:
    log = tmp_path / "bus.log"
    slow = [*QUICK[:2], "--rate", "1", *QUICK[4:], "--write"]
    before = file.read_text()
    with (
        service(tmp_path / "sim.log", "sim", str(file)),
        joysticks_on("vcan0") as joysticks,
        open_bus("vcan0") as bus,
        candump(log, "vcan0"),
    ):
        for _ in range(3):  # once more where an emulated machine stood still before
            arguments = ("calibrate", str(file), *slow)
            with service(tmp_path / "calibrate.log", *arguments) as running:
                if not moves(bus, running):
                    continue
                make(joysticks, end, running)
                assert running.process.wait() == 1, running.text()
                break
    assert "the measurement was not taken to its end: stopped" in running.text()
    assert last_of_each(log) == [0, 0, 0]
    assert file.read_text() == before


def make(joysticks: Joysticks, end: str, running: Service) -> None:
    if end == "enable":
        joysticks.switches["Enable"] = 0
    elif end == "silence":
        joysticks.silent = True
    elif end == "joystick":
        joysticks.values["Slew"] = 30.0
    else:
        number = signal.SIGINT if end == "ctrl-c" else signal.SIGHUP
        running.process.send_signal(number)


def test_it_asks_before_anything_moves(file: Path, tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    with (
        joysticks_on("vcan0"),
        candump(log, "vcan0"),
        service(tmp_path / "calibrate.log", "calibrate", str(file), *QUICK[:-1]) as running,
    ):
        assert running.process.wait() == 1  # no one answers
    assert "will move by itself" in running.text()
    assert not any(m.arbitration_id in VALVES for m in logged(log))
