"""J1939 with other makers' nodes: the kernel's, can-utils' j1939acd, can-j1939, tshark."""

import re
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import can
import j1939
import pytest

from tests.hil.j1939_drive import FILE
from tests.hil.j1939_nodes import NAME, Joysticks, another_ecu, j1939acd, kernel_has_j1939, ours
from tests.hil.machine import ANSWER_S, Service, candump, logged, open_bus, service
from tests.protocols.j1939.test_dm1 import codes
from tests.rigs.j1939 import CLAIM, NO_CLAIM, OWN, WHO_HAS_IT

AVC0 = 0x0CFE3000 | OWN
FIRST_SPN = 520192


@pytest.fixture
def joysticks() -> Iterator[Joysticks]:
    running = Joysticks()
    running.start()
    yield running
    running.end()


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Service]:
    with service(tmp_path / "daemon.log", "run", str(FILE)) as running:
        yield running


def is_claim(message: can.Message) -> bool:
    return message.arbitration_id == CLAIM


def after_the_claim_of(name: int, log: Path) -> list[can.Message]:
    """Frames under our address after that node had claimed it."""
    messages = ours(log)
    data = name.to_bytes(8, "little")
    at = next(i for i, m in enumerate(messages) if is_claim(m) and m.data == data)
    return messages[at + 1 :]


def moving(daemon: Service, joysticks: Joysticks) -> None:
    """Slew in motion, by the commands on the bus; an overrun of an emulated machine may end it."""
    until = time.monotonic() + ANSWER_S
    with open_bus("vcan0") as bus:
        while time.monotonic() < until:
            state = slew_state(daemon)
            joysticks.x = 0.0 if state in ("NEUTRAL_WAIT", "TRIPPED") else 100.0
            # pressed for half of every second: an emulated machine may stand still, and trip
            joysticks.reset = state == "TRIPPED" and time.monotonic() % 1.0 < 0.5
            message = bus.recv(1.0)
            if message and message.arbitration_id == AVC0 and message.data[0] > 20:
                return
    raise AssertionError(f"no motion:\n{daemon.text()}")


def slew_state(daemon: Service) -> str:
    states = re.findall(r"axis=slew state=(\w+)", daemon.text())
    return states[-1] if states else "NEUTRAL_WAIT"


def wait_for_command(accept: Callable[[bytearray], bool]) -> None:
    until = time.monotonic() + ANSWER_S
    with open_bus("vcan0") as bus:
        while time.monotonic() < until:
            message = bus.recv(1.0)
            if message and message.arbitration_id == AVC0 and accept(message.data):
                return
    raise AssertionError("no such command")


def test_the_kernels_stack_receives_our_commands_our_name_and_our_faults(
    joysticks: Joysticks, daemon: Service
) -> None:
    kernel_has_j1939()
    with socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_J1939) as kernel:
        kernel.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        nothing = socket.J1939_NO_NAME, socket.J1939_NO_PGN, socket.J1939_NO_ADDR
        kernel.bind(("vcan0", *nothing))
        kernel.settimeout(ANSWER_S)
        moving(daemon, joysticks)
        with open_bus("vcan0") as bus:  # our claim may have come before the kernel listened
            bus.send(can.Message(arbitration_id=WHO_HAS_IT, data=b"\x00\xee\x00"))
        commands: set[bytes] = set()
        faults: list[tuple[int, int, int]] = []
        until = time.monotonic() + ANSWER_S
        while not (any(data[0] > 20 for data in commands) and len(faults) > 2):
            assert time.monotonic() < until, (commands, faults)
            data, (_, name, pgn, source) = kernel.recvfrom(2000)
            if source != OWN:
                continue
            if pgn == 0xFE30 and name:
                assert name == NAME  # the kernel has it from our claim
                assert len(data) == 8
                commands.add(data)
            elif pgn == 0xFECA:  # put together from the broadcast by the kernel
                faults = codes(data)
    # No valve is there: the feedback of all three is lost. An emulated machine has overruns too.
    valves = [(spn, fmi) for spn, fmi, _ in faults if (spn - FIRST_SPN) % 2]
    assert valves == [(FIRST_SPN + i, 9) for i in (1, 3, 5)]


def test_a_lower_name_of_another_ecu_silences_us_within_a_tick(
    joysticks: Joysticks, daemon: Service, tmp_path: Path
) -> None:
    moving(daemon, joysticks)
    log = tmp_path / "lost.log"
    with candump(log, "vcan0"), another_ecu(NAME - 1) as ecu:
        daemon.wait_log(r"axis=\w+ state=TRIPPED from=\w+ reason=ADDRESS_LOST")
        daemon.wait_log("bus=crane address=0x9c state=lost")
        wait_until(lambda: ecu.state == j1939.ControllerApplication.State.NORMAL)
        time.sleep(0.5)  # twenty-five ticks in which nothing may come
    late = [m.arbitration_id for m in after_the_claim_of(NAME - 1, log)]
    assert len(late) == len(set(late)), late  # what one tick sends, and no more
    refused = [m for m in logged(log) if m.arbitration_id == NO_CLAIM]
    assert [bytes(m.data) for m in refused] == [NAME.to_bytes(8, "little")]
    assert daemon.process.poll() is None


def test_a_higher_name_of_another_ecu_is_refused_in_motion(
    joysticks: Joysticks, daemon: Service, tmp_path: Path
) -> None:
    moving(daemon, joysticks)
    log = tmp_path / "kept.log"
    with candump(log, "vcan0"), another_ecu(NAME + 1) as ecu:
        wait_until(lambda: ecu.state == j1939.ControllerApplication.State.CANNOT_CLAIM)
        wait_for_command(lambda _data: True)
    after = after_the_claim_of(NAME + 1, log)
    assert bytes(next(m for m in after if is_claim(m)).data) == NAME.to_bytes(8, "little")
    assert any(m.arbitration_id == AVC0 for m in after)
    assert "ADDRESS_LOST" not in daemon.text()


def test_of_twins_with_the_same_name_one_gives_way(
    joysticks: Joysticks, daemon: Service, tmp_path: Path
) -> None:
    moving(daemon, joysticks)
    log = tmp_path / "twins.log"
    with candump(log, "vcan0"), service(tmp_path / "twin.log", "run", str(FILE)) as twin:
        # The one that receives the other's claim: the first of us, or the twin when we claim again.
        wait_until(lambda: "state=lost" in daemon.text() + twin.text())
        assert "Traceback" not in twin.text()
    name = NAME.to_bytes(8, "little")
    claims = [m for m in ours(log) if is_claim(m)]
    assert {bytes(m.data) for m in claims} == {name}


def test_j1939acd_with_a_lower_name_holds_the_address_until_it_ends_and_we_reload(
    joysticks: Joysticks, tmp_path: Path
) -> None:
    log = tmp_path / "held.log"
    with (
        candump(log, "vcan0"),
        j1939acd(1, tmp_path / "acd.log") as holder,
        open_bus("vcan0") as bus,
    ):
        wait_for_claim(bus, 1)
        with service(tmp_path / "daemon.log", "run", str(FILE)) as daemon:
            daemon.wait_log("bus=crane address=0x9c state=lost")
            time.sleep(0.5)  # in which nothing may come
            held = len(daemon.text())
            holder.send_signal(signal.SIGTERM)
            holder.wait(ANSWER_S)
            # It lets go of its address by a claim of the null address; we get nothing back by that.
            assert "state=claimed" not in daemon.text()[held:]
            time.sleep(0.5)
            marker = can.Message(arbitration_id=0x7FD, is_extended_id=False)
            bus.send(marker)
            daemon.process.send_signal(signal.SIGHUP)
            daemon.wait_log("reload=applied")
            daemon.wait_log("bus=crane address=0x9c state=claimed")
            moving(daemon, joysticks)
    rows = logged(log)
    at = next(i for i, m in enumerate(rows) if m.arbitration_id == 0x7FD)
    before = [m for m in rows[:at] if m.is_extended_id and m.arbitration_id & 0xFF == OWN]
    assert before
    assert all(is_claim(m) for m in before)
    assert any(m.arbitration_id == AVC0 for m in rows[at:])


def test_j1939acd_with_a_higher_name_does_not_get_the_address(
    joysticks: Joysticks, daemon: Service, tmp_path: Path
) -> None:
    moving(daemon, joysticks)
    log = tmp_path / "kept.log"
    with candump(log, "vcan0"), j1939acd(NAME + 1, tmp_path / "acd.log"), open_bus("vcan0") as bus:
        # It requests who is there before it claims, and receives us.
        wait_for_claim(bus, NAME)
        wait_for_command(lambda _data: True)
    claims = [int.from_bytes(m.data, "little") for m in ours(log) if is_claim(m)]
    assert NAME in claims
    assert claims[-1] == NAME
    assert "state=lost" not in daemon.text()


def test_after_an_outage_the_claim_comes_first(
    joysticks: Joysticks, daemon: Service, tmp_path: Path
) -> None:
    moving(daemon, joysticks)
    subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
    try:
        daemon.wait_log("state=waiting")
        daemon.wait_log("axis=slew state=TRIPPED")
        came = first_words(daemon)
    finally:
        subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    assert is_claim(came[0])
    assert came[-1].arbitration_id == AVC0
    assert came[-1].data[0] == 0
    claims = [m for m in came if is_claim(m)]
    # The wait of the standard; a stamp is taken a little after the frame was made.
    assert came[-1].timestamp - claims[-1].timestamp >= 0.23
    assert "state=ACTIVE" not in daemon.text().split("state=waiting")[-1]


def first_words(daemon: Service) -> list[can.Message]:
    """Set the interface up; what comes from our address, up to the first command."""
    came: list[can.Message] = []
    until = time.monotonic() + ANSWER_S
    with open_bus("vcan0") as bus:
        subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
        while not came or came[-1].arbitration_id != AVC0:
            assert time.monotonic() < until, daemon.text()
            with suppress(can.CanError):  # one, for the time before
                message = bus.recv(1.0)
                if message and message.is_extended_id and message.arbitration_id & 0xFF == OWN:
                    came.append(message)
    return came


def wait_until(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + ANSWER_S
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def wait_for_claim(bus: can.BusABC, name: int) -> None:
    data = name.to_bytes(8, "little")
    until = time.monotonic() + ANSWER_S
    while time.monotonic() < until:
        message = bus.recv(1.0)
        if message and message.arbitration_id == CLAIM and message.data == data:
            return
    raise AssertionError(f"no claim of {name:#x}")
