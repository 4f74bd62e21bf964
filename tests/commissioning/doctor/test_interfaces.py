"""CAN interfaces, on what ``ip`` printed about real ones.

The files in ``ip/`` were written by ``ip -details -statistics -json link show`` (iproute2 6.1) in
the lane of the tests on SocketCAN: SJA1000 controllers set up in several ways, and the slcan driver
behind a serial line on which an adapter reported warning, passive and bus-off.
"""

import socket
from pathlib import Path

import pytest

from canshaper.commissioning.doctor import interfaces
from canshaper.commissioning.doctor.finding import Finding, Level
from canshaper.commissioning.doctor.interfaces import (
    bus_findings,
    link_findings,
    parse_ip,
    read_link,
    read_sys,
)
from canshaper.config.bus import Bus

IP = Path(__file__).parent / "ip"
OK, NOTE, WARNING, BAD = Level.OK, Level.NOTE, Level.WARNING, Level.BAD


def bus(channel: str, bitrate: int | None = None) -> Bus:
    return Bus(interface="socketcan", channel=channel, bitrate=bitrate)


def findings(file: str, channel: str, bitrate: int | None = None) -> dict[str, Finding]:
    link = parse_ip((IP / f"{file}.json").read_text())
    assert link is not None
    assert link.name == channel
    return {f.subject: f for f in link_findings(link, bus(channel, bitrate))}


@pytest.mark.parametrize(
    ("file", "channel", "levels"),
    [
        (
            "can1-good",
            "can1",
            {"": OK, " bit rate": OK, " queue": OK, " state": OK, " errors": OK, " restart": OK}
            | {" modes": OK},
        ),
        (
            "can0-restart-0",
            "can0",
            {"": OK, " bit rate": OK, " queue": OK, " state": OK, " errors": OK}
            | {" restart": WARNING, " modes": OK},
        ),
        (
            "can1-one-shot-long-queue",
            "can1",
            {"": OK, " bit rate": OK, " queue": WARNING, " state": OK, " errors": OK}
            | {" restart": OK, " modes": WARNING},
        ),
        (
            "can1-listen-only",
            "can1",
            {"": OK, " bit rate": OK, " queue": OK, " state": OK, " errors": OK, " restart": OK}
            | {" modes": BAD},
        ),
        (
            "can1-down",
            "can1",
            {"": BAD, " bit rate": OK, " queue": OK, " restart": WARNING, " modes": OK},
        ),
        (
            "slcan-active",
            "can2",
            {"": OK, " bit rate": OK, " queue": OK, " state": OK, " errors": OK}
            | {" restart": WARNING, " modes": OK},
        ),
        (
            "slcan-warning",
            "can2",
            {"": OK, " bit rate": OK, " queue": OK, " state": WARNING, " errors": OK}
            | {" restart": WARNING, " modes": OK},
        ),
        (
            "slcan-passive",
            "can2",
            {"": OK, " bit rate": OK, " queue": OK, " state": BAD, " errors": WARNING}
            | {" restart": WARNING, " modes": OK},
        ),
        (
            "slcan-bus-off",
            "can2",
            {"": OK, " bit rate": OK, " queue": OK, " state": BAD, " errors": WARNING}
            | {" restart": WARNING, " modes": OK},
        ),
        ("vcan0", "vcan0", {"": NOTE}),
        ("lo", "lo", {"": BAD}),
    ],
)
def test_levels(file: str, channel: str, levels: dict[str, Level]) -> None:
    found = findings(file, channel)
    assert {s: f.level for s, f in found.items()} == {channel + s: v for s, v in levels.items()}
    assert all(f.remedy for f in found.values() if f.level in (WARNING, BAD))


def test_what_is_said() -> None:
    assert findings("can1-good", "can1")["can1 bit rate"].found == "250000 bit/s"
    assert findings("slcan-active", "can2")["can2 bit rate"].found == "250000 bit/s"
    assert "100 frames" in findings("can1-one-shot-long-queue", "can1")["can1 queue"].found
    assert "one-shot" in findings("can1-one-shot-long-queue", "can1")["can1 modes"].found
    assert "listen-only off" in findings("can1-listen-only", "can1")["can1 modes"].remedy
    off = findings("slcan-bus-off", "can2")
    assert "bus-off" in off["can2 state"].found
    assert off["can2 errors"].found == "counted: bus-off 1, passive 1"
    assert "bitrate 250000 restart-ms 100" in findings("can1-down", "can1")["can1"].remedy


def test_the_bit_rate_of_the_file_must_be_that_of_the_interface() -> None:
    same = findings("can1-good", "can1", 250_000)["can1 bit rate"]
    other = findings("can1-good", "can1", 500_000)["can1 bit rate"]
    assert same.level is OK
    assert other.level is BAD
    assert other.found == "250000 bit/s, in the file 500000 bit/s"


@pytest.mark.parametrize(
    ("queue", "level"), [(9, WARNING), (10, OK), (16, OK), (20, OK), (21, WARNING)]
)
def test_queue_limits(queue: int, level: Level) -> None:
    text = (IP / "can1-good.json").read_text().replace('"txqlen":16', f'"txqlen":{queue}')
    link = parse_ip(text)
    assert link is not None
    assert interfaces.queue(link).level is level


def test_error_counters_of_the_controller_are_told() -> None:
    text = (IP / "can1-good.json").read_text()
    text = text.replace('"berr_counter":{"tx":0,"rx":0}', '"berr_counter":{"tx":8,"rx":0}')
    link = parse_ip(text)
    assert link is not None
    found = interfaces.errors(link)
    assert found is not None
    assert (found.level, found.found) == (WARNING, "counted: tx 8")


def test_a_virtual_bus_that_is_down() -> None:
    text = (IP / "vcan0.json").read_text().replace('["NOARP","UP","LOWER_UP"]', '["NOARP"]')
    (found,) = link_findings(parse_ip(text), bus("vcan0"))
    assert (found.level, found.found) == (BAD, "is down")


def test_no_such_interface() -> None:
    assert read_link("nocan7") is None  # by ip where there is one, and by /sys
    (found,) = link_findings(None, bus("nocan7"))
    assert found.level is BAD
    assert "ip link add nocan7 type vcan" in found.remedy


def test_output_that_is_not_json() -> None:
    """An ip that knows no -json prints as ever; one that knows no such link prints a list."""
    assert parse_ip("4: vcan0: <NOARP,UP,LOWER_UP> mtu 72 qdisc noqueue state UNKNOWN\n") is None
    assert parse_ip("[]") is None
    assert parse_ip("[{},{}]") is None


@pytest.mark.parametrize(("flags", "level"), [("0x40081", OK), ("0x40080", BAD)])
def test_without_ip_the_kernel_tells_less(tmp_path: Path, flags: str, level: Level) -> None:
    directory = tmp_path / "sys/class/net/can0"
    directory.mkdir(parents=True)
    for name, text in (("type", "280"), ("flags", flags), ("tx_queue_len", "10")):
        (directory / name).write_text(text + "\n")  # as they stand for can0 in the lane
    link = read_sys("can0", tmp_path)
    assert link is not None
    found = link_findings(link, bus("can0"))
    assert [(f.subject, f.level) for f in found] == [
        ("can0", level),
        ("can0 queue", OK),
        ("can0", WARNING),
    ]
    assert "not checked" in found[2].found
    assert read_sys("can1", tmp_path) is None


def test_other_interfaces_cannot_be_checked() -> None:
    other = Bus(interface="udp_multicast", channel="239.1.2.3")
    (found,) = bus_findings({"crane": other})
    assert found.level is NOTE
    assert "udp_multicast 239.1.2.3: cannot be checked" in found.found


def test_a_kernel_without_can(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: int) -> None:
        raise OSError(97, "Address family not supported by protocol")

    monkeypatch.setattr(socket, "socket", refuse)
    (found,) = bus_findings({"crane": bus("can0")})
    assert found.level is BAD
    assert found.found.startswith("no SocketCAN in this kernel")
    assert "modprobe can_raw" in found.remedy
