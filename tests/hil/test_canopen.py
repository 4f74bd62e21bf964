"""The daemon on CANopen: joysticks, valves and their faults are those of the library canopen."""

import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import groupby
from pathlib import Path

import cantools
import pytest

from tests.hil.canopen_nodes import (
    ACTIVE,
    DISABLED,
    FAULT_HOLD,
    FLOW_COMMAND_LATE,
    HOLD,
    INIT,
    Machine,
    machine_on,
)
from tests.hil.machine import ANSWER_S, Service, candump, logged, open_bus, service
from tests.rigs.files import ROOT, machine_file

FILE = ROOT / "config" / "canopen-forwarder.yaml"
# An emulated machine stands still now and then, for longer than a joystick of 20 ms may.
PATIENCE = (
    ("timeout_ms: 100 #", "timeout_ms: 600 #"),
    ("timeout_ms: 300", "timeout_ms: 900"),
    ("heartbeat_ms: 500", "heartbeat_ms: 1500"),
    ("stop_distance_m: 4.7", "stop_distance_m: 13"),
    ("stop_distance_m: 0.95", "stop_distance_m: 3"),
)
DBC = cantools.database.load_file(ROOT / "dbc" / "canopen-cia401-cia408.dbc")
SLEW_STATUS, LIFT_STATUS, SLEW_COMMAND, PROBE = 0x6A0, 0x6A2, 0x220, 0x7FE
LEFT_JOYSTICK = 0x190
# Frames of a joystick while the daemon is stopped: 1.2 s, twice as long as any input may be old.
STOOD_FRAMES = 60


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    with machine_on(tmp_path, interface="socketcan", channel="vcan0") as running:
        yield running


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The shipped deployment with more patience."""
    return machine_file(tmp_path, FILE, *PATIENCE)


@pytest.fixture
def daemon(machine: Machine, file: Path, tmp_path: Path) -> Iterator[Service]:
    with service(tmp_path / "daemon.log", "run", str(file)) as running:
        running.wait_log("started file=")
        yield running


def until(accept: Callable[[], bool], what: str) -> None:
    """Wait for something of the nodes; the clock only ends a test that hangs."""
    end = time.monotonic() + ANSWER_S
    while not accept():
        assert time.monotonic() < end, what
        time.sleep(0.01)


def wait_state(
    state: str, reason: str | None = None, status: int = SLEW_STATUS, within_s: float = ANSWER_S
) -> None:
    """Until the status of an axis says so."""
    with open_bus("vcan0") as bus:
        last = None
        end = time.monotonic() + within_s
        while time.monotonic() < end:
            message = bus.recv(1.0)
            if message is None or message.arbitration_id != status:
                continue
            last = DBC.decode_message(status, message.data)
            if str(last["State"]) == state and reason in (None, str(last["Reason"])):
                return
    raise AssertionError(f"no {state} {reason}, the last was {last}")


def drive(machine: Machine) -> None:
    """Bring slew into motion."""
    wait_state("READY")
    machine.joysticks["left"].x = 32767
    until(lambda: machine.valves["slew"].spool > 8000, "the spool follows")


def reset(machine: Machine) -> None:
    """The operator lets go and presses reset: again where it was no rising edge.

    After a standstill it is none while the first frames of the joystick do not count yet.
    """
    machine.joysticks["left"].x = 0
    wait_state("TRIPPED")
    until(lambda: machine.valves["slew"].state == ACTIVE, "the valve works again")
    left = machine.joysticks["left"]
    for _ in range(5):
        left.switches = 0b11
        with suppress(AssertionError):
            wait_state("READY", within_s=2.0)
        left.switches = 0b01
        with suppress(AssertionError):
            wait_state("READY", within_s=1.0)
            return
    raise AssertionError("five times reset, and not READY")


def commands(log: Path, can_id: int = SLEW_COMMAND) -> list[tuple[float, int, int]]:
    """Time, control word and set point of each frame."""
    points = []
    for message in logged(log):
        if message.arbitration_id == can_id:
            raw = DBC.decode_message(can_id, message.data, decode_choices=False, scaling=False)
            points.append((message.timestamp, raw["ControlWord"], raw["SetPoint"]))
    return points


def changes(points: list[tuple[float, int, int]]) -> list[int]:
    """The control words in their order."""
    return [word for word, _ in groupby(word for _, word, _ in points)]


def test_nodes_are_started_and_the_set_point_follows_the_joystick(
    machine: Machine, file: Path, tmp_path: Path
) -> None:
    log = tmp_path / "drive.log"
    with candump(log, "vcan0"), service(tmp_path / "daemon.log", "run", str(file)) as daemon:
        daemon.wait_log("started file=")
        drive(machine)
        assert machine.valves["lift"].spool == 0
        machine.joysticks["left"].x = 0
        until(lambda: machine.valves["slew"].spool == 0, "the spool returns")
        wait_state("READY")
        machine.joysticks["left"].x = -32767
        until(lambda: machine.valves["slew"].spool < -8000, "the spool follows")
        assert daemon.end() == 0
        assert "fault=" not in daemon.text()
    assert machine.valves["slew"].words == [INIT, DISABLED, HOLD, ACTIVE, HOLD]
    points = commands(log)
    assert changes(points) == [INIT, DISABLED, HOLD, ACTIVE, HOLD]
    assert all(-0x4000 <= point <= 0x4000 for _, _, point in points)
    assert all(point == 0 for _, word, point in points if word != ACTIVE)
    assert points[-1][1:] == (HOLD, 0)
    messages = logged(log)
    started = {m.data[1] for m in messages if m.arbitration_id == 0}
    assert started == {0x10, 0x11, 0x20, 0x21, 0x22}
    assert {bytes(m.data)[:1] for m in messages if m.arbitration_id == 0} == {b"\x01"}
    ours = [bytes(m.data) for m in messages if m.arbitration_id == 0x77E]
    assert ours[0] == b"\x00"
    assert set(ours[1:]) == {b"\x05"}
    judge_by_tshark(log)


def judge_by_tshark(log: Path) -> None:
    """Every frame of the log is CANopen to it, without an error."""
    if shutil.which("tshark") is None:
        print("no tshark here: candump and cantools alone have judged")
        return
    fields = ("_ws.col.Protocol", "_ws.malformed", "_ws.expert.severity", "can.id")
    command = ["tshark", "-r", str(log), "-d", "can.subdissector,canopen", "-T", "fields"]
    command += [word for field in fields for word in ("-e", field)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    rows = [row for row in rows if int(row[3], 0) != PROBE]
    assert len(rows) == len(logged(log))
    assert {(*row[:3],) for row in rows} == {("CANopen", "", "")}


def test_an_emergency_in_motion_is_neutral_named_reset_and_on_again(
    machine: Machine, daemon: Service, tmp_path: Path
) -> None:
    log = tmp_path / "emergency.log"
    with candump(log, "vcan0"):
        drive(machine)
        machine.valves["slew"].fault(FLOW_COMMAND_LATE)
        wait_state("TRIPPED", "VALVE_FAULT")
        daemon.wait_log(r"node=slew state=OPERATIONAL emergency=0x8003")
        daemon.wait_log(r"axis=slew state=TRIPPED from=ACTIVE reason=VALVE_FAULT")
        reset(machine)
        machine.joysticks["left"].x = 32767
        until(lambda: machine.valves["slew"].spool > 8000, "the spool follows again")
    messages = logged(log)
    reported = next(m.timestamp for m in messages if m.arbitration_id == 0xA0 and any(m.data[:2]))
    after = [c for c in commands(log) if c[0] > reported]
    again = next(i for i, c in enumerate(after) if c[1] == ACTIVE and i > 3)
    # One frame may be under way already.
    assert all(point == 0 for _, _, point in after[1:again])
    assert FAULT_HOLD in [word for _, word, _ in after[:again]]
    assert machine.valves["slew"].words[-3:] == [FAULT_HOLD, HOLD, ACTIVE]


def stand_still(daemon: Service, meanwhile: Callable[[], None]) -> None:
    """Stop the daemon for longer than any input may be old; what is sent waits in its sockets."""
    with open_bus("vcan0") as bus:
        daemon.process.send_signal(signal.SIGSTOP)
        meanwhile()
        end, frames = time.monotonic() + ANSWER_S, 0
        while frames < STOOD_FRAMES:
            assert time.monotonic() < end, "the joystick sends"
            message = bus.recv(1.0)
            frames += message is not None and message.arbitration_id == LEFT_JOYSTICK
        daemon.process.send_signal(signal.SIGCONT)


def test_an_emergency_of_a_standstill_counts_until_it_is_over(
    machine: Machine, daemon: Service
) -> None:
    """Though the valve follows: only its emergency message says that something is wrong."""
    valve = machine.valves["slew"]
    wait_state("READY")
    stand_still(daemon, lambda: valve.node.emcy.send(FLOW_COMMAND_LATE, 0x81))
    wait_state("NEUTRAL_WAIT", "NODE_FAULT")
    wait_state("READY", status=LIFT_STATUS)
    machine.joysticks["left"].x = 32767
    wait_state("NEUTRAL_WAIT", "NODE_FAULT")
    assert valve.spool == 0
    machine.joysticks["left"].x = 0
    valve.node.emcy.reset()
    drive(machine)

    def over() -> None:
        valve.node.emcy.send(FLOW_COMMAND_LATE, 0x81)
        valve.node.emcy.reset()

    stand_still(daemon, over)
    wait_state("TRIPPED", "LOOP_STALLED")
    reset(machine)


def test_a_lost_heartbeat_in_motion(machine: Machine, daemon: Service, tmp_path: Path) -> None:
    log = tmp_path / "heartbeat.log"
    with candump(log, "vcan0"):
        drive(machine)
        machine.valves["slew"].dead = True
        wait_state("TRIPPED", "VALVE_FAULT")
        daemon.wait_log(r"node=slew state=lost")
        machine.valves["slew"].dead = False
        reset(machine)
    points = commands(log)
    last = max(i for i, (_, _, point) in enumerate(points) if point)
    assert points[last][1] == ACTIVE
    assert points[last + 1][1:] == (INIT, 0)  # and then from the beginning
    assert changes(points[last + 1 :]) == [INIT, DISABLED, HOLD, ACTIVE]


def test_a_node_that_restarts_in_motion(machine: Machine, daemon: Service, tmp_path: Path) -> None:
    log = tmp_path / "restart.log"
    with candump(log, "vcan0"):
        drive(machine)
        machine.valves["slew"].boot()
        wait_state("TRIPPED", "VALVE_FAULT")
        reset(machine)
        machine.joysticks["left"].x = 32767
        until(lambda: machine.valves["slew"].spool > 8000, "the spool follows again")
    # What it was sent since it booted, the frame that was under way left out.
    words = machine.valves["slew"].words
    assert words[-4:] == [INIT, DISABLED, HOLD, ACTIVE]
    boots = [m.timestamp for m in logged(log) if m.arbitration_id == 0x720 and m.data[0] == 0]
    starts = [m.timestamp for m in logged(log) if m.arbitration_id == 0 and m.data[1] == 0x20]
    assert any(start > boots[-1] for start in starts)
    after = [c for c in commands(log) if c[0] > boots[-1]]
    until_active = next(i for i, c in enumerate(after) if i > 3 and c[1] == ACTIVE)
    assert all(point == 0 for _, _, point in after[1:until_active])


def test_a_joystick_that_boots_in_motion_stops_shaped(machine: Machine, daemon: Service) -> None:
    drive(machine)
    machine.joysticks["left"].node.nmt.state = "INITIALISING"
    daemon.wait_log(r"axis=slew state=STOPPING from=ACTIVE reason=NODE_FAULT")
    machine.joysticks["left"].node.nmt.state = "PRE-OPERATIONAL"  # our master starts it again
    machine.joysticks["left"].x = 0
    wait_state("READY")


def test_a_second_one_with_our_heartbeat_is_named(machine: Machine, daemon: Service) -> None:
    wait_state("READY")

    def named() -> bool:
        machine.network.send_message(
            0x77E, [5]
        )  # again: the log reports the last fault of a second
        return "fault=SECOND_SENDER" in daemon.text()

    until(named, "the second one is named")
