"""The daemon as a process: changed over its control socket, and only listening."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from typer.testing import CliRunner

from canshaper.bus.multicast import LocalMulticastBus
from canshaper.cli.app import app
from canshaper.machine.binding import load_deployment
from tests.rigs.files import ROOT, machine_file

pytestmark = pytest.mark.processes

ANSWER_S = 60.0  # only to end a test that hangs
GROUP = f"239.77.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
BUS = "{ interface: socketcan, channel: vcan0, bitrate: 250000 }"
PERIOD = "axes.slew.sway.period_s"
CONTROL = f"control: {{ socket: PATH, adjustable: {{ {PERIOD}: [1.8, 3.0] }} }}\n"


class Daemon:
    """``canshaper run`` on a multicast group."""

    def __init__(self, folder: Path, *options: str) -> None:
        bus = BUS, f"{{ interface: udp_multicast, channel: {GROUP} }}"
        control = CONTROL.replace("PATH", str(folder / "control.sock"))
        self.file = machine_file(folder, "forwarder", bus, more=control)
        self.text = self.file.read_text(encoding="utf-8")
        self._log = folder / "log"
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "canshaper", "run", str(self.file), *options], stderr=log
            )

    def logged(self, pattern: str) -> str:
        until = time.monotonic() + ANSWER_S
        while (match := re.search(pattern, self.log())) is None:
            assert time.monotonic() < until, self.log()
            assert self.process.poll() is None, self.log()
        return match[0]

    def log(self) -> str:
        return self._log.read_text()

    def end(self) -> int:
        self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(ANSWER_S)
        finally:
            self.process.kill()


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    started = Daemon(tmp_path)
    started.logged("started file=")
    yield started
    if started.process.poll() is None:
        started.end()


def canshaper(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, list(arguments), prog_name="canshaper")
    return result.exit_code, result.output


@pytest.mark.slow
def test_set_shows_and_changes_and_a_reload_takes_it_back(daemon: Daemon) -> None:
    file = str(daemon.file)
    status, shown = canshaper("set", file)
    assert status == 0
    assert re.search(rf"{PERIOD} +2\.356 +2\.356 +1\.8 +3\b", shown), shown
    status, reported = canshaper("set", file, f"{PERIOD}=2.5")
    assert (status, reported.splitlines()[0]) == (0, f"{PERIOD}: 2.356 -> 2.5")
    assert "Not written: lost when the daemon ends" in reported
    daemon.logged(rf"set {PERIOD}=2\.5 was=2\.356 by=\S+ uid={os.getuid()} pid={os.getpid()}\n")
    assert daemon.file.read_text(encoding="utf-8") == daemon.text
    table = json.loads(canshaper("set", file, "--json")[1])
    assert table == {PERIOD: {"now": 2.5, "file": 2.356, "low": 1.8, "high": 3.0}}
    daemon.process.send_signal(signal.SIGHUP)
    daemon.logged("reload=applied")
    table = json.loads(canshaper("set", file, "--json")[1])
    assert table[PERIOD]["now"] == 2.356


@pytest.mark.slow
def test_set_writes_when_asked(daemon: Daemon) -> None:
    """What was measured before is gone, and where it came from."""
    speed, origin = "full_speed_m_s: 1.5", ", origin: { date: 2026-11-23, by: me }"
    daemon.file.write_text(daemon.text.replace(speed, speed + origin, 1), encoding="utf-8")
    status, reported = canshaper("set", str(daemon.file), f"{PERIOD}=2.5", "--write")
    assert (status, reported.splitlines()[-1]) == (0, f"Written to {daemon.file}.")
    assert daemon.file.read_text(encoding="utf-8") == daemon.text.replace(
        "period_s: 2.356", "period_s: 2.5"
    )


@pytest.mark.slow
def test_set_reports_what_is_refused_and_writes_nothing(daemon: Daemon) -> None:
    status, reported = canshaper("set", str(daemon.file), f"{PERIOD}=4", "--write")
    assert (status, reported) == (1, f"{PERIOD}: expected 1.8 to 3, got 4\n")
    daemon.logged(rf"set=refused by=\S+ uid=\d+ pid=\d+ {PERIOD}: expected 1.8 to 3, got 4")
    assert daemon.file.read_text(encoding="utf-8") == daemon.text
    status, reported = canshaper("set", str(daemon.file), PERIOD)
    assert (status, reported.splitlines()[0][:23]) == (2, "expected KEY=NUMBER, as")


@pytest.mark.slow
def test_set_without_a_daemon_or_a_section(tmp_path: Path) -> None:
    daemon = Daemon(tmp_path)
    daemon.logged("started file=")
    assert daemon.end() == 0
    assert not (tmp_path / "control.sock").exists()
    status, reported = canshaper("set", str(daemon.file))
    assert (status, "control.sock: No such file" in reported) == (1, True)
    status, reported = canshaper("set", "forwarder.yaml")
    assert (status, "has no control section" in reported) == (2, True)


def test_an_option_without_a_section_is_an_error() -> None:
    status, reported = canshaper("run", "forwarder.yaml", "--control", "x.sock")
    assert (status, "--control: the deployment file has no control section" in reported) == (
        2,
        True,
    )


@pytest.mark.slow
def test_one_that_listens_reports_its_status_and_no_valve(tmp_path: Path) -> None:
    """Next to another controller on the same bus, whose frames have the ids of our valves."""
    deployment = load_deployment(ROOT / "config" / "forwarder.yaml")
    names = ("JoystickLeft", "SlewCommand", "SlewStatus", "ShaperStatus")
    entries = [deployment.messages.find(name) for name in names]
    joystick, command, status, service = (one[1] for one in entries if not isinstance(one, str))
    daemon = Daemon(tmp_path, "--listen-only")
    daemon.logged("listen-only=yes valves=none")
    daemon.logged("started file=")
    received: set[int] = set()
    states: list[str] = []
    reasons: set[str] = set()
    shaped = 0.0
    counters = {}
    with LocalMulticastBus(GROUP) as bus:
        begin = time.monotonic()
        mine: list[bytes] = []
        for number in range(10_000):
            deflection = 100.0 if number > 50 else 0.0
            values = {s.name: 0 for s in joystick.signals}
            values |= {"Slew": deflection, "Enable": 1, "AliveCounter": number % 256}
            for message, fields in (
                (joystick, values),
                (command, {"Velocity": 0, "AliveCounter": 0}),
            ):
                data = message.encode(fields)
                can_id = message.frame_id
                bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
                mine.append(data)
            until = time.monotonic() + 0.01
            while (left := until - time.monotonic()) > 0:
                got = bus.recv(left)
                if got is None or bytes(got.data) in mine[-4:]:  # multicast brings our own back
                    continue
                received.add(got.arbitration_id)
                if got.arbitration_id == status.frame_id:
                    decoded = status.decode(bytes(got.data))
                    states.append(str(decoded["State"]))
                    reasons.add(str(decoded["Reason"]))
                    shaped = max(shaped, decoded["ShapedCommand"])
                if got.arbitration_id == service.frame_id:
                    counters = service.decode(bytes(got.data))
            if shaped > 40 and counters:
                break
            assert time.monotonic() - begin < ANSWER_S, (states, shaped, counters)
    assert daemon.end() == 0
    assert "stopped valves=not-sent" in daemon.log()
    sent = {a.valve.message.key[1] for a in deployment.axes.values()}
    assert "ACTIVE" in states
    assert "SECOND_SENDER" not in reasons  # a stall of the machine may trip it
    assert "SECOND_SENDER" not in daemon.log()
    assert not received & sent
