"""Ports on raw sockets with the time of their line; clocks, sockets and devices of a test."""

import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from canshaper.bus import device, interface, port, raw, socketcan
from canshaper.config.bus import Bus
from tests.bus.clocks import Clocks
from tests.bus.fake_devices import HUB, PCI, USB, FakeDevices
from tests.bus.fake_sockets import Made
from tests.bus.raw_line import Line


@pytest.fixture
def make_line(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Line]]:
    """Makes a line; all of them end with the test."""
    made: list[Line] = []

    def make(*arguments: Any, **options: Any) -> Line:
        made.append(Line(*arguments, **options))
        for module in (interface, raw):
            monkeypatch.setattr(module, "time", made[-1])
        return made[-1]

    yield make
    for one in made:
        one.end()


@pytest.fixture
def line(make_line: Callable[..., Line]) -> Line:
    """One as it is by default."""
    return make_line()


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Made]:
    opened: list[Made] = []

    def make(*arguments: int) -> Made:
        opened.append(Made(*arguments))
        return opened[-1]

    monkeypatch.setattr(socket, "socket", make)
    monkeypatch.setattr(socketcan, "check_device", lambda *_: None)
    monkeypatch.setattr(socketcan, "check_present", lambda *_: None)
    for module in (port, socketcan):
        monkeypatch.setattr(module, "has_echo", lambda _name: True)
    return opened


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Clocks:
    made = Clocks()
    made.replace(monkeypatch)
    return made


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakeDevices:
    """Two channels of one USB adapter, another adapter like it, a PCI card and a virtual bus."""
    devices = FakeDevices(tmp_path)
    devices.add("can0", USB, dev_port="0")
    devices.add("can1", USB, dev_port="1")
    devices.serial("pci0000:00/0000:00:14.0/usb1", "0000:00:14.0")  # that of the controller
    devices.serial("pci0000:00/0000:00:14.0/usb1/1-3", "0A17")
    devices.add("can2", HUB)
    devices.serial("platform/soc/3f980000.usb/usb1/1-1/1-1.2", "0B99")
    devices.add("can3", PCI, driver="kvaser_pci", bitrate=500_000)
    devices.add("vcan0", None, driver="vcan", bitrate=None)
    read, search = device.read_device, device.whereabouts

    def read_here(
        name: str, root: Path = devices.root, query: device.LinkQuery = devices.query
    ) -> device.Device:
        return read(name, root, query)

    def search_here(
        bus: Bus, root: Path = devices.root, query: device.LinkQuery = devices.query
    ) -> str:
        return search(bus, root, query)

    monkeypatch.setattr(device, "read_device", read_here)
    for module in (device, port):
        monkeypatch.setattr(module, "whereabouts", search_here)
    return devices
