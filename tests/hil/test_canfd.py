"""CAN FD on the real kernel: the shipped deployment against candump, cansend and python-can."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import cantools
import pytest
from crccheck.crc import Crc8Autosar

from tests.hil.gateway import DAEMON, FAR, NEAR, STOP, drain, in_the_line
from tests.hil.machine import ANSWER_S, candump, logged, service
from tests.rigs.files import ROOT

FILE = ROOT / "config" / "canfd-forwarder.yaml"
DBC = cantools.database.load_file(ROOT / "dbc" / "canfd.dbc")
STATUS = cantools.database.load_file(ROOT / "dbc" / "forwarder.dbc")
IDS = {m.frame_id: m for m in DBC.messages}
LEFT, SLEW, SLEW_STATUS = 0x120, 0x210, 0x300
SENSOR = 0x420  # which this deployment has not
CHANNEL, OTHER = "vcan0", "vcan1"


def open_fd(channel: str) -> can.BusABC:
    return can.Bus(interface="socketcan", channel=channel, ignore_config=True, fd=True)


class Hand(threading.Thread):
    """The joystick of the left hand, a frame of 24 bytes every 20 ms, without canshaper."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(daemon=True)
        self.slew = 0.0
        self._bus = bus
        self._end = threading.Event()

    def run(self) -> None:
        count = 0
        while not self._end.wait(0.02):
            count = (count + 1) % 256
            values = {"Buttons": 0, "Slew": self.slew, "NearFar": 0, "Enable": 1, "Check": 0}
            values |= {"AntiSwayOff": 0, "Reset": 0, "Count": count}
            data = IDS[LEFT].encode(values)
            data = data[:23] + bytes((Crc8Autosar.calc(data[:23]),))
            message = can.Message(
                arbitration_id=LEFT,
                is_extended_id=False,
                is_fd=True,
                bitrate_switch=True,
                data=data,
            )
            self._bus.send(message)

    def end(self) -> None:
        self._end.set()
        self.join()


@contextmanager
def hand() -> Iterator[Hand]:
    with open_fd(CHANNEL) as bus:
        one = Hand(bus)
        one.start()
        try:
            yield one
        finally:
            one.end()


def wait_state(bus: can.BusABC, state: str) -> None:
    """Until slew's status, a classical frame, says so."""
    while message := bus.recv(ANSWER_S):
        if message.arbitration_id != SLEW_STATUS:
            continue
        assert not message.is_fd
        if str(STATUS.decode_message("SlewStatus", message.data)["State"]) == state:
            return
    raise AssertionError(f"slew never {state}")


def test_a_drive_and_what_candump_saw_of_it(tmp_path: Path) -> None:
    """Each message in its kind of frame, with BRS; the log of candump is driven again."""
    log = tmp_path / "drive.log"
    run = [sys.executable, "-m", "canshaper"]
    demo = ["demo", str(FILE), "--transport", CHANNEL, "--script", "pulse-slew"]
    with candump(log, CHANNEL):
        subprocess.run([*run, *demo, "--out", str(tmp_path)], check=True)
    seen = set()
    fastest = 0.0
    for message in logged(log):
        known = IDS.get(message.arbitration_id)
        assert message.is_fd == (known is not None)
        if known is None:
            continue
        seen.add(message.arbitration_id)
        assert message.bitrate_switch
        assert len(message.data) == known.length
        if message.arbitration_id == SLEW:
            fastest = max(fastest, abs(known.decode(message.data)["Flow"]))
    assert seen == set(IDS) - {SENSOR}
    assert fastest == pytest.approx(100.0, abs=0.1)
    out = tmp_path / "replay"
    again = ["replay", str(log), "--config", str(FILE), "--out", str(out)]
    done = subprocess.run([*run, *again], check=True, capture_output=True, text=True)
    assert "left out" not in done.stdout
    with can.CanutilsLogReader(out / "canfd-forwarder.log") as reader:
        valves = [m for m in reader if m.arbitration_id == SLEW]
    assert all(m.is_fd for m in valves)
    assert max(abs(IDS[SLEW].decode(m.data)["Flow"]) for m in valves) == pytest.approx(
        100.0, abs=0.1
    )


def test_a_foreign_joystick_of_can_fd_moves_the_valve(tmp_path: Path) -> None:
    with (
        service(tmp_path / "log", "run", str(FILE)) as daemon,
        hand() as joystick,
        open_fd(CHANNEL) as bus,
    ):
        wait_state(bus, "READY")
        joystick.slew = 100.0
        while message := bus.recv(ANSWER_S):
            if message.arbitration_id == SLEW:
                assert (message.is_fd, message.bitrate_switch, message.dlc) == (True, True, 16)
                if IDS[SLEW].decode(message.data)["Flow"] > 30.0:
                    break
        else:
            raise AssertionError(f"slew never moved:\n{daemon.text()}")
        # Another sender of the valve's id, in a frame of CAN FD by can-utils.
        subprocess.run(["cansend", CHANNEL, "210##1" + "00" * 16], check=True)
        daemon.wait_log("reason=SECOND_SENDER")
        assert daemon.end() == 0, daemon.text()


def test_an_interface_that_has_only_classical_frames_is_reported(tmp_path: Path) -> None:
    """At the start, and by the doctor; nothing is sent."""
    ip = ["ip", "link", "set", OTHER]
    subprocess.run([*ip, "down"], check=True)
    subprocess.run([*ip, "mtu", "16"], check=True)
    subprocess.run([*ip, "up"], check=True)
    run = [sys.executable, "-m", "canshaper"]
    try:
        done = subprocess.run(
            [*run, "run", str(FILE), "--channel", OTHER],
            capture_output=True,
            text=True,
            check=False,
        )
        doctor = subprocess.run(
            [*run, "doctor", str(FILE), "--channel", OTHER],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
    finally:
        subprocess.run([*ip, "down"], check=True)
        subprocess.run([*ip, "mtu", "72"], check=True)
        subprocess.run([*ip, "up"], check=True)
    assert done.returncode == 3
    assert "expected an interface with CAN FD, which has the MTU 72, got 16" in done.stderr
    assert "CAN FD" in doctor.stdout
    assert "off, the MTU is 16" in doctor.stdout


def test_frames_of_can_fd_pass_a_gateway_in_both_directions(tmp_path: Path) -> None:
    """Untouched, once, in their order, with classical ones between them."""
    rates = [
        (f"{name}, bitrate: 250000", f"{name}, bitrate: 250000, fd: true") for name in (NEAR, FAR)
    ]
    with in_the_line(tmp_path, DAEMON, STOP, *rates), open_fd(NEAR) as near, open_fd(FAR) as far:
        messages = [
            can.Message(
                arbitration_id=0x700 + i % 16,
                is_extended_id=False,
                is_fd=i % 3 > 0,
                bitrate_switch=i % 3 > 1,
                data=bytes((i,)) * ((1, 12, 64)[i % 3]),
            )
            for i in range(90)
        ]
        for here, there in ((near, far), (far, near)):
            drain(there)
            received: list[can.Message] = []
            for message in messages:
                here.send(message)
            while len(received) < len(messages) and (one := there.recv(ANSWER_S)):
                if one.arbitration_id >= 0x700:
                    received.append(one)
            assert [(m.data, m.is_fd, m.bitrate_switch) for m in received] == [
                (m.data, m.is_fd, m.bitrate_switch) for m in messages
            ]
