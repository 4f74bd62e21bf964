"""Buses that say less than they should, go, or come late, on real SocketCAN."""

import os
import signal
import socket
import struct
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from tests.hil.driven import drive
from tests.hil.machine import ANSWER_S, FILE, joysticks_on, open_bus, service, wait_for
from tests.hil.slcan import ACTIVE, BUS_OFF, Adapter, adapter
from tests.rigs.files import ROOT, machine_file

FD_FILE = ROOT / "config/canfd-forwarder.yaml"


def ip(*words: str) -> None:
    subprocess.run(["ip", "link", *words], check=True)


def tc(*words: str) -> None:
    subprocess.run(["tc", "qdisc", *words], check=True)


def changed(file: Path, folder: Path, old: str, new: str) -> str:
    """A shipped file with a change, in a folder of its own."""
    return str(machine_file(folder, file, (old, new)))


@pytest.fixture
def serial() -> Iterator[Adapter]:
    with adapter() as one:
        yield one


def test_an_interface_without_echo_drives_a_valve_by_consent_only(
    serial: Adapter, tmp_path: Path
) -> None:
    with service(tmp_path / "d.log", "run", str(FILE), "--channel", serial.channel) as daemon:
        assert daemon.process.wait(ANSWER_S) == 3
        assert "no echo, as slcan" in daemon.text()
    assert not serial.valve_frames()


def test_bus_off_without_echo_lasts_until_the_interface_is_set_up_again(
    serial: Adapter, tmp_path: Path
) -> None:
    """All that is sent meanwhile comes back as if it had left, and the line gets none of it."""
    channel = f"channel: {serial.channel}, unconfirmed: true,"
    file = changed(FILE, tmp_path, "channel: vcan0,", channel)
    with open_bus(serial.channel) as bus, joysticks_on(serial.channel) as joysticks:
        with service(tmp_path / "d.log", "run", file) as daemon:
            daemon.wait_log("started file=.* valves=sent")
            daemon.wait_log("bus=crane state=unconfirmed")
            drive(bus, joysticks)
            assert serial.valve_frames()
            serial.says(BUS_OFF)
            daemon.wait_log("bus=crane state=bus-off")
            daemon.wait_log("axis=slew state=TRIPPED from=ACTIVE reason=SEND_FAILED")
            serial.says(ACTIVE)  # which opens no bus
            before = serial.valve_frames()
            for _ in range(100):
                wait_for(bus, "JoystickLeft", lambda _: True)
            assert serial.valve_frames() == before
            daemon.end(signal.SIGTERM)
            assert daemon.text().partition("bus-off")[2].count("bus=crane") == 3  # three valves
            assert "stopped valves=not-sent" in daemon.text()
        with service(tmp_path / "e.log", "run", file) as daemon:  # it sees the carrier only
            daemon.wait_log("bus=crane state=bus-off")
            serial.down()
            daemon.wait_log("bus=crane state=down")
            serial.up()
            daemon.wait_log("(?s)state=down.*bus=crane state=unconfirmed")
            with open_bus(serial.channel) as again:
                drive(again, joysticks)
            assert daemon.end(signal.SIGTERM) == 0
            assert "stopped valves=sent" in daemon.text()


def test_a_service_waits_for_its_interface_without_priority(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    manager = tmp_path / "notify"
    monkeypatch.setenv("NOTIFY_SOCKET", str(manager))
    arguments = ("run", str(FILE), "--channel", "vcan9", "--priority", "40")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as received:
        received.bind(str(manager))
        received.settimeout(ANSWER_S)
        with service(tmp_path / "d.log", *arguments) as daemon:
            for _ in range(3):
                said = received.recv(4096).decode()
                assert "READY=1\nSTATUS=waiting: bus crane: cannot open" in said
                assert "vcan9: No such device" in said
            process = daemon.process.pid
            assert os.sched_getscheduler(process) == os.SCHED_OTHER
            ip("add", "vcan9", "type", "vcan")
            try:
                ip("set", "vcan9", "up")
                daemon.wait_log("started file=.* valves=neutral")
                assert os.sched_getscheduler(process) == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
                status = Path(f"/proc/{process}/status").read_text()
                assert int(status.partition("CapEff:")[2].split()[0], 16) & (1 << 12) == 0
                assert daemon.text().count("waiting for a bus") == 1
                assert daemon.end(signal.SIGTERM) == 0
            finally:
                ip("del", "vcan9")


def test_a_bus_that_comes_back_without_can_fd_says_so_once(tmp_path: Path) -> None:
    with service(tmp_path / "d.log", "run", str(FD_FILE), "--channel", "vcan1") as daemon:
        daemon.wait_log("started file=")
        for remove in (False, True):
            for mtu, state in (("16", "unfit why=.*MTU"), ("72", "up")):
                ip("set", "vcan1", "down")
                if remove:
                    ip("del", "vcan1")
                    daemon.wait_log("state=(gone|unfit)")
                    ip("add", "vcan1", "type", "vcan")
                ip("set", "vcan1", "mtu", mtu)
                ip("set", "vcan1", "up")
                daemon.wait_log(f"(?s)(bus=crane state={state}.*){{{1 + remove}}}")
        assert daemon.text().count("state=unfit") == 2
        assert daemon.process.poll() is None


@contextmanager
def flood(channel: str) -> Iterator[None]:
    """Error frames of a disturbed bus, as fast as they can be written."""
    ended = threading.Event()
    frame = struct.pack("=IB3x8s", socket.CAN_ERR_FLAG | 0x88, 8, bytes(8))

    def write() -> None:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as one:
            one.bind((channel,))
            while not ended.is_set():
                for _ in range(60):
                    one.send(frame)
                ended.wait(0.02)

    thread = threading.Thread(target=write)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def test_a_flood_of_error_frames_is_kept_out_and_the_state_is_seen(tmp_path: Path) -> None:
    with (
        service(tmp_path / "d.log", "run", str(FILE)) as daemon,
        can.Bus("vcan0", "socketcan", ignore_rx_error_frames=True, ignore_config=True) as bus,
        joysticks_on("vcan0") as joysticks,
    ):
        daemon.wait_log("started file=")
        drive(bus, joysticks)
        with flood("vcan0"):
            daemon.wait_log("fault=ERROR_FRAME")
            # At once: the counter of eight bits ends at 255.
            first = wait_for(bus, "ShaperStatus", lambda s: s["ErrorFrames"] > 0)["ErrorFrames"]
            counted = wait_for(bus, "ShaperStatus", lambda s: s["ErrorFrames"] != first)
            subprocess.run(["cansend", "vcan0", "20000004#0020000000000000"], check=True)
            daemon.wait_log("bus=crane state=passive")
            drive(bus, joysticks)
        assert counted["ErrorFrames"] - first < 200, "a second of 3 000"
        assert daemon.text().count("bus=crane") < 5


def test_last_words_and_first_ones_are_what_was_confirmed(
    can_pair: tuple[str, str], tmp_path: Path
) -> None:
    ours, _ = can_pair
    arguments = ("run", str(FILE), "--channel", ours)
    with service(tmp_path / "d.log", *arguments) as daemon:
        daemon.wait_log("started file=.* valves=neutral")
        tc("replace", "dev", ours, "root", "netem", "delay", "250s", "limit", "1000")
        try:
            daemon.wait_log("bus=crane state=not-confirmed")
            daemon.end(signal.SIGTERM)
            assert "stopped valves=not-sent" in daemon.text()
            with service(tmp_path / "e.log", *arguments) as later:
                later.wait_log("started file=.* valves=not-confirmed")
        finally:
            tc("del", "dev", ours, "root")


def test_a_name_that_is_anothers_now_is_said(tmp_path: Path) -> None:
    def rename(old: str, new: str) -> None:
        ip("set", old, "down")
        ip("set", old, "name", new)
        ip("set", new, "up")

    number = Path("/sys/class/net/vcan0/ifindex").read_text().strip()
    with service(tmp_path / "d.log", "run", str(FILE)) as daemon:
        daemon.wait_log("started file=")
        rename("vcan0", "parked")
        rename("vcan1", "vcan0")
        try:
            another = Path("/sys/class/net/vcan0/ifindex").read_text().strip()
            daemon.wait_log(
                f"bus=crane interface=parked ifindex={number}: no longer vcan0, which is another"
                f" one now, ifindex {another}"
            )
        finally:
            rename("vcan0", "vcan1")
            rename("parked", "vcan0")
        assert daemon.process.poll() is None
