"""Faults of queues and interfaces on real SocketCAN: full, blocked, bus-off, removed.

Adapters that the emulation cannot make (no acknowledge, a controller that goes bus-off by itself)
are made by the closest real means: a queue whose frames do not get out (netem), a bus that takes no
more (tbf), and error frames as a driver writes them.
"""

import socket
import struct
import subprocess
from pathlib import Path

import can
import pytest

from tests.hil.driven import SLEW, drive
from tests.hil.machine import (
    FILE,
    Joysticks,
    Service,
    candump,
    joysticks_on,
    logged,
    open_bus,
    service,
    wait_for,
)


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


def tc(*words: str) -> None:
    subprocess.run(["tc", "qdisc", *words], check=True)


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
