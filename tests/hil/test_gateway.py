"""A gateway in the line between vcan0 and vcan1: what passes, with foreign tools as witnesses."""

import itertools
import random
import signal
import time
from pathlib import Path

import can
import pytest

from tests.hil.gateway import (
    DAEMON,
    FAR,
    KERNEL,
    NEAR,
    OURS,
    STOP,
    cangw,
    drain,
    exchanged,
    in_the_line,
    key,
    rules,
)
from tests.hil.machine import ANSWER_S, DBC, joysticks_on, open_bus, service
from tests.hil.machine import wait_for as wait

LAST = 0x7FD
pytestmark = pytest.mark.usefixtures("no_rules")


def foreign(count: int, seed: int) -> list[can.Message]:
    """Frames that are not ours, of 11 and of 29 bits, of every length but 0."""
    source = random.Random(seed)
    messages = []
    for i in range(count):
        extended = source.random() < 0.5
        can_id = source.randrange(0x20000000) if extended else source.randrange(0x7F0)
        if not extended and can_id in OURS:
            can_id += 0x20
        data = bytes((i % 256, seed)) + source.randbytes(source.randrange(7))
        messages.append(
            can.Message(arbitration_id=can_id, is_extended_id=extended, data=data[: 1 + i % 8])
        )
    return messages


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


@pytest.mark.parametrize("who", [KERNEL, DAEMON], ids=["kernel", "daemon"])
def test_what_is_ours_or_blocked_passes_in_no_direction(
    tmp_path: Path, who: tuple[str, str]
) -> None:
    blocked = ("  fallback: stop", "  fallback: stop\n  blocked: [TipPosition]")
    with in_the_line(tmp_path, who, STOP, blocked), open_bus(NEAR) as near, open_bus(FAR) as far:
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
