"""A gateway whose buses name their devices: nothing passes to or from another one."""

import errno
import socket
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.bus.raw import REOPEN_NS
from canshaper.cli.app import app
from canshaper.codec.frame import FrameFault
from canshaper.config.bus import Bus, Match
from canshaper.daemon import gateway
from canshaper.daemon.gateway import Bridge
from canshaper.errors import BusError, WrongDeviceError
from canshaper.protocols.gateway import cangw
from tests.rigs.files import ROOT, machine_file

FILE = ROOT / "config" / "gateway-forwarder.yaml"
FRAME = bytes(16)


class FakeSocket:
    """A socket that is bound to a name and hands out what it gets."""

    opened: list["FakeSocket"]

    def __init__(self, *_kind: int) -> None:
        self.waiting: list[bytes | OSError] = []
        self.sent: list[bytes] = []
        self.name = ""
        self.closed = False
        self.opened.append(self)

    def setblocking(self, _flag: bool) -> None:
        pass

    def setsockopt(self, *_option: Any) -> None:
        pass

    def bind(self, address: tuple[str]) -> None:
        (self.name,) = address

    def getsockname(self) -> tuple[str]:
        return (self.name,)

    def recv(self, _size: int) -> bytes:
        if not self.waiting:
            raise BlockingIOError
        first = self.waiting.pop(0)
        if isinstance(first, OSError):
            raise first
        return first

    def send(self, data: bytes) -> None:
        self.sent.append(data)

    def close(self) -> None:
        self.closed = True


class Bench:
    """A bridge between two buses, and what their devices are.

    Attributes:
        wrong: the name of an interface that is another device now.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, matched: bool = True) -> None:
        self.wrong: str | None = None
        self.now_ns = 10**12
        self.opened: list[FakeSocket] = []
        monkeypatch.setattr(FakeSocket, "opened", self.opened, raising=False)
        monkeypatch.setattr(socket, "socket", FakeSocket)
        monkeypatch.setattr(gateway, "check_device", self._check)
        monkeypatch.setattr(gateway, "time", self)
        match = Match(driver="peak_usb") if matched else None
        names = ("can0", "can1")
        self.faults: list[FrameFault] = []
        first, second = (Bus(interface="socketcan", channel=n, match=match) for n in names)
        self.buses = first, second

    def monotonic_ns(self) -> int:
        return self.now_ns

    def bridge(self) -> Bridge:
        return Bridge(self.buses, [], self.faults.append)

    def _check(self, sockets: list[FakeSocket], bus: Bus) -> None:
        (one,) = sockets
        assert one.name == bus.channel
        if one.name == self.wrong:
            raise WrongDeviceError("expected driver peak_usb, but can1 has driver vcan")


def test_a_bridge_to_the_wrong_device_is_not_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.wrong = "can1"
    with pytest.raises(BusError, match="cannot open can0 and can1: expected driver peak_usb"):
        bench.bridge()
    assert [one.closed for one in bench.opened] == [True, True]


def test_an_interface_that_cannot_be_opened_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)

    def refuse(*_arguments: Any) -> None:
        raise OSError(errno.ENODEV, "No such device")

    monkeypatch.setattr(FakeSocket, "bind", refuse)
    with pytest.raises(BusError, match="cannot open can0 and can1: No such device"):
        bench.bridge()


@pytest.mark.parametrize("code", [errno.ENODEV, errno.ENETDOWN])
def test_nothing_passes_until_the_right_device_is_back(
    monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    bench = Bench(monkeypatch)
    bridge = bench.bridge()
    bench.opened[0].waiting = [FRAME, OSError(code, "away")]
    assert bridge.pass_on() == 1
    assert bench.opened[1].sent == [FRAME]
    assert [one.closed for one in bench.opened] == [True, True]
    bench.wrong = "can1"
    for _ in range(20):
        bench.now_ns += REOPEN_NS // 2
        assert bridge.pass_on() == 0
    assert bridge.sockets == []
    assert len(bench.opened) == 2 + 20
    bench.wrong = None
    bench.now_ns += REOPEN_NS
    bridge.pass_on()
    bench.opened[-2].waiting = [FRAME]
    assert bridge.pass_on() == 1
    assert bench.opened[-1].sent == [FRAME]


def test_without_match_an_interface_that_is_down_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, matched=False)
    bridge = bench.bridge()
    bench.opened[0].waiting = [OSError(errno.ENETDOWN, "down"), FRAME]
    bridge.pass_on()
    assert bridge.pass_on() == 1
    assert bench.opened[1].sent == [FRAME]


def matched_file(folder: Path, match: str) -> Path:
    return machine_file(folder, FILE, ("channel: vcan1,", f"channel: vcan1, match: {match},"))


@pytest.mark.parametrize("state", ["running", "away"])
@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("expected driver a, but can1 has driver b", "expected driver a, but can1 has driver b"),
        (OSError(errno.ENODEV, "No such device"), "vcan1 cannot be looked at: No such device"),
    ],
)
def test_no_rule_leads_to_the_wrong_device(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, state: str, fault: str | OSError, text: str
) -> None:
    changed: list[str] = []

    def look(_bus: Bus) -> str:
        if isinstance(fault, OSError):
            raise fault
        return fault

    monkeypatch.setattr("canshaper.bus.device.match_fault", look)
    monkeypatch.setattr(cangw, "load_module", lambda: changed.append("module"))
    monkeypatch.setattr(cangw, "make", lambda *_: changed.append("rules"))
    file = matched_file(tmp_path, "{ driver: a }")
    result = CliRunner().invoke(app, ["gateway", str(file), state])
    assert result.exit_code == 3
    line = next(n for n, t in enumerate(file.read_text().splitlines(), 1) if "match:" in t)
    assert result.stderr == f"{file}:{line}: buses.machine.match: {text}\n"
    assert changed == []


@pytest.mark.parametrize(
    ("words", "looked"),
    [(["running"], ["vcan1"]), (["down"], []), (["running", "--interface", "virtual"], [])],
)
def test_rules_between_the_right_devices(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], looked: list[str]
) -> None:
    """To remove them is right whatever the device is."""
    seen: list[str] = []
    monkeypatch.setattr("canshaper.bus.device.match_fault", lambda bus: seen.append(bus.channel))
    monkeypatch.setattr(cangw, "load_module", lambda: None)
    monkeypatch.setattr(cangw, "make", lambda *_: ([], []))
    file = matched_file(tmp_path, "{ driver: a }")
    assert CliRunner().invoke(app, ["gateway", str(file), *words]).exit_code == 0
    assert seen == looked
