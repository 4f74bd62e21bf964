"""A bus is a device: names change hands under the daemon, and the other crane receives nothing.

Our crane is a CAN controller with a place on the PCI bus. The other crane is vcan1: what gets the
name of ours. candump on it is the witness.
"""

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.hil.machine import (
    ANSWER_S,
    FILE,
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

OTHER_CRANE = "vcan1"
JOYSTICKS = {"JoystickLeft", "JoystickRight"}
# Frames of each joystick of the other crane: ten looks at the name, one every 0.2 s.
FRAMES = 100
DRIVER = Path("/sys/bus/pci/drivers/kvaser_pci")


def ip(*words: str) -> None:
    subprocess.run(["ip", "link", *words], check=True)


def set_up(name: str, bitrate: int = 250_000) -> None:
    ip("set", name, "up", "type", "can", "bitrate", str(bitrate))


def place_of(name: str) -> str:
    """Address on the PCI bus."""
    return Path(f"/sys/class/net/{name}/device").resolve().name


def deployment(folder: Path, channel: str, place: str) -> Path:
    """The shipped machine on the controller at that place."""
    match = f'match: {{ path: "pci-{place}", driver: kvaser_pci, bitrate: 250000 }}'
    return machine_file(folder, FILE, ("channel: vcan0,", f"channel: {channel}, {match},"))


@contextmanager
def named(old: str, new: str) -> Iterator[None]:
    """An interface under another name."""
    ip("set", old, "down")
    ip("set", old, "name", new)
    ip("set", new, "up")
    try:
        yield
    finally:
        ip("set", new, "down")
        ip("set", new, "name", old)
        ip("set", old, "up")


def frames_of(log: Path, name: str) -> int:
    return sum(message_name(message) == name for message in logged(log))


def witness(folder: Path, channel: str) -> set[str | None]:
    """Frames on the other crane's bus while its joysticks are moved under the name of ours."""
    log = folder / "other.log"
    until = time.monotonic() + ANSWER_S
    with candump(log, channel), joysticks_on(channel) as joysticks:
        while (count := frames_of(log, "JoystickLeft")) < FRAMES:
            assert time.monotonic() < until, "the other crane's joysticks are silent"
            joysticks.values["Slew"] = 100.0 if count > FRAMES / 2 else 0.0
            time.sleep(0.2)
    return {message_name(message) for message in logged(log)}


@pytest.fixture
def ours(can_pair: tuple[str, str]) -> str:
    return can_pair[0]


@pytest.fixture
def far(can_pair: tuple[str, str]) -> str:
    return can_pair[1]


@pytest.fixture
def daemon(tmp_path: Path, ours: str) -> Iterator[Service]:
    file = deployment(tmp_path, ours, place_of(ours))
    with service(tmp_path / "daemon.log", "run", str(file)) as running:
        running.wait_log("started file=")
        yield running


def drive_from(far: str) -> None:
    """Joysticks that begin in neutral and press reset where something is latched; full motion."""
    with open_bus(far) as bus, joysticks_on(far) as joysticks:
        while str(wait_for(bus, "SlewStatus", lambda _: True)["State"]) != "READY":
            joysticks.switches["Reset"] ^= 1
        joysticks.switches["Reset"] = 0
        drive(bus, joysticks)


def test_a_name_that_changed_hands_while_it_was_down(
    daemon: Service, ours: str, far: str, tmp_path: Path
) -> None:
    with open_bus(far) as bus, joysticks_on(far) as joysticks:
        drive(bus, joysticks)
        with named(ours, "parked"):
            daemon.wait_log("bus=crane state=(down|gone)")
            daemon.wait_log("axis=slew state=TRIPPED from=ACTIVE reason=SEND_FAILED")
            with named(OTHER_CRANE, ours):
                daemon.wait_log("bus=crane state=wrong-device")
                assert witness(tmp_path, ours) == JOYSTICKS
                assert "state=ACTIVE" not in daemon.text().partition("wrong-device")[2]
    daemon.wait_log("bus=crane state=up")
    drive_from(far)
    assert daemon.process.poll() is None


def test_an_adapter_that_goes_and_leaves_its_name_to_another(
    daemon: Service, ours: str, far: str, tmp_path: Path
) -> None:
    """As two adapters that are plugged in again in the other order."""
    place = place_of(ours)
    drive_from(far)
    (DRIVER / "unbind").write_text(place)
    try:
        daemon.wait_log("bus=crane state=gone")
        with named(OTHER_CRANE, ours):
            daemon.wait_log("bus=crane state=wrong-device")
            assert witness(tmp_path, ours) == JOYSTICKS
        daemon.wait_log("(?s)state=wrong-device.*bus=crane state=gone")
    finally:
        (DRIVER / "bind").write_text(place)  # the first free name: its own
        set_up(ours)
        ip("set", ours, "txqueuelen", "16")
    daemon.wait_log("bus=crane state=up")
    drive_from(far)


def test_another_bit_rate_is_no_return(
    daemon: Service, ours: str, far: str, tmp_path: Path
) -> None:
    drive_from(far)
    ip("set", ours, "down")
    daemon.wait_log("bus=crane state=down")
    try:
        set_up(ours, 500_000)
        daemon.wait_log("bus=crane state=wrong-device")
        assert witness(tmp_path, far) == JOYSTICKS
    finally:
        ip("set", ours, "down")
        set_up(ours)
    daemon.wait_log("bus=crane state=up")
    drive_from(far)


def test_down_and_up_is_the_same_device(daemon: Service, ours: str, far: str) -> None:
    drive_from(far)
    ip("set", ours, "down")
    daemon.wait_log("bus=crane state=down")
    ip("set", ours, "up")
    drive_from(far)
    assert "wrong-device" not in daemon.text()
    daemon.wait_log("(?s)state=down.*bus=crane state=up")


def test_a_wrong_device_at_the_start_is_one_clear_line(ours: str, far: str, tmp_path: Path) -> None:
    other = place_of(far)
    file = deployment(tmp_path, ours, other)
    line = next(n for n, t in enumerate(file.read_text().splitlines(), 1) if "match:" in t)
    why = f"expected path pci-{other}, but {ours} has path pci-{place_of(ours)}; the device of the"
    with service(tmp_path / "run.log", "run", str(file)) as running:
        assert running.process.wait(ANSWER_S) == 3
        expected = f"{file}:{line}: buses.crane.match: {why} file is {far}\n"
        assert running.text() == expected
    with service(tmp_path / "check.log", "check", str(file)) as checked:
        assert checked.process.wait(ANSWER_S) == 0
        assert f"    match WARNING: {why} file is {far}\n" in checked.text()
    file = deployment(tmp_path, ours, place_of(ours))
    with service(tmp_path / "check.log", "check", str(file)) as checked:
        assert checked.process.wait(ANSWER_S) == 0
        assert "    match holds now\n" in checked.text()


def test_the_doctor_says_what_to_write_and_that_holds(ours: str, tmp_path: Path) -> None:
    """Its own line, pasted: then it is content."""
    plain = ["--seconds", "0.5", "--no-load"]
    file = deployment(tmp_path, ours, place_of(ours))
    matched = file.read_text()
    head, _, rest = matched.partition(", match: ")
    file.write_text(head + rest.partition("}")[2])
    with service(tmp_path / "doctor.log", "doctor", str(file), *plain) as doctor:
        doctor.process.wait(ANSWER_S)
        text = doctor.text()
    pasted = text.partition("bus crane: match: ")[2].partition("\n")[0]
    assert pasted == f'{{ path: "pci-{place_of(ours)}", bitrate: 250000 }}'
    assert f"Path=pci-{place_of(ours)}\n" in text
    file.write_text(head + f", match: {pasted}" + rest.partition("}")[2])
    with service(tmp_path / "again.log", "doctor", str(file), *plain) as doctor:
        doctor.process.wait(ANSWER_S)
        assert f"{ours} device: match of bus crane holds" in doctor.text()
