"""The daemon on vcan0: life and faults, seen from foreign tools and plain cantools."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from tests.hil.machine import (
    ANSWER_S,
    FILE,
    VALVES,
    Joysticks,
    Service,
    candump,
    drive,
    joysticks_on,
    logged,
    message_name,
    open_bus,
    service,
    wait_for,
)
from tests.rigs.files import machine_file

HUGE_PAGES = Path("/sys/kernel/mm/transparent_hugepage")
PAUSE = HUGE_PAGES / "khugepaged/scan_sleep_millisecs"
# A process like the daemon, but for the one call.
LARGE = """
from canshaper.daemon.realtime import lock_memory
kept = [bytes(100) for _ in range(100_000)]
assert lock_memory() is None
print("ready", flush=True)
input()
"""


def state(name: str) -> Callable[[dict], bool]:
    return lambda status: str(status["State"]) == name


def test_joystick_moves_valve_and_everything_ends_neutral(
    bus: can.BusABC, joysticks: Joysticks, daemon: Service, tmp_path: Path
) -> None:
    drive(bus, joysticks)
    status = wait_for(bus, "SlewStatus", state("ACTIVE"))
    assert str(status["Reason"]) == "JOYSTICK_MOVED"
    assert status["RawCommand"] == 100.0
    with candump(tmp_path / "end.log", "vcan0"):
        assert daemon.end(signal.SIGTERM) == 0
    last = {}
    for message in logged(tmp_path / "end.log"):
        last[message_name(message)] = message.data[0]
    assert {name: last[name] for name in VALVES} == dict.fromkeys(VALVES, 0)
    assert "stopped valves=neutral" in daemon.text()


def test_bad_frames_are_counted_and_named_and_move_nothing(
    bus: can.BusABC, joysticks: Joysticks, daemon: Service, tmp_path: Path
) -> None:
    wait_for(bus, "SlewStatus", state("READY"))
    cases = (
        ("110#E803E803", "WRONG_LENGTH", "WrongLength"),  # full deflection in a frame too short
        ("555#E803E80301000001", "UNKNOWN_ID", "UnknownId"),
        ("00000110#E803E80301000001", "UNKNOWN_ID", "UnknownId"),  # the number, but 29 bits
        ("20000004#0004000000000000", "ERROR_FRAME", "ErrorFrames"),
        ("110#R", "WRONG_LENGTH", "WrongLength"),
    )
    with candump(tmp_path / "bad.log", "vcan0"):
        for frame, fault, counter in cases:
            while bus.recv(0):  # what was sent before counts no more
                pass
            before = wait_for(bus, "ShaperStatus", lambda s: True)[counter]
            subprocess.run(["cansend", "vcan0", frame], check=True)
            status = wait_for(bus, "ShaperStatus", lambda s, c=counter, b=before: s[c] > b)
            assert (frame, status[counter]) == (frame, before + 1)
            assert str(status["LastFault"]) in (fault, "MISSED_DEADLINE")
    valve = [m for m in logged(tmp_path / "bad.log") if message_name(m) in VALVES]
    assert valve
    assert all(m.data[0] == 0 for m in valve)
    assert daemon.process.poll() is None


def test_interface_down_and_up_is_survived(
    bus: can.BusABC, joysticks: Joysticks, daemon: Service
) -> None:
    wait_for(bus, "SlewStatus", state("READY"))
    subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
    try:
        daemon.wait_log("fault=")
        assert daemon.process.poll() is None
    finally:
        subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    with open_bus("vcan0") as again, joysticks_on("vcan0"):
        wait_for(again, "SlewStatus", state("READY"))


def test_reload_refuses_a_broken_file_and_applies_a_good_one_in_neutral(
    bus: can.BusABC, joysticks: Joysticks, tmp_path: Path
) -> None:
    file = machine_file(tmp_path, FILE)
    text = file.read_text()
    with service(tmp_path / "daemon.log", "run", str(file)) as daemon:
        daemon.wait_log("started file=")
        drive(bus, joysticks)
        file.write_text(text.replace("deadband_pct: 5", "deadband_pct: 90", 1))
        daemon.process.send_signal(signal.SIGHUP)
        wait_for(bus, "SlewCommand", lambda v: v["Velocity"] > 90.0)  # goes on in motion
        assert "reload=waiting" in daemon.text()
        assert "reload=refused" not in daemon.text()
        joysticks.values["Slew"] = 0.0
        daemon.wait_log(r"reload=refused .*machine\.yaml:\d+: axes\.slew\.limits\.deadband_pct")
        file.write_text(text.replace("deadband_pct: 5", "max_pct: 40, deadband_pct: 5", 1))
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_log("reload=applied")
        wait_for(bus, "SlewStatus", state("READY"))
        joysticks.values["Slew"] = 100.0
        wait_for(bus, "SlewStatus", lambda s: s["ShapedCommand"] > 35.0)
        joysticks.values["Slew"] = 0.0
        held = wait_for(bus, "SlewStatus", state("READY"))
        assert held["ShapedCommand"] == 0.0


@pytest.fixture
def khugepaged() -> Iterator[None]:
    """Let the kernel join pages, though not before ``PAUSE`` is shorter."""
    settings = {
        PAUSE: "1000000",
        HUGE_PAGES / "enabled": "always",
        HUGE_PAGES / "khugepaged/pages_to_scan": "100000",
    }
    if not HUGE_PAGES.exists():
        pytest.skip("this kernel has no transparent huge pages")
    before = {file: file.read_text() for file in settings}
    before[HUGE_PAGES / "enabled"] = before[HUGE_PAGES / "enabled"].split("[")[1].split("]")[0]
    for file, value in settings.items():
        file.write_text(value)
    yield
    for file, value in before.items():
        file.write_text(value)


def done(what: str) -> int:
    """How often khugepaged has done something."""
    return int((HUGE_PAGES / "khugepaged" / what).read_text())


def huge_kb(process: int) -> int:
    """Memory of a process in huge pages."""
    lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith("AnonHugePages")))


@pytest.mark.usefixtures("khugepaged")
def test_the_kernel_does_not_join_pages_of_the_daemon(tmp_path: Path) -> None:
    """Joining them held up even a loop with priority for 1.4 ms each, and it came unforeseen."""
    with service(tmp_path / "daemon.log", "run", str(FILE)) as daemon:
        daemon.wait_log("started file=")
        ours, joined = huge_kb(daemon.process.pid), done("pages_collapsed")
        command = [sys.executable, "-c", LARGE]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
            assert other.stdout is not None
            assert other.stdout.readline() == b"ready\n"
            PAUSE.write_text("100")
            enough, until = done("full_scans") + 3, time.monotonic() + ANSWER_S
            while done("pages_collapsed") == joined or done("full_scans") < enough:
                assert time.monotonic() < until, "the kernel joins no pages at all"
                time.sleep(0.1)
            other.communicate(b"\n")
        assert huge_kb(daemon.process.pid) == ours
