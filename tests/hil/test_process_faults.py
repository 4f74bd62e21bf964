"""Faults around the daemon on real SocketCAN: process, clock and log."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can

from tests.hil.driven import SLEW, drive
from tests.hil.machine import FILE, Joysticks, Service, candump, logged, wait_for


def state(*names: str) -> Callable[[dict], bool]:
    return lambda status: str(status["State"]) in names


def slew_of(log: Path) -> list[int]:
    return [m.data[0] for m in logged(log) if m.arbitration_id == SLEW]


def test_a_process_that_was_stopped_trips_and_moves_nothing(
    bus: can.BusABC, joysticks: Joysticks, daemon: Service, tmp_path: Path
) -> None:
    drive(bus, joysticks)
    with candump(tmp_path / "stop.log", "vcan0"):
        daemon.process.send_signal(signal.SIGSTOP)
        joysticks.values["Slew"] = -100.0  # waits in the sockets as if it were fresh
        for _ in range(100):
            wait_for(bus, "JoystickLeft", lambda v: True)
        daemon.process.send_signal(signal.SIGCONT)
        status = wait_for(bus, "SlewStatus", state("TRIPPED"))
        assert str(status["Reason"]) == "LOOP_STALLED"
    values = slew_of(tmp_path / "stop.log")
    stopped = values.index(0)
    assert not any(values[stopped:])
    assert all(v < 128 for v in values), "moved the other way"
    drive(bus, joysticks)


def test_repeated_overruns_stop_the_axis_and_a_single_one_does_not(
    bus: can.BusABC, joysticks: Joysticks, daemon: Service
) -> None:
    def hold_up(times: int) -> None:
        for _ in range(times):
            daemon.process.send_signal(signal.SIGSTOP)
            wait_for(bus, "JoystickLeft", lambda v: True)
            wait_for(bus, "JoystickLeft", lambda v: True)
            daemon.process.send_signal(signal.SIGCONT)
            wait_for(bus, "SlewCommand", lambda v: True)

    drive(bus, joysticks)
    hold_up(1)
    assert str(wait_for(bus, "SlewStatus", lambda s: True)["State"]) == "ACTIVE"
    hold_up(40)
    # An emulated machine may hold the process up for longer than that.
    status = wait_for(bus, "SlewStatus", state("STOPPING", "NEUTRAL_WAIT", "TRIPPED"))
    assert str(status["Reason"]) in ("LOOP_OVERRUN", "STOP_DONE", "LOOP_STALLED")
    assert "reason=LOOP_OVERRUN" in daemon.text() or "reason=LOOP_STALLED" in daemon.text()
    drive(bus, joysticks)


def test_steps_of_the_clock_change_nothing(
    bus: can.BusABC, joysticks: Joysticks, daemon: Service
) -> None:
    drive(bus, joysticks)
    now = time.clock_gettime(time.CLOCK_REALTIME)
    try:
        for hours in (1, -1):
            time.clock_settime(time.CLOCK_REALTIME, now + 3600 * hours)
            for slew in (90.0, 80.0, 100.0):
                joysticks.values["Slew"] = slew
                wait_for(bus, "SlewStatus", lambda s, slew=slew: s["RawCommand"] == slew)
    finally:
        time.clock_settime(time.CLOCK_REALTIME, now)
    assert "STOPPING" not in daemon.text()


@contextmanager
def running(stderr: int) -> Iterator[subprocess.Popen]:
    """The daemon with that standard error, killed at the end of the block where it still runs."""
    command = [sys.executable, "-m", "canshaper", "run", str(FILE)]
    with subprocess.Popen(command, stderr=stderr) as process:
        try:
            yield process
        finally:
            process.kill()


def test_a_full_disk_and_a_reader_that_has_gone_change_nothing(
    bus: can.BusABC, joysticks: Joysticks
) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    for stderr in (os.open("/dev/full", os.O_WRONLY), writing):
        with running(stderr) as process:
            drive(bus, joysticks)
            for slew in (90.0, 80.0, 100.0):
                joysticks.values["Slew"] = slew
                wait_for(bus, "SlewStatus", lambda s, slew=slew: s["RawCommand"] == slew)
            joysticks.values["Slew"] = 0.0
            process.send_signal(signal.SIGTERM)
            assert process.wait(120) == 0
        os.close(stderr)


def test_a_log_reader_that_hangs_holds_up_nothing(bus: can.BusABC, joysticks: Joysticks) -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    try:
        while True:
            os.write(writing, b"x" * 4096)
    except BlockingIOError:
        os.set_blocking(writing, True)  # as the daemon gets it: a write would wait for ever
    with running(writing) as process:
        drive(bus, joysticks)
        joysticks.values["Slew"] = 0.0
        process.send_signal(signal.SIGTERM)
        assert process.wait(120) == 0
    os.close(reading)
    os.close(writing)
