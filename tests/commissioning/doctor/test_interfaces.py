"""CAN interfaces, on what ``ip`` printed about real ones.

The files in ``ip/`` were written by ``ip -details -statistics -json link show`` (iproute2 6.1) in
the lane of the tests on SocketCAN: SJA1000 controllers set up in several ways, and the slcan driver
behind a serial line on which an adapter reported warning, passive and bus-off.
"""

import json
import socket
from pathlib import Path

import pytest

from canshaper.bus.port import not_opened
from canshaper.commissioning.doctor import interfaces
from canshaper.commissioning.doctor.devices import Link, parse_ip, read_link, read_sys
from canshaper.commissioning.doctor.interfaces import bus_findings, link_findings
from canshaper.commissioning.doctor.verdict import Finding, Level
from canshaper.config.bus import Bus

IP = Path(__file__).parent / "ip"
OK, NOTE, WARNING, BAD = Level.OK, Level.NOTE, Level.WARNING, Level.BAD


def bus(channel: str, bitrate: int | None = None) -> Bus:
    return Bus(interface="socketcan", channel=channel, bitrate=bitrate)


def link_of(file: str, old: str = "", new: str = "") -> Link:
    """The interface of a file of ``ip/``, with a part of it replaced."""
    text = (IP / f"{file}.json").read_text()
    assert old in text
    link = parse_ip(text.replace(old, new) if old else text)
    assert link is not None
    return link


def findings(file: str, bitrate: int | None = None) -> dict[str, Finding]:
    link = link_of(file)
    return {f.subject: f for f in link_findings(link, bus(link.name, bitrate))}


GOOD = dict.fromkeys(("", " bit rate", " queue", " state", " errors", " restart", " modes"), OK)
SLCAN = GOOD | {" restart": WARNING, " send confirmation": BAD}
DOWN = {"": BAD, " bit rate": OK, " queue": OK, " restart": WARNING, " modes": OK}


@pytest.mark.parametrize(
    ("file", "channel", "levels"),
    [
        ("can1-good", "can1", GOOD),
        ("can0-restart-0", "can0", GOOD | {" restart": WARNING}),
        ("can1-one-shot-long-queue", "can1", GOOD | {" queue": WARNING, " modes": WARNING}),
        ("can1-listen-only", "can1", GOOD | {" modes": BAD}),
        ("can1-down", "can1", DOWN),
        ("slcan-active", "can2", SLCAN),
        ("slcan-warning", "can2", SLCAN | {" state": WARNING}),
        ("slcan-passive", "can2", SLCAN | {" state": BAD, " errors": WARNING}),
        ("slcan-bus-off", "can2", SLCAN | {" state": BAD, " errors": WARNING}),
        ("vcan0", "vcan0", {"": NOTE}),
        ("lo", "lo", {"": BAD}),
    ],
)
def test_levels(file: str, channel: str, levels: dict[str, Level]) -> None:
    by_subject = findings(file)
    assert {s: f.level for s, f in by_subject.items()} == {
        channel + s: v for s, v in levels.items()
    }
    assert all(f.remedy for f in by_subject.values() if f.level in (WARNING, BAD))


def test_what_is_said() -> None:
    assert findings("can1-good")["can1 bit rate"].found == "250000 bit/s"
    assert findings("slcan-active")["can2 bit rate"].found == "250000 bit/s"
    assert "100 frames" in findings("can1-one-shot-long-queue")["can1 queue"].found
    assert "one-shot" in findings("can1-one-shot-long-queue")["can1 modes"].found
    assert "listen-only off" in findings("can1-listen-only")["can1 modes"].remedy
    off = findings("slcan-bus-off")
    assert "run drives no valve" in off["can2 send confirmation"].found
    assert "restart-ms" not in off["can2 restart"].remedy
    assert "bus-off" in off["can2 state"].found
    assert off["can2 errors"].found == "counted: bus-off 1, passive 1"
    assert "bitrate 250000 restart-ms 100" in findings("can1-down")["can1"].remedy


def test_the_bit_rate_of_the_file_must_be_that_of_the_interface() -> None:
    same = findings("can1-good", 250_000)["can1 bit rate"]
    other = findings("can1-good", 500_000)["can1 bit rate"]
    assert same.level is OK
    assert other.level is BAD
    assert other.found == "250000 bit/s, in the file 500000 bit/s"


@pytest.mark.parametrize(
    ("queue", "level"), [(9, WARNING), (10, OK), (16, OK), (20, OK), (21, WARNING)]
)
def test_queue_limits(queue: int, level: Level) -> None:
    link = link_of("can1-good", '"txqlen":16', f'"txqlen":{queue}')
    assert interfaces.queue(link).level is level


def test_error_counters_of_the_controller_are_reported() -> None:
    finding = interfaces.errors(link_of("can1-good", '"tx":0,"rx":0', '"tx":8,"rx":0'))
    assert finding is not None
    assert (finding.level, finding.found) == (WARNING, "counted: tx 8")


def test_a_virtual_bus_that_is_down() -> None:
    link = link_of("vcan0", '["NOARP","UP","LOWER_UP"]', '["NOARP"]')
    (finding,) = link_findings(link, bus("vcan0"))
    assert (finding.level, finding.found) == (BAD, "is down")


def test_no_such_interface() -> None:
    assert read_link("nocan7") is None  # by ip where there is one, and by /sys
    (finding,) = link_findings(None, bus("nocan7"))
    assert finding.level is BAD
    assert "ip link add nocan7 type vcan" in finding.remedy


def test_output_that_is_not_json() -> None:
    """An ip that knows no -json prints as ever; one that knows no such link prints a list."""
    assert parse_ip("4: vcan0: <NOARP,UP,LOWER_UP> mtu 72 qdisc noqueue state UNKNOWN\n") is None
    assert parse_ip("[]") is None
    assert parse_ip("[{},{}]") is None


@pytest.mark.parametrize(("flags", "level"), [("0x40081", OK), ("0x40080", BAD)])
def test_without_ip_the_kernel_reports_less(tmp_path: Path, flags: str, level: Level) -> None:
    directory = tmp_path / "sys/class/net/can0"
    directory.mkdir(parents=True)
    for name, text in (("type", "280"), ("flags", flags), ("tx_queue_len", "10"), ("mtu", "16")):
        (directory / name).write_text(text + "\n")  # as they stand for can0 in the lane
    link = read_sys("can0", tmp_path)
    assert link is not None
    results = link_findings(link, bus("can0"))
    assert [(f.subject, f.level) for f in results] == [
        ("can0", level),
        ("can0 queue", OK),
        ("can0", WARNING),
    ]
    assert "not checked" in results[2].found
    assert read_sys("can1", tmp_path) is None


@pytest.mark.parametrize(
    ("interface", "older_ms", "error_frames"),
    [("udp_multicast", 20, NOTE), ("slcan", 5, NOTE), ("socketcand", 5, OK)],
)
def test_what_an_adapter_is_silent_about(
    interface: str, older_ms: int, error_frames: Level
) -> None:
    results = bus_findings({"crane": Bus(interface=interface, channel="somewhere")}, tick_ms=20)
    start = f"bus crane {interface}"
    assert [(f.subject, f.level) for f in results] == [
        (start, NOTE),
        (f"{start} time stamps", NOTE),
        (f"{start} error frames", error_frames),
        (f"{start} send confirmation", WARNING),
    ]
    assert "python-can on somewhere: cannot be checked" in results[0].found
    assert f"up to {older_ms} ms older" in results[1].found
    assert f"timeout_ms of inputs {older_ms} ms more" in results[1].remedy


def test_a_kernel_without_can(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: int) -> None:
        raise OSError(97, "Address family not supported by protocol")

    monkeypatch.setattr(socket, "socket", refuse)
    (finding,) = bus_findings({"crane": bus("can0")}, 20)
    assert finding.level is BAD
    assert finding.found in str(not_opened("crane", bus("can0"), OSError(97, "")))
    assert finding.found.startswith("cannot open socketcan channel can0: this kernel has no CAN")
    assert "modprobe can_raw" in finding.remedy


def of_fd(link: Link, **rates: int | None) -> dict[str, Finding]:
    config = Bus(interface="socketcan", channel=link.name, fd=True, **rates)  # type: ignore[arg-type]
    return {f.subject: f for f in link_findings(link, config)}


def test_a_controller_without_can_fd() -> None:
    finding = of_fd(link_of("can1-good"), bitrate=250_000, data_bitrate=1_000_000)["can1 CAN FD"]
    assert (finding.level, finding.found) == (BAD, "off, the MTU is 16")
    options = "type can dbitrate 1000000 fd on"
    assert finding.remedy == f"with can1 down: sudo ip link set can1 {options}"


@pytest.mark.parametrize(
    ("mtu", "level", "remedy"),
    [(16, BAD, "with vcan0 down: sudo ip link set vcan0 mtu 72"), (72, OK, "")],
)
def test_a_virtual_bus_with_and_without_can_fd(mtu: int, level: Level, remedy: str) -> None:
    text = f'[{{"ifname": "vcan0", "link_type": "can", "flags": ["UP"], "mtu": {mtu}, "linkinfo":'
    link = parse_ip(text + ' {"info_kind": "vcan"}}]')
    assert link is not None
    assert [f.subject for f in link_findings(link, bus("vcan0"))] == ["vcan0"]
    finding = of_fd(link)["vcan0 CAN FD"]
    assert (finding.level, finding.remedy) == (level, remedy)


@pytest.mark.parametrize(
    ("data_bitrate", "level", "text"),
    [
        (2_000_000, OK, "on, data 2000000 bit/s"),
        (4_000_000, BAD, "data 2000000 bit/s, in the file data_bitrate 4000000 bit/s"),
        (None, WARNING, "data 2000000 bit/s, in the file data_bitrate none"),
    ],
)
def test_the_bit_rate_of_the_data_is_that_of_the_file(
    data_bitrate: int | None, level: Level, text: str
) -> None:
    """As ``ip`` of iproute2 6.1 prints a controller of CAN FD; the lane has none."""
    entry = json.loads((IP / "can1-good.json").read_text())
    (one,) = (e for e in entry if e.get("ifname"))
    one["mtu"] = 72
    one["linkinfo"]["info_data"]["data_bittiming"] = {"bitrate": 2_000_000}
    link = parse_ip(json.dumps(entry))
    assert link is not None
    finding = of_fd(link, data_bitrate=data_bitrate)["can1 CAN FD"]
    assert (finding.level, finding.found) == (level, text)


def test_a_controller_of_can_fd_that_is_down_is_set_up_with_its_rates() -> None:
    finding = of_fd(link_of("can1-down"), bitrate=500_000, data_bitrate=2_000_000)["can1"]
    assert "dbitrate 2000000 fd on restart-ms 100" in finding.remedy
