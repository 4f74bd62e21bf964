"""Every other shipped deployment of CANopen, on nodes of the library canopen with its own PDOs."""

import re
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import yaml

from tests.hil.canopen_nodes import (
    SERVO_VALVE,
    VALVE,
    VALVE_WITH_MODE,
    Drive,
    Machine,
    Parts,
    Valve,
    machine_on,
)
from tests.hil.j1939_drive import set_points
from tests.hil.j1939_nodes import Joysticks
from tests.hil.machine import ANSWER_S, Service, candump, logged, service
from tests.rigs.files import text_of

SHIPPED = {
    "canopen-sensor": Parts(VALVE, inclinometer=0x30),
    "cia402-forwarder": Parts(VALVE, drive=0x23),
    "moog-forwarder": Parts(SERVO_VALVE),
    "pvedcc-forwarder": Parts(VALVE_WITH_MODE, joysticks=False),
}
FULL = {"cia402-forwarder": 30_000}  # steps of 0.1 rpm; of CiA 408: 0x4000
# Set points on the way to full speed and back: a filter makes tens of them, its limits alone ten.
SHAPED = 20
# An emulated machine stands still now and then, for longer than a joystick of 20 ms may.
PATIENCE = (
    (r"timeout_ms: (80|100)\b", r"timeout_ms: 600"),
    (r"timeout_ms: 300\b", r"timeout_ms: 900"),
    (r"heartbeat_ms: 500\b", r"heartbeat_ms: 1500"),
    (r"stop_distance_m: [\d.]+", r"stop_distance_m: 13"),
)


class Deployment:
    """A shipped deployment in motion: its nodes, its joysticks, the daemon's log."""

    def __init__(self, name: str, file: Path, machine: Machine, daemon: Service) -> None:
        self.full = FULL.get(name, 0x4000)
        self.file = file
        self.machine = machine
        self.daemon = daemon
        self.j1939: Joysticks | None = None

    @property
    def actuator(self) -> Drive | Valve:
        """The node of the slew valve."""
        return self.machine.drive or self.machine.valves["slew"]

    def state(self) -> str:
        """State of the slew axis, by the daemon's log."""
        states = re.findall(r"axis=slew state=(\w+)", self.daemon.text())
        return states[-1] if states else "NEUTRAL_WAIT"

    def move(self, part: float, accept: Callable[[int], bool]) -> None:
        """Deflect the joystick of slew by this part of its way until the node has that velocity.

        Where this machine stood still and the axis tripped, reset and once more from neutral.
        """
        until = time.monotonic() + ANSWER_S
        while not (self.state() == "ACTIVE" and accept(self.actuator.spool)):
            assert time.monotonic() < until, self.daemon.text()
            state = self.state()
            self.hold(part if state in ("READY", "ACTIVE") else 0.0)
            # pressed for half of every second, so that there is a rising edge again
            self.reset(pressed=state == "TRIPPED" and time.monotonic() % 1.0 < 0.5)
            time.sleep(0.05)

    def let_go(self) -> None:
        """Joystick released, until the node stands."""
        self.hold(0.0)
        self.until_zero()

    def until_zero(self) -> None:
        until = time.monotonic() + ANSWER_S
        while self.actuator.spool:
            assert time.monotonic() < until, self.daemon.text()
            time.sleep(0.05)

    def hold(self, part: float) -> None:
        if self.j1939:
            self.j1939.x = 100.0 * part
        else:
            self.machine.joysticks["left"].x = round(0x7FFF * part)

    def reset(self, *, pressed: bool) -> None:
        if self.j1939:
            self.j1939.reset = pressed
        else:
            self.machine.joysticks["left"].switches = 0b11 if pressed else 0b01


def patient(name: str, folder: Path) -> Path:
    """The shipped deployment with more patience."""
    text = text_of(name)
    for old, new in PATIENCE:
        text, count = re.subn(old, new, text)
        assert count, old
    file = folder / f"{name}.yaml"
    file.write_text(text)
    return file


@contextmanager
def deployed(name: str, folder: Path) -> Iterator[tuple[Deployment, dict[str, Path]]]:
    """All of it on its buses; and the log of candump for each of these."""
    file = patient(name, folder)
    buses = yaml.safe_load(file.read_text())["buses"].values()
    channel = next(bus["channel"] for bus in buses if "canopen" in bus)
    logs = {bus["channel"]: folder / f"{bus['channel']}.log" for bus in buses}
    bus = {"interface": "socketcan", "channel": channel}
    with ExitStack() as running:
        for one, log in logs.items():
            running.enter_context(candump(log, one))
        machine = running.enter_context(machine_on(folder, SHIPPED[name], **bus))
        daemon = running.enter_context(service(folder / "daemon.log", "run", str(file)))
        daemon.wait_log("started file=")
        deployment = Deployment(name, file, machine, daemon)
        if not SHIPPED[name].joysticks:
            deployment.j1939 = Joysticks()
            deployment.j1939.start()
            running.callback(deployment.j1939.end)
        yield deployment, logs


@pytest.mark.parametrize("name", SHIPPED)
def test_a_joystick_moves_the_node_shaped_and_a_lost_node_is_neutral(
    tmp_path: Path, name: str
) -> None:
    with deployed(name, tmp_path) as (deployment, logs):
        most = 0.9 * deployment.full
        deployment.move(1.0, lambda spool: spool > most)
        deployment.let_go()
        deployment.move(-1.0, lambda spool: spool < -most)
        daemon, machine = deployment.daemon, deployment.machine
        if machine.inclinometer:  # without it the valve is driven on
            machine.inclinometer.fall_silent()
            daemon.wait_log("node=tool state=lost")
            deployment.move(-1.0, lambda spool: spool < -most)
        deployment.actuator.fall_silent()
        daemon.wait_log(r"axis=slew state=TRIPPED from=ACTIVE reason=VALVE_FAULT")
        deployment.until_zero()
        assert machine.valves["near_far"].spool == 0
        assert daemon.end() == 0, daemon.text()
    points = set_points(logs, deployment.file, "slew")
    assert len({point for point in points if point > 0}) > SHAPED
    assert max(points) <= deployment.full >= -min(points)
    assert points[0] == points[-1] == 0
    judge_the_rest(logs, name)


def judge_the_rest(logs: dict[str, Path], name: str) -> None:
    """The object behind the set point: the device mode of a PVED-CC, a servo valve's pressure."""
    can_id, content = {
        "pvedcc-forwarder": (0x220, b"\x01"),
        "moog-forwarder": (0x520, b"\x00\x00"),
    }.get(name, (None, b""))
    frames = [m for log in logs.values() for m in logged(log) if m.arbitration_id == can_id]
    assert {bytes(m.data[4:]) for m in frames} == ({content} if can_id else set())
