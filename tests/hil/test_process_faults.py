"""Faults around the daemon on real SocketCAN: process, clock, log, queues and interfaces.

Adapters that the emulation cannot make (no acknowledge, a controller that goes bus-off by itself)
are made by the closest real means: a queue whose frames do not get out (netem), a bus that takes no
more (tbf), and error frames as a driver writes them.
"""

import os
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from tests.hil.machine import (
    FILE,
    Accept,
    Joysticks,
    Service,
    candump,
    joysticks_on,
    logged,
    open_bus,
    service,
    wait_for,
    wait_for_one,
)

SLEW = 0x200


@pytest.fixture
def joysticks() -> Iterator[Joysticks]:
    with joysticks_on("vcan0") as running:
        yield running


@pytest.fixture
def bus() -> Iterator[can.BusABC]:
    with open_bus("vcan0") as opened:
        yield opened


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Service]:
    with service(tmp_path / "daemon.log", "run", str(FILE)) as running:
        running.wait_log("started file=")
        yield running


def state(*names: str) -> Callable[[dict], bool]:
    return lambda status: str(status["State"]) in names


def drive(bus: can.BusABC, joysticks: Joysticks) -> None:
    """Full motion; once more where an emulated machine that stood still has tripped the axis."""
    for _ in range(5):
        ready(bus, joysticks)
        joysticks.values["Slew"] = 100.0
        expected: dict[str, Accept] = {
            "SlewCommand": lambda v: v["Velocity"] > 90.0,
            "SlewStatus": lambda s: str(s["Reason"]) == "LOOP_STALLED",
        }
        if wait_for_one(bus, expected)[0] == "SlewCommand":
            return
    raise AssertionError("the machine stands still too often")


def ready(bus: can.BusABC, joysticks: Joysticks) -> None:
    """Neutral, and presses of reset until one counts."""
    joysticks.values["Slew"] = 0.0
    joysticks.silent = False
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        joysticks.switches["Reset"] ^= 1
        while bus.recv(0):  # what was sent while no one read says nothing of now
            pass
        for _ in range(3):
            status = wait_for(bus, "SlewStatus", lambda s: True)
        if str(status["State"]) == "READY" and status["RawCommand"] == 0:
            joysticks.switches["Reset"] = 0
            return
    raise AssertionError(f"not ready: {status}")


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


def tc(*words: str) -> None:
    subprocess.run(["tc", "qdisc", *words], check=True)


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


def driver_writes(channel: str, error_class: int, data: bytes) -> None:
    """An error frame as a driver writes it, past what waits in the queue."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_PRIORITY, 6)  # the first band of prio
        one.bind((channel,))
        one.send(struct.pack("=IB3x8s", socket.CAN_ERR_FLAG | error_class, 8, data))


@pytest.mark.parametrize(
    ("error_class", "data"), [(0x40, bytes(8)), (0x44, bytes((0, 0x20, 0, 0, 0, 0, 0, 0)))]
)
def test_bus_off_is_seen_and_survived(
    error_class: int, data: bytes, can_pair: tuple[str, str], tmp_path: Path
) -> None:
    """Frames that stay in the queue, and the error frame that a driver writes in bus-off."""
    ours, far_end = can_pair
    with (
        service(tmp_path / "d.log", "run", str(FILE), "--channel", ours) as daemon,
        open_bus(far_end) as far,
        joysticks_on(far_end) as joysticks,
    ):
        daemon.wait_log("started file=")
        drive(far, joysticks)
        tc("replace", "dev", ours, "root", "handle", "1:", "prio")
        tc("add", "dev", ours, "parent", "1:2", "netem", "delay", "250s", "limit", "1000")
        try:
            driver_writes(ours, error_class, data)
            daemon.wait_log("bus=crane state=bus-off")
            daemon.wait_log("axis=slew state=TRIPPED from=ACTIVE reason=SEND_FAILED")
        finally:
            tc("del", "dev", ours, "root")
        daemon.wait_log("bus=crane state=up")
        drive(far, joysticks)


def test_passive_is_reported_and_goes_on(
    bus: can.BusABC, joysticks: Joysticks, daemon: Service
) -> None:
    drive(bus, joysticks)
    subprocess.run(["cansend", "vcan0", "20000004#0020000000000000"], check=True)
    daemon.wait_log("bus=crane state=passive")
    assert str(wait_for(bus, "SlewStatus", lambda s: True)["State"]) == "ACTIVE"
    subprocess.run(["cansend", "vcan0", "20000004#0040000000000000"], check=True)
    daemon.wait_log("bus=crane state=up")


def test_an_interface_removed_and_back_is_used_again(
    bus: can.BusABC, joysticks: Joysticks, daemon: Service
) -> None:
    drive(bus, joysticks)
    ip("link", "del", "vcan0")
    try:
        daemon.wait_log("axis=slew state=TRIPPED from=ACTIVE reason=SEND_FAILED")
        daemon.wait_log("bus=crane state=gone")
    finally:
        ip("link", "add", "vcan0", "type", "vcan")
        ip("link", "set", "vcan0", "up")
    daemon.wait_log("bus=crane state=up")
    with open_bus("vcan0") as again, joysticks_on("vcan0") as new_joysticks:
        drive(again, new_joysticks)
    assert daemon.process.poll() is None


def test_a_full_queue_trips_and_is_survived(tmp_path: Path) -> None:
    """A bus that takes no more: ENOBUFS."""
    with (
        service(tmp_path / "d.log", "run", str(FILE), "--channel", "vxcan0") as daemon,
        open_bus("vxcan1") as far,
        joysticks_on("vxcan1") as joysticks,
    ):
        daemon.wait_log("started file=")
        drive(far, joysticks)
        # 8 bit/s: the queue of 160 bytes is full with the next ten frames
        tc("replace", "dev", "vxcan0", "root", "tbf", "rate", "8bit", "burst", "64", "limit", "160")
        try:
            daemon.wait_log("axis=slew state=TRIPPED from=ACTIVE reason=SEND_FAILED")
        finally:
            tc("del", "dev", "vxcan0", "root")
        drive(far, joysticks)


def test_frames_that_do_not_get_onto_the_bus_are_not_piled_up(
    can_pair: tuple[str, str], tmp_path: Path
) -> None:
    """As with no other node to acknowledge: what is queued goes out later, and is old by then."""
    ours, far_end = can_pair
    log = tmp_path / "valves.log"
    with (
        service(tmp_path / "d.log", "run", str(FILE), "--channel", ours) as daemon,
        open_bus(far_end) as far,
        joysticks_on(far_end) as joysticks,
        candump(log, far_end),
    ):
        daemon.wait_log("started file=")
        drive(far, joysticks)
        tc("replace", "dev", ours, "root", "netem", "delay", "3s", "limit", "1000")
        try:
            daemon.wait_log("bus=crane state=not-confirmed")
            daemon.wait_log("axis=slew state=TRIPPED from=ACTIVE reason=SEND_FAILED")
            far.send(can.Message(arbitration_id=0x7F0, is_extended_id=False))  # a mark in the log
            daemon.wait_log("bus=crane state=up")  # the first of them are out
        finally:
            tc("del", "dev", ours, "root")
        drive(far, joysticks)
    messages = logged(log)
    mark = next(i for i, m in enumerate(messages) if m.arbitration_id == 0x7F0)
    late = [m.data[0] for m in messages[mark:] if m.arbitration_id == SLEW]
    neutral = late.index(0)
    # Three were under way when it was seen; none is added to them.
    assert sum(v != 0 for v in late[:neutral]) <= 4
    assert not any(late[neutral : neutral + 3])


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
