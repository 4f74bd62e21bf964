"""The key ``match`` of a bus in the deployment file: what can be known without the device."""

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.bus import port as module
from canshaper.bus.device import read_device, whereabouts
from canshaper.cli.app import app
from canshaper.config.bus import Match
from canshaper.daemon.ports import open_ports
from canshaper.errors import BusError, ConfigError, WrongDeviceError
from canshaper.machine.binding import load_deployment
from tests.bus.fake_devices import FakeDevices
from tests.rigs.files import line_of, machine_file, problems

ONE = "channel: vcan0, bitrate: 250000"
TWO = "channel: vcan1, bitrate: 250000"


def machine(folder: Path, first: str, second: str | None = None) -> Path:
    """Two cranes, with ``match`` put behind the bit rate of their buses."""
    changes = (ONE, f"{ONE}, match: {first}"), (TWO, f"{TWO}, match: {second}" if second else TWO)
    return machine_file(folder, "two-cranes", *changes)


def test_a_match_is_read(tmp_path: Path) -> None:
    file = machine(tmp_path, '{ serial: "0A17", port: 0 }', '{ serial: "0A17", port: 1 }')
    buses = load_deployment(file).config.buses
    assert buses["front"].match == Match(serial="0A17", port=0)
    assert hash(buses["front"]) != hash(buses["rear"])


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ('{ serial: "1" }', '{ serial: "2" }'),
        ("{ path: a }", "{ path: b }"),
        ('{ serial: "1", path: a }', '{ serial: "1", path: b }'),
        ("{ driver: peak_usb }", "{ driver: peak_usb }"),
        ("{ driver: peak_usb, port: 1 }", "{ driver: peak_usb, port: 1 }"),
        ('{ serial: "1" }', "{ path: a }"),
        ('{ serial: "1", port: 0 }', '{ serial: "1", port: 1 }'),
        ("{ bitrate: 250000 }", "{ bitrate: 250000 }"),
    ],
)
def test_two_devices(tmp_path: Path, first: str, second: str) -> None:
    assert load_deployment(machine(tmp_path, first, second))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ('{ serial: "1" }', '{ serial: "1" }'),
        ('{ serial: "1" }', '{ serial: "1", port: 1 }'),
        ('{ serial: "1", port: 1 }', '{ serial: "1", driver: peak_usb }'),
        ('{ serial: "1", path: a }', "{ path: a }"),
    ],
)
def test_two_channels_that_nothing_distinguishes(tmp_path: Path, first: str, second: str) -> None:
    """Their names could change hands, and both would match."""
    file = machine(tmp_path, first, second)
    text = "expected another serial, path or port than bus front, got what may be its device"
    assert problems(file) == [f"machine.yaml:{line_of(file, TWO)}: buses.rear.match: {text}"]


@pytest.mark.parametrize(
    ("match", "where", "text"),
    [
        ("{}", "match", "expected one of serial, path, port, driver, bitrate, got none"),
        (
            '{ serial: "" }',
            "match.serial",
            "expected text (in quotes where it looks like a number), got ''",
        ),
        (
            "{ bitrate: 500000 }",
            "match.bitrate",
            "expected the bitrate of the bus, 250000, got 500000",
        ),
    ],
)
def test_a_match_that_cannot_be(tmp_path: Path, match: str, where: str, text: str) -> None:
    file = machine(tmp_path, match)
    (problem,) = problems(file)
    assert problem.startswith(f"machine.yaml:{line_of(file, ONE)}: buses.front.{where}: {text}")


def test_only_socketcan_has_devices(tmp_path: Path) -> None:
    file = machine(tmp_path, "{ driver: vcan }")
    front = "front: { interface: "
    file.write_text(file.read_text().replace(f"{front}socketcan", f"{front}virtual"))
    with pytest.raises(ConfigError) as caught:
        load_deployment(file)
    text = "buses.front.match: expected the interface socketcan with it, got virtual"
    assert str(caught.value) == f"{file}:{line_of(file, ONE)}: {text}"


def wrong(*_arguments: Any) -> Any:
    raise WrongDeviceError("expected driver peak_usb, but vcan0 has driver vcan")


def test_a_wrong_device_is_reported_with_the_line_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "open_sockets", wrong)
    file = machine(tmp_path, "{ driver: peak_usb }")
    deployment = load_deployment(file)
    with pytest.raises(BusError) as caught:
        open_ports(deployment, {}, lambda _fault: None)
    text = "buses.front.match: expected driver peak_usb, but vcan0 has driver vcan"
    assert str(caught.value) == f"{file}:{line_of(file, ONE)}: {text}"


def test_run_ends_with_that_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 3: the service manager tries again until the right device is there."""
    monkeypatch.setattr(module, "open_sockets", wrong)
    file = machine(tmp_path, "{ driver: peak_usb }")
    result = CliRunner().invoke(app, ["run", str(file)])
    assert result.exit_code == 3
    text = "buses.front.match: expected driver peak_usb, but vcan0 has driver vcan"
    assert result.stderr == f"{file}:{line_of(file, ONE)}: {text}\n"


def test_the_check_says_whether_it_holds_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is good either way: it may be checked on another PC."""
    devices = FakeDevices(tmp_path / "root")
    devices.add("vcan0", None, driver="vcan", bitrate=None)
    for function in (read_device, whereabouts):
        monkeypatch.setattr(function, "__defaults__", (devices.root, devices.query))

    def checked(match: str) -> str:
        result = CliRunner().invoke(app, ["check", str(machine(tmp_path, match, match))])
        assert result.exit_code == 0
        return str(result.stdout)

    assert "    match holds now\n" in checked("{ driver: vcan }")
    text = checked("{ driver: peak_usb }")
    assert "    match WARNING: expected driver peak_usb, but vcan0 has driver vcan\n" in text
    assert "    match not looked at: vcan1: No such device\n" in text


def test_without_match_the_check_is_silent_about_it(tmp_path: Path) -> None:
    file = machine(tmp_path, "{ driver: vcan }")
    file.write_text(file.read_text().replace(", match: { driver: vcan }", ""))
    result = CliRunner().invoke(app, ["check", str(file)])
    assert "  bus front: " in result.stdout
    assert "    match " not in result.stdout
