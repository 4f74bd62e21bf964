"""Parts of a machine for tests: joysticks by plain cantools, the daemon as a process, a wait."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import can
import cantools

from tests.rigs.files import ROOT

FILE = ROOT / "config" / "forwarder.yaml"
DBC = cantools.database.load_file(ROOT / "dbc" / "forwarder.dbc")
DBC.add_dbc_file(ROOT / "dbc" / "sway-sensor.dbc")
# Only to end a test that hangs; emulated processors are slow.
ANSWER_S = 120.0
JOYSTICKS = (("JoystickLeft", ("Slew", "NearFar")), ("JoystickRight", ("Lift", "Rotate")))
VALVES = {"SlewCommand", "NearFarCommand", "LiftCommand"}


def open_bus(channel: str) -> can.BusABC:
    return can.Bus(interface="socketcan", channel=channel, ignore_config=True)


def message_name(message: can.Message) -> str | None:
    if message.is_error_frame or message.is_remote_frame:
        return None
    try:
        return DBC.get_message_by_frame_id(message.arbitration_id).name
    except KeyError:
        return None


Accept = Callable[[dict], bool]


def wait_for(bus: can.BusABC, name: str, accept: Accept) -> dict:
    """The first message of that name whose decoded signals are accepted."""
    return wait_for_one(bus, {name: accept})[1]


def drive(bus: can.BusABC, joysticks: "Joysticks", faster_than: float = 30.0) -> float:
    """Bring slew into motion and return the command, %.

    Where this machine held up a joystick's frames and the axis stopped, once more from neutral.
    """
    until = time.monotonic() + ANSWER_S
    state = ""
    while time.monotonic() < until:
        message = bus.recv(1.0)
        name = message_name(message) if message is not None else None
        if message is None or name not in ("SlewStatus", "SlewCommand"):
            continue
        signals = dict(DBC.decode_message(name, message.data))
        if name == "SlewStatus":
            state = str(signals["State"])
            joysticks.values["Slew"] = 100.0 if state in ("READY", "ACTIVE") else 0.0
            joysticks.switches["Reset"] = int(state == "TRIPPED")
        # before that it may be the end of a stop that began before this test
        elif state == "ACTIVE" and signals["Velocity"] > faster_than:
            return float(signals["Velocity"])
    raise AssertionError(f"slew never above {faster_than} %")


def wait_for_one(bus: can.BusABC, expected: dict[str, Accept]) -> tuple[str, dict]:
    """The first message of these names that is accepted: its name and its decoded signals."""
    until = time.monotonic() + ANSWER_S
    last: dict[str, dict] = {}
    while time.monotonic() < until:
        try:
            message = bus.recv(1.0)
        except can.CanError:  # once, when the interface goes down
            continue
        name = message_name(message) if message is not None else None
        if message is not None and name in expected:
            last[name] = dict(DBC.decode_message(name, message.data))
            if expected[name](last[name]):
                return name, last[name]
    raise AssertionError(f"none of {list(expected)} within {ANSWER_S:g} s; the last were {last}")


class Joysticks(threading.Thread):
    """Both joysticks, sent every 20 ms; set ``values`` or ``silent`` at any time."""

    def __init__(self, channel: str) -> None:
        super().__init__(daemon=True)
        self._bus = open_bus(channel)
        self.values = {"Slew": 0.0, "NearFar": 0.0, "Lift": 0.0, "Rotate": 0.0}
        self.switches = {"Enable": 1, "AntiSwayOff": 0, "Reset": 0}
        self.silent = False
        self._ended = threading.Event()

    def run(self) -> None:
        count = 0
        while not self._ended.wait(0.02):
            count = (count + 1) % 256
            if self.silent:
                continue
            with suppress(can.CanError):  # the interface may be down
                self._send(count)

    def _send(self, count: int) -> None:
        for name, joysticks in JOYSTICKS:
            message = DBC.get_message_by_name(name)
            signals = {s: self.values[s] for s in joysticks}
            data = message.encode({**signals, **self.switches, "AliveCounter": count})
            self._bus.send(
                can.Message(arbitration_id=message.frame_id, is_extended_id=False, data=data)
            )

    def end(self) -> None:
        self._ended.set()
        self.join()
        self._bus.shutdown()


@contextmanager
def joysticks_on(channel: str) -> Iterator[Joysticks]:
    joysticks = Joysticks(channel)
    joysticks.start()
    try:
        yield joysticks
    finally:
        joysticks.end()


class Service:
    """``canshaper VERB`` as a process with its log."""

    def __init__(self, log: Path, *arguments: str) -> None:
        self.log = log
        with log.open("wb") as file:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "canshaper", *arguments], stderr=file, stdout=file
            )
        # As the unit does; without the right to it, it runs like the rest.
        if arguments[0] == "run" and "--priority" not in arguments:
            with suppress(PermissionError):
                os.sched_setscheduler(self.process.pid, os.SCHED_FIFO, os.sched_param(40))

    def text(self) -> str:
        return self.log.read_text()

    def wait_log(self, pattern: str) -> None:
        """Wait until the log has a line like this."""
        until = time.monotonic() + ANSWER_S
        while not re.search(pattern, self.text()):
            assert self.process.poll() is None, f"ended early:\n{self.text()}"
            assert time.monotonic() < until, f"no {pattern!r} in the log:\n{self.text()}"
            time.sleep(0.02)

    def end(self, number: int = signal.SIGTERM) -> int:
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(ANSWER_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise


@contextmanager
def service(log: Path, *arguments: str) -> Iterator[Service]:
    running = Service(log, *arguments)
    try:
        yield running
    finally:
        running.end()


@contextmanager
def candump(log: Path, channel: str) -> Iterator[None]:
    """An independent log of a channel in candump's format, complete when the block is left."""
    probe = can.Message(arbitration_id=0x7FE, is_extended_id=False)
    with log.open("wb") as file, open_bus(channel) as bus:
        process = subprocess.Popen(["candump", "-L", channel], stdout=file)
        try:
            _greet(bus, probe, log, 1)
            yield
            _greet(bus, probe, log, log.read_text(errors="replace").count("7FE#") + 1)
        finally:
            process.terminate()
            process.wait(ANSWER_S)


def _greet(bus: can.BusABC, probe: can.Message, log: Path, expected: int) -> None:
    """Send probes until candump has written so many of them: what came before is in the log."""
    until = time.monotonic() + ANSWER_S
    while log.read_text(errors="replace").count("7FE#") < expected:
        assert time.monotonic() < until, "candump writes nothing"
        bus.send(probe)
        time.sleep(0.02)


def logged(log: Path) -> list[can.Message]:
    """Messages of a candump log without the probes."""
    with can.CanutilsLogReader(log) as reader:
        return [m for m in reader if m.arbitration_id != 0x7FE]
