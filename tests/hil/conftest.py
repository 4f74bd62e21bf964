"""Tests on real SocketCAN: they run inside a lane and are skipped elsewhere."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from tests.hil.machine import FILE, Joysticks, Service, joysticks_on, open_bus, service

HERE = Path(__file__).parent


# The others take minutes: make test-socketcan-all, test-machines, test-faults.
IN_MAKE_TEST = (
    "test_socketcan.py",
    "test_joystick_moves_valve_and_everything_ends_neutral",
    "test_an_interface_without_echo_drives_a_valve_by_consent_only",
    "test_bus_off_without_echo_lasts_until_the_interface_is_set_up_again",
    "test_a_service_waits_for_its_interface_without_priority",
)


@pytest.hookimpl(tryfirst=True)  # before marks select
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    skip = pytest.mark.skip(reason="needs SocketCAN: run python -m tests.lane.hil")
    for item in items:
        if HERE in item.path.parents:  # this hook sees the items of all directories
            if not {item.path.name, item.name} & {*IN_MAKE_TEST}:
                item.add_marker(pytest.mark.slow)
            if "CANSHAPER_LANE" not in os.environ:
                item.add_marker(skip)


@pytest.fixture
def can_pair() -> tuple[str, str]:
    """Names of two controllers on one bus: what one sends, the other receives."""
    return _controllers()[0]


@pytest.fixture
def can_pairs() -> tuple[tuple[str, str], tuple[str, str]]:
    """Two buses with two controllers each."""
    pairs = _controllers()
    if len(pairs) < 2:
        pytest.skip("this lane has one bus of CAN controllers (--kvaser 4 makes two)")
    return pairs[0], pairs[1]


def _controllers() -> list[tuple[str, str]]:
    names = os.environ["CANSHAPER_CAN"].split()
    if len(names) < 2:
        pytest.skip("this lane has no CAN controllers, only vcan (--lane tcg has them)")
    return list(zip(names[::2], names[1::2], strict=True))


@pytest.fixture
def no_rules() -> Iterator[None]:
    if shutil.which("cangw") is None:
        pytest.skip("cangw not found (Debian package can-utils)")
    yield
    subprocess.run(["cangw", "-F"], check=False, capture_output=True)


@pytest.fixture
def joysticks() -> Iterator[Joysticks]:
    with joysticks_on("vcan0") as running:
        yield running


@pytest.fixture
def bus() -> Iterator[can.BusABC]:
    with open_bus("vcan0") as opened:
        yield opened


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Service]:
    with service(tmp_path / "daemon.log", "run", str(FILE)) as running:
        running.wait_log("started file=")
        yield running
