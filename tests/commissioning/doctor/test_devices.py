"""Findings of the doctor about the device behind a bus, and its lines to paste."""

import errno
from pathlib import Path
from typing import Any

import pytest
import yaml

from canshaper.commissioning.doctor import interfaces
from canshaper.commissioning.doctor.devices import device_findings
from canshaper.commissioning.doctor.verdict import Finding, Level
from canshaper.config.bus import Bus, Match
from tests.bus.fake_devices import HUB, PCI, USB, FakeDevices


@pytest.fixture
def here(tmp_path: Path) -> FakeDevices:
    devices = FakeDevices(tmp_path)
    devices.add("can0", USB, dev_port="0")
    devices.add("can1", USB, dev_port="1")
    devices.serial("pci0000:00/0000:00:14.0/usb1/1-3", "0A17")
    devices.add("can2", HUB)
    devices.serial("platform/soc/3f980000.usb/usb1/1-1/1-1.2", "no 5*")
    devices.add("can3", PCI, driver="kvaser_pci", bitrate=None)
    devices.add("vcan0", None, driver="vcan", bitrate=None)
    return devices


def finding(here: FakeDevices, channel: str, **match: Any) -> Finding:
    expected = Match(**match) if match else None
    bus = Bus(interface="socketcan", channel=channel, match=expected)
    (result,) = device_findings("crane", bus, here.root, here.query)
    return result


def test_a_match_that_holds(here: FakeDevices) -> None:
    result = finding(here, "can2", serial="no 5*")
    assert result == Finding("can2 device", Level.OK, "match of bus crane holds")


def test_a_match_that_does_not_hold(here: FakeDevices) -> None:
    result = finding(here, "can2", serial="0A17", port=1)
    assert result.level is Level.BAD
    assert result.found == (
        "expected serial number 0A17, port 1, but can2 has serial number no 5*, port 0;"
        " the device of the file is can1"
    )
    assert result.remedy


def test_an_interface_that_is_not_there_is_said_once(here: FakeDevices) -> None:
    bus = Bus(interface="socketcan", channel="can9")
    assert device_findings("crane", bus, here.root, here.query) == []


@pytest.mark.parametrize(
    ("match", "level"), [(None, Level.WARNING), (Match(serial="0A17"), Level.BAD)]
)
def test_a_kernel_that_does_not_answer(
    here: FakeDevices, match: Match | None, level: Level
) -> None:
    def refuse(_index: int) -> Any:
        raise OSError(errno.EPERM, "Operation not permitted")

    bus = Bus(interface="socketcan", channel="can0", match=match)
    findings = device_findings("crane", bus, here.root, refuse)
    text = "cannot be looked at: Operation not permitted"
    assert findings == [Finding("can0 device", level, text)]


@pytest.mark.parametrize(
    ("channel", "level", "match"),
    [
        ("can0", Level.WARNING, Match(serial="0A17", port=0, bitrate=250_000)),
        ("can1", Level.WARNING, Match(serial="0A17", port=1, bitrate=250_000)),
        ("can2", Level.WARNING, Match(serial="no 5*", bitrate=250_000)),
        ("can3", Level.WARNING, Match(path="pci-0000:00:04.0")),
        ("vcan0", Level.NOTE, Match(driver="vcan")),
    ],
)
def test_the_match_to_paste_is_one_that_holds(
    here: FakeDevices, channel: str, level: Level, match: Match
) -> None:
    result = finding(here, channel)
    assert result.level is level
    assert result.found == f"bus crane has no match: whatever is called {channel} is driven"
    line = result.remedy.splitlines()[0]
    key, _, text = line.partition("match: ")
    assert key == "in the deployment file, bus crane: "
    assert Match.model_validate(yaml.safe_load(text)) == match
    pasted = Bus(interface="socketcan", channel=channel, match=match)
    (again,) = device_findings("crane", pasted, here.root, here.query)
    assert again.level is Level.OK


def test_channels_of_one_adapter_are_distinguished_by_a_rule_alone(here: FakeDevices) -> None:
    """A .link file has no word for them; which attribute counts, its driver knows."""
    assert finding(here, "can1").remedy.splitlines()[1:] == [
        "for a name of its own (then channel: can-crane in the deployment file)",
        "/etc/udev/rules.d/76-can-crane.rules:",
        '  SUBSYSTEM=="net", ACTION=="add", ATTRS{serial}=="0A17", ATTR{dev_port}=="1",'
        ' ATTR{dev_id}=="0x0", NAME="can-crane"',
    ]


def test_a_name_by_networkd_or_by_udev(here: FakeDevices) -> None:
    assert finding(here, "can2").remedy.splitlines()[1:] == [
        "for a name of its own (then channel: can-crane in the deployment file)",
        "/etc/systemd/network/60-can-crane.link:",
        "  [Match]",
        "  Property=ID_SERIAL_SHORT=no_5_",
        "  [Link]",
        "  Name=can-crane",
        "  TransmitQueueLength=16",
        "or, without networkd:",
        "/etc/udev/rules.d/76-can-crane.rules:",
        '  SUBSYSTEM=="net", ACTION=="add", ATTRS{serial}=="no 5*", NAME="can-crane"',
    ]


def test_without_a_serial_number_the_place_counts(here: FakeDevices) -> None:
    lines = finding(here, "can3").remedy.splitlines()
    assert "  Path=pci-0000:00:04.0" in lines
    rule = '  SUBSYSTEM=="net", ACTION=="add", ENV{ID_PATH}=="pci-0000:00:04.0", NAME="can-crane"'
    assert lines[-1] == rule


def test_a_virtual_bus_gets_no_name(here: FakeDevices) -> None:
    assert finding(here, "vcan0").remedy == (
        'in the deployment file, bus crane: match: { driver: "vcan" }'
    )


@pytest.mark.parametrize(
    ("bus", "name"),
    [
        ("front crane", "can-front-crane"),
        ("the longest crane", "can-the-longest"),
        ("front-left-__-boom", "can-front-left"),
    ],
)
def test_a_name_that_linux_takes(here: FakeDevices, bus: str, name: str) -> None:
    findings = device_findings(
        bus, Bus(interface="socketcan", channel="can3"), here.root, here.query
    )
    assert f"  Name={name}\n" in findings[0].remedy
    assert len(name) <= 15


def test_the_device_is_looked_at_with_the_interface(
    here: FakeDevices, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(interfaces, "kernel_fault", lambda: None)
    monkeypatch.setattr(device_findings, "__defaults__", (here.root, here.query))
    buses = {"crane": Bus(interface="socketcan", channel="can3")}
    subjects = [one.subject for one in interfaces.bus_findings(buses, 20)]
    assert subjects == ["can3", "can3 device"]
