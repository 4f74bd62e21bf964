"""Tests of the package and its service under a real systemd; skipped elsewhere."""

import os
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from tests.hil.machine import Joysticks, joysticks_on, open_bus
from tests.systemd.packages import FIRST, install, path
from tests.systemd.unit import DROP_IN, Unit

HERE = Path(__file__).parent
# At the start files come from the host, which is busy; after that the unit's own limits hold.
SLOW = "[Service]\nTimeoutStartSec=120s\n"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if "CANSHAPER_SYSTEMD" in os.environ:
        return
    skip = pytest.mark.skip(reason="needs systemd: run python -m tests.lane.services")
    for item in items:
        if HERE in item.path.parents:  # this hook sees the items of all directories
            item.add_marker(skip)


@pytest.fixture(scope="session")
def installed() -> None:
    """The package, installed by dpkg."""
    # Images for containers have a policy that forbids services.
    Path("/usr/sbin/policy-rc.d").unlink(missing_ok=True)
    DROP_IN.parent.mkdir(parents=True)
    DROP_IN.write_text(SLOW)
    install(path(FIRST))


@pytest.fixture
def forwarder(installed: None) -> Unit:
    """The instance of the shipped deployment, running on vcan0."""
    unit = Unit("forwarder")
    unit.systemctl("enable", "--now")
    unit.wait(ActiveState="active")
    return unit


@pytest.fixture
def bus() -> Iterator[can.BusABC]:
    with open_bus("vcan0") as opened:
        yield opened


@pytest.fixture
def joysticks() -> Iterator[Joysticks]:
    with joysticks_on("vcan0") as running:
        yield running
