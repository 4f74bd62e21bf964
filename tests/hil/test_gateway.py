"""A gateway in the line between vcan0 and vcan1: what passes, with foreign tools as witnesses."""

import itertools
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from canshaper.checksums.kinds import CHECKSUMS
from tests.codec.checksum_reference import REFERENCE
from tests.hil.machine import ANSWER_S, DBC, FILE, Service, joysticks_on, open_bus, service
from tests.hil.machine import wait_for as wait

GATEWAY = FILE.with_name("gateway-forwarder.yaml")
NEAR, FAR = "vcan0", "vcan1"
OURS = {0x110, 0x111, 0x300, 0x301, 0x302, 0x310, 0x311}  # joysticks and status messages
LAST = 0x7FD
BATCH = 40  # a bus carries so many in 20 ms, a receive queue some more


@pytest.fixture(autouse=True)
def _no_rules() -> Iterator[None]:
    if shutil.which("cangw") is None:
        pytest.skip("cangw not found (Debian package can-utils)")
    yield
    subprocess.run(["cangw", "-F"], check=False, capture_output=True)


def write(folder: Path, *changes: tuple[str, str], base: Path = GATEWAY) -> Path:
    text = base.read_text().replace("../dbc", str(FILE.parents[1] / "dbc"))
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    file = folder / "gateway.yaml"
    file.write_text(text)
    return file


def rules(file: Path, state: str, code: int = 0) -> str:
    command = [sys.executable, "-m", "canshaper", "gateway", str(file), state]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr + done.stdout
    return done.stdout


def cangw() -> list[str]:
    """What the foreign tool sees."""
    # Its exit code is a length.
    done = subprocess.run(["cangw", "-L"], capture_output=True, text=True, check=False)
    return [line.partition(" #")[0] for line in done.stdout.splitlines()]


KERNEL = ("forwarding: kernel", "forwarding: kernel")
DAEMON = ("forwarding: kernel", "forwarding: daemon")
STOP = ("fallback: neutral", "fallback: stop")


@contextmanager
def in_the_line(folder: Path, *changes: tuple[str, str]) -> Iterator[tuple[Service, Path]]:
    """The daemon at work between both buses."""
    file = write(folder, *changes)
    rules(file, "running")
    with service(folder / "log", "run", str(file)) as daemon:
        daemon.wait_log("started")
        yield daemon, file


def foreign(count: int, seed: int) -> list[can.Message]:
    """Frames that are not ours, of 11 and of 29 bits, of every length but 0."""
    source = random.Random(seed)
    rules = []
    for i in range(count):
        extended = source.random() < 0.5
        can_id = source.randrange(0x20000000) if extended else source.randrange(0x7F0)
        if not extended and can_id in OURS:
            can_id += 0x20
        data = bytes((i % 256, seed)) + source.randbytes(source.randrange(7))
        rules.append(
            can.Message(arbitration_id=can_id, is_extended_id=extended, data=data[: 1 + i % 8])
        )
    return rules


def key(message: can.Message) -> tuple[int, bool, bytes]:
    return message.arbitration_id, message.is_extended_id, bytes(message.data)


def exchanged(
    here: can.BusABC, there: can.BusABC, messages: list[can.Message]
) -> list[tuple[int, bool, bytes]]:
    """Send these, a few at a time; what of frames that are not ours comes on the other side."""
    keys: list[tuple[int, bool, bytes]] = []
    until = time.monotonic() + ANSWER_S
    for i in range(0, len(messages), BATCH):
        batch = messages[i : i + BATCH]
        for message in batch:
            here.send(message)
        while not keys or keys[-1] != key(batch[-1]):
            assert time.monotonic() < until, f"{len(keys)} of {i + len(batch)} came"
            message = there.recv(1.0)
            if message and (message.is_extended_id or message.arbitration_id not in OURS):
                keys.append(key(message))
    return keys


@pytest.mark.parametrize("who", [KERNEL, DAEMON], ids=["kernel", "daemon"])
def test_frames_of_others_pass_in_both_directions(tmp_path: Path, who: tuple[str, str]) -> None:
    """Untouched, once, in their order; while the joysticks move what is ours."""
    with (
        in_the_line(tmp_path, who, STOP),
        joysticks_on(NEAR) as joysticks,
        open_bus(NEAR) as near,
        open_bus(FAR) as far,
    ):
        joysticks.values["Slew"] = 0.0
        wait(far, "JoystickLeft", lambda v: v["Enable"] == "On")
        out, back = foreign(400, 1), foreign(400, 2)
        assert exchanged(near, far, out) == [key(m) for m in out]
        drain(near)
        assert exchanged(far, near, back) == [key(m) for m in back]


def drain(bus: can.BusABC) -> None:
    while bus.recv(0) is not None:
        pass


@pytest.mark.parametrize("who", [KERNEL, DAEMON], ids=["kernel", "daemon"])
def test_what_is_ours_or_blocked_passes_in_no_direction(
    tmp_path: Path, who: tuple[str, str]
) -> None:
    blocked = ("  fallback: stop", "  fallback: stop\n  blocked: [TipPosition]")
    with (
        in_the_line(tmp_path, who, STOP, blocked),
        open_bus(NEAR) as near,
        open_bus(FAR) as far,
    ):
        kept = [
            can.Message(arbitration_id=i, is_extended_id=False, data=[7]) for i in (0x300, 0x401)
        ]
        near_only = can.Message(arbitration_id=0x110, is_extended_id=False, data=[7])
        last = can.Message(arbitration_id=LAST, is_extended_id=False)
        for here, there in ((near, far), (far, near)):
            for message in (near_only, *kept, near_only, last):
                here.send(message)
            seen = []
            while (message := there.recv(ANSWER_S)) is not None:
                seen.append(message)
                if message.arbitration_id == LAST:
                    break
            assert bytes([7]) not in [bytes(m.data) for m in seen]
            assert 0x401 not in [m.arbitration_id for m in seen]
            drain(here)


def test_the_joystick_leaves_with_our_velocity_and_a_counter_without_a_gap(tmp_path: Path) -> None:
    with in_the_line(tmp_path), joysticks_on(NEAR) as joysticks, open_bus(FAR) as far:
        wait(far, "SlewStatus", lambda v: v["State"] == "READY")
        joysticks.values.update(Slew=80.0, Rotate=30.0)
        seen = []
        right = None
        while len(seen) < 200:
            message = far.recv(ANSWER_S)
            assert message is not None
            if message.arbitration_id == 0x110:
                seen.append(DBC.decode_message("JoystickLeft", message.data))
            elif message.arbitration_id == 0x111:
                right = DBC.decode_message("JoystickRight", message.data)
    assert right is not None
    assert right["Rotate"] == 30.0  # no axis of ours: as it came
    speeds = [float(v["Slew"]) for v in seen]  # type: ignore[arg-type]
    counts = [int(v["AliveCounter"]) for v in seen]  # type: ignore[call-overload]
    assert [(b - a) % 256 for a, b in itertools.pairwise(counts)] == [1] * 199
    between = {speed for speed in speeds if 0.0 < speed < 60.0}
    assert len(between) >= 3  # the joystick jumped from 0 to 80 %
    assert max(speeds) > 30.0


def test_killed_the_joystick_is_neutral_until_the_daemon_is_back(tmp_path: Path) -> None:
    """As the unit does it: rules away after the end, running before the start."""
    with joysticks_on(NEAR) as joysticks, open_bus(FAR) as far:
        with in_the_line(tmp_path) as (daemon, file):
            wait(far, "SlewStatus", lambda v: v["State"] == "READY")
            joysticks.values.update(Slew=80.0, Rotate=30.0)
            wait(far, "JoystickLeft", lambda v: v["Slew"] > 20.0)
            daemon.process.send_signal(signal.SIGKILL)
            daemon.process.wait(ANSWER_S)
            drain(far)
            silent(far, {0x110, 0x111})
            rules(file, "away")
            for _ in range(20):
                wait(far, "JoystickLeft", assert_neutral)
            wait(far, "JoystickRight", lambda v: v["Rotate"] == 30.0)
            assert "AND" in "".join(cangw())
        rules(file, "running")
        assert "AND" not in "".join(cangw())
        with service(tmp_path / "log2", "run", str(file)) as daemon:
            daemon.wait_log("gateway=rules-right")
            wait(far, "SlewStatus", lambda v: v["Reason"] == "JOYSTICK_NOT_NEUTRAL")
            wait(far, "JoystickLeft", assert_neutral)
            joysticks.values["Slew"] = 0.0
            wait(far, "SlewStatus", lambda v: v["State"] == "READY")
            joysticks.values["Slew"] = 80.0
            wait(far, "JoystickLeft", lambda v: v["Slew"] > 20.0)


def assert_neutral(values: dict) -> bool:
    assert values["Slew"] == 0.0
    assert values["NearFar"] == 0.0
    assert values["Enable"] == "On"  # every other bit is the joystick's
    return True


def silent(bus: can.BusABC, ids: set[int]) -> None:
    """Ten frames of the joystick go by and none of these ids is seen."""
    until = time.monotonic() + 0.3
    while time.monotonic() < until:
        message = bus.recv(0.05)
        assert message is None or message.arbitration_id not in ids


def test_stopped_in_motion_it_leaves_neutral(tmp_path: Path) -> None:
    with joysticks_on(NEAR) as joysticks, open_bus(FAR) as far:
        with in_the_line(tmp_path) as (daemon, _):
            wait(far, "SlewStatus", lambda v: v["State"] == "READY")
            joysticks.values["Slew"] = 80.0
            wait(far, "JoystickLeft", lambda v: v["Slew"] > 20.0)
            assert daemon.end() == 0
        last = None
        while (message := far.recv(0.2)) is not None:
            if message.arbitration_id == 0x110:
                last = message
        assert last is not None
        assert DBC.decode_message("JoystickLeft", last.data)["Slew"] == 0.0


def test_a_lost_joystick_ends_in_a_shaped_stop_and_silence(tmp_path: Path) -> None:
    with in_the_line(tmp_path), joysticks_on(NEAR) as joysticks, open_bus(FAR) as far:
        wait(far, "SlewStatus", lambda v: v["State"] == "READY")
        joysticks.values["Slew"] = 80.0
        wait(far, "JoystickLeft", lambda v: v["Slew"] > 30.0)
        joysticks.silent = True
        wait(far, "SlewStatus", lambda v: v["State"] == "STOPPING")
        wait(far, "JoystickLeft", lambda v: 0.0 < v["Slew"] < 30.0 and v["Enable"] == "On")
        wait(far, "SlewStatus", lambda v: v["State"] == "NEUTRAL_WAIT")
        drain(far)
        silent(far, {0x110, 0x111})


@pytest.mark.parametrize("kind", [kind for kind, row in CHECKSUMS.items() if row.kernel])
def test_the_fallback_makes_checksums_right(tmp_path: Path, kind: str) -> None:
    """Reckoned by crccheck at both ends; the kernel does it between."""
    dbc = (FILE.parents[1] / "dbc" / "forwarder.dbc").read_text()
    # In the last byte, with the counter before it.
    counter = ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273'
    moved = ' SG_ AliveCounter : 48|8@1+ (1,0) [0|255] "" SHAPER\n'
    moved += ' SG_ Checksum : 56|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273'
    assert counter in dbc
    (tmp_path / "gateway.dbc").write_text(dbc.replace(counter, moved))
    checksum = f"checksum: {{ signal: Checksum, kind: {kind} }}"
    file = write(
        tmp_path,
        ("left:\n    bus: joysticks", f"left:\n    {checksum}\n    bus: joysticks"),
        ("signal: Slew, timeout_ms: 200,", f"signal: Slew, timeout_ms: 200, {checksum},"),
        ("signal: NearFar, timeout_ms: 200,", f"signal: NearFar, timeout_ms: 200, {checksum},"),
        (f"{FILE.parents[1] / 'dbc'}/forwarder.dbc", "gateway.dbc"),
    )
    rules(file, "away")
    with open_bus(NEAR) as near, open_bus(FAR) as far:
        for count in range(50):
            data = bytes((0x34, 0x12, 0xFF, 0x7F, 0x01, 0, count))
            near.send(can.Message(arbitration_id=0x110, is_extended_id=False,
                                  data=data + bytes([REFERENCE[kind](0, data, 8)])))  # fmt: skip
            passed = far.recv(ANSWER_S)
            assert passed is not None
            assert bytes(passed.data[:7]) == bytes((0, 0, 0, 0, 1, 0, count))
            assert passed.data[7] == REFERENCE[kind](0, bytes(passed.data[:7]), 8)


def test_a_fallback_that_is_left_in_place_is_reported_and_moves_nothing(tmp_path: Path) -> None:
    """Two senders of one message: the user who started the daemon by hand is to see it."""
    file = write(tmp_path)
    rules(file, "away")
    with (
        joysticks_on(NEAR),
        open_bus(FAR) as far,
        service(tmp_path / "log", "run", str(file)) as daemon,
    ):
        daemon.wait_log("gateway=rules-too-many")
        wait(far, "SlewStatus", lambda v: v["Reason"] == "SECOND_SENDER")


def test_missing_rules_are_reported(tmp_path: Path) -> None:
    with service(tmp_path / "log", "run", str(write(tmp_path))) as daemon:
        daemon.wait_log("gateway=rules-missing 40 of 40")


def test_rules_are_set_up_shown_and_removed(tmp_path: Path) -> None:
    """A rule of another program between both interfaces goes, one elsewhere stays."""
    file = write(tmp_path)
    elsewhere = ["-s", "vxcan0", "-d", "vxcan1", "-e"]
    subprocess.run(["modprobe", "can-gw"], check=False)
    subprocess.run(["cangw", "-A", *elsewhere], check=True)
    subprocess.run(["cangw", "-A", "-s", NEAR, "-d", FAR, "-e", "-f", "110:7FF"], check=True)
    assert "others" in rules(file, "show", code=1)
    assert f"removed {NEAR} -> {FAR} 110:7ff" in rules(file, "running")
    assert "40 rules, running" in rules(file, "show")
    assert rules(file, "running") == f"{NEAR} {FAR}: running, 0 rules added, 0 removed\n"
    assert all("-l 1" in line for line in cangw() if "vcan" in line)
    assert "42 rules, away" in [rules(file, "away"), rules(file, "show")][1]
    rules(file, "down")
    assert cangw() == ["cangw -A -s vxcan0 -d vxcan1 -e"]
    assert "0 rules, down" in rules(file, "show", code=1)


def test_pass_lets_the_joystick_through_while_the_daemon_is_away(tmp_path: Path) -> None:
    file = write(tmp_path, ("fallback: neutral", "fallback: pass"))
    rules(file, "away")
    with joysticks_on(NEAR) as joysticks, open_bus(FAR) as far:
        joysticks.values["Slew"] = 80.0
        wait(far, "JoystickLeft", lambda v: v["Slew"] == 80.0)


@pytest.mark.parametrize("who", [KERNEL, DAEMON], ids=["kernel", "daemon"])
def test_an_interface_that_was_removed(tmp_path: Path, who: tuple[str, str]) -> None:
    """Back again the daemon passes on; rules of the kernel went with it, which is reported."""
    with in_the_line(tmp_path, who, STOP) as (daemon, file):
        subprocess.run(["ip", "link", "del", FAR], check=True)
        try:
            daemon.wait_log("bus=machine state=gone")
        finally:
            subprocess.run(["ip", "link", "add", FAR, "type", "vcan"], check=True)
            subprocess.run(["ip", "link", "set", FAR, "mtu", "72", "up"], check=True)
        daemon.wait_log("bus=machine state=up")
        if who == KERNEL:
            daemon.wait_log("gateway=rules-missing 40 of 40")
            rules(file, "running")
            daemon.wait_log("rules-right(.|\n)*rules-missing(.|\n)*rules-right")
        with joysticks_on(NEAR), open_bus(NEAR) as near, open_bus(FAR) as far:
            wait(far, "JoystickLeft", lambda v: v["Enable"] == "On")
            message = can.Message(arbitration_id=0x7E1, is_extended_id=False, data=[1])
            assert exchanged(near, far, [message]) == [key(message)]
