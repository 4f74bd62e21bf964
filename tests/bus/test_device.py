"""The device behind an interface: what /sys and netlink say, held against the deployment."""

import errno
import socket
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canshaper.bus import device as module
from canshaper.bus import netlink
from canshaper.bus.device import (
    Device,
    check_device,
    device_fault,
    kind_and_bitrates,
    match_fault,
    read_device,
    whereabouts,
)
from canshaper.bus.port import open_port
from canshaper.bus.socketcan import open_sockets
from canshaper.config.bus import Bus, Match
from canshaper.errors import BusError, WrongBusError, WrongDeviceError
from canshaper.machine.routing import BusRoutes
from tests.bus.fake_devices import HUB, PCI, SPI, USB, FakeDevices
from tests.bus.raw_line import IDS


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
    defaults = (devices.root, devices.query)
    for function in (read_device, whereabouts):
        monkeypatch.setattr(function, "__defaults__", defaults)
    return devices


def bus(channel: str = "can0", bitrate: int | None = None, **match: Any) -> Bus:
    expected = Match(**match) if match else None
    return Bus(interface="socketcan", channel=channel, bitrate=bitrate, match=expected)


USB_PATH = "pci-0000:00:14.0-usb-0:3:1.0"


@pytest.mark.parametrize(
    ("name", "device"),
    [
        ("can0", Device("can0", "0A17", USB_PATH, 0, "peak_usb", 250_000, 2)),
        ("can1", Device("can1", "0A17", USB_PATH, 1, "peak_usb", 250_000, 2)),
        (
            "can2",
            Device("can2", "0B99", "platform-3f980000.usb-usb-0:1.2:1.0", 0, "peak_usb", 250_000),
        ),
        ("can3", Device("can3", None, "pci-0000:00:04.0", 0, "kvaser_pci", 500_000)),
        ("vcan0", Device("vcan0", None, None, 0, "vcan", None)),
    ],
)
def test_what_is_behind_an_interface(here: FakeDevices, name: str, device: Device) -> None:
    assert read_device(name) == device


def test_a_controller_on_spi_has_a_path(here: FakeDevices) -> None:
    """As of udev: the chip select behind the host."""
    here.add("can4", SPI, driver="mcp251x")
    assert read_device("can4").path == "platform-3f204000.spi-cs-0"


def test_an_older_driver_counts_its_channels_in_dev_id(here: FakeDevices) -> None:
    here.add("can4", f"{PCI}.1", dev_id="0x2")
    assert read_device("can4").port == 2


def test_a_usb_adapter_without_a_serial_number_has_not_that_of_its_hub(here: FakeDevices) -> None:
    here.add("can4", "pci0000:00/0000:00:14.0/usb1/1-4/1-4:1.0")
    here.serial("pci0000:00/0000:00:14.0/usb1/1-4", None)
    assert read_device("can4").serial is None


@pytest.mark.parametrize("name", ["can9", "", "..", "can0/device"])
def test_no_such_interface(here: FakeDevices, name: str) -> None:
    with pytest.raises(OSError, match="No such device") as caught:
        read_device(name)
    assert caught.value.errno == errno.ENODEV


def test_a_name_that_changes_hands_while_it_is_read(here: FakeDevices) -> None:
    """What was read may be of both devices."""
    file = here.root / "sys/class/net/can0/ifindex"

    def query(index: int) -> tuple[str | None, int | None]:
        file.write_text("77\n")
        return here.query(index)

    with pytest.raises(OSError, match="No such device"):
        read_device("can0", here.root, query)


@pytest.mark.parametrize(
    ("configured", "fault"),
    [
        (bus("can0", serial="0A17"), None),
        (bus("can0", serial="0A17", port=0, path=USB_PATH, driver="peak_usb"), None),
        (bus("can3", bitrate=500_000, path="pci-0000:00:04.0"), None),
        (bus("vcan0", bitrate=250_000, driver="vcan"), None),  # that is for its load
        (bus("can3", bitrate=250_000), None),  # without match as ever
        (
            bus("can2", serial="0A17"),
            "expected serial number 0A17, but can2 has serial number 0B99;"
            " the device of the file is can0, can1",
        ),
        (
            bus("can0", serial="0A17", port=1),
            "expected port 1, but can0 has port 0; the device of the file is can1",
        ),
        (
            bus("can3", serial="77", driver="peak_usb"),
            "expected serial number 77, driver peak_usb, but can3 has no serial number, driver"
            " kvaser_pci; the device of the file is not here",
        ),
        (
            bus("can3", bitrate=250_000, path="pci-0000:00:04.0"),
            "expected bit rate 250000, but can3 has bit rate 500000",
        ),
        (
            bus("vcan0", driver="can327"),
            "expected driver can327, but vcan0 has driver vcan",
        ),
        (
            Bus(interface="socketcan", channel="vcan0", match=Match(bitrate=250_000)),
            "expected bit rate 250000, but vcan0 has no bit rate",
        ),
    ],
)
def test_a_device_against_the_deployment(
    here: FakeDevices, configured: Bus, fault: str | None
) -> None:
    assert match_fault(configured) == fault
    assert bool(device_fault(configured, read_device(configured.channel))) is bool(fault)


def test_what_is_no_interface_does_not_matter(here: FakeDevices) -> None:
    """Bonding puts a file among the interfaces."""
    (here.root / "sys/class/net/bonding_masters").write_text("\n")
    assert whereabouts(bus("can9", serial="0B99")) == "; the device of the file is can2"


class Bound:
    """A socket, as far as it is asked where it is bound to; names as they are, one call each."""

    def __init__(self, *names: str) -> None:
        self._names = [*names]

    def getsockname(self) -> tuple[str]:
        return (self._names.pop(0) if len(self._names) > 1 else self._names[0],)


def check(config: Bus, *sockets: Any) -> None:
    check_device(sockets, config)


def test_bound_sockets_of_the_right_device(here: FakeDevices) -> None:
    check(bus("can0", serial="0A17", port=0), Bound("can0"), Bound("can0"))


def test_where_the_sockets_are_bound_counts_and_not_the_name_of_the_file(
    here: FakeDevices,
) -> None:
    """Bound to can0, which got another name meanwhile: the device is the one that was meant."""
    check(bus("can0", serial="0B99"), Bound("can2"))
    with pytest.raises(WrongDeviceError, match="expected serial number 0A17, but can2 has"):
        check(bus("can0", serial="0A17"), Bound("can2"))


@pytest.mark.parametrize(
    "sockets",
    [
        (("can0",), ("can1",), ("can0",)),
        (("can0",), ("can0",), ("can1",)),
        (("can0", "can1"), ("can0", "can1")),
        (("can0",), ("can0", "can1")),
    ],
)
def test_a_name_that_changes_hands_while_it_is_opened(
    here: FakeDevices, sockets: tuple[tuple[str, ...], ...]
) -> None:
    with pytest.raises(WrongDeviceError, match="the name can0 changed hands"):
        check(bus("can0", serial="0A17"), *(Bound(*names) for names in sockets))


def test_without_match_nothing_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "read_device", None)
    check(bus("can0", bitrate=250_000), None)


def test_an_interface_that_goes_while_it_is_opened_is_gone(here: FakeDevices) -> None:
    with pytest.raises(OSError, match="No such device"):
        check(bus("can9", serial="0A17"), Bound("can9"))


def test_a_kernel_that_does_not_answer_is_no_right_device(
    here: FakeDevices, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without AF_NETLINK in the unit: an error of its own, not "this kernel has no CAN"."""

    def refuse(_index: int) -> Any:
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(read_device, "__defaults__", (here.root, refuse))
    with pytest.raises(WrongDeviceError, match="can0 cannot be looked at: Address family not"):
        check(bus("can0", serial="0A17"), Bound("can0"))


# -- netlink ---------------------------------------------------------------------------------------


def field(kind: int, payload: bytes) -> bytes:
    return netlink.attribute(kind, payload)


def link_message(kind: bytes | None, data: bytes | None) -> bytes:
    """RTM_NEWLINK, as linux/if_link.h has it: nested attributes with their flag."""
    info = field(1, kind + b"\0") if kind else b""
    info += field(2 | 0x8000, data) if data is not None else b""
    name = field(3, b"can0\0")
    return bytes(16) + name + (field(18 | 0x8000, info) if info else b"") + field(4, bytes(4))


def timing(bitrate: int, kind: int = 1) -> bytes:
    """can_bittiming behind the clock, as the driver orders them."""
    return field(5, bytes(4)) + field(kind, struct.pack("=8I", bitrate, 875, 250, 6, 7, 2, 1, 2))


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (link_message(b"can", timing(250_000)), ("can", 250_000, None)),
        (
            link_message(b"can", timing(500_000) + timing(2_000_000, kind=9)),
            ("can", 500_000, 2_000_000),
        ),
        (link_message(b"can", field(5, bytes(4))), ("can", None, None)),  # none set
        (link_message(b"can", None), ("can", None, None)),
        (link_message(b"vcan", None), ("vcan", None, None)),
        (link_message(b"vlan", field(1, b"\x01\0\0\0")), ("vlan", None, None)),
        (link_message(None, None), (None, None, None)),
    ],
)
def test_kind_and_bit_rate_of_an_interface(
    monkeypatch: pytest.MonkeyPatch,
    message: bytes,
    expected: tuple[str | None, int | None, int | None],
) -> None:
    requested: list[tuple[int, int, bytes]] = []

    def request(kind: int, flags: int, body: bytes) -> Any:
        requested.append((kind, flags, body))
        yield message

    monkeypatch.setattr(module, "request", request)
    assert kind_and_bitrates(7) == expected
    assert requested == [(18, 4, struct.pack("=BxHiII", 0, 0, 7, 0, 0))]


def test_the_kernel_itself_answers() -> None:
    """The loopback interface is on every machine, and has no kind."""
    assert kind_and_bitrates(socket.if_nametoindex("lo")) == (None, None, None)
    with pytest.raises(OSError, match="No such device") as caught:
        kind_and_bitrates(999_999)
    assert caught.value.errno == errno.ENODEV


def test_the_real_tree_of_devices() -> None:
    device = read_device("lo")
    assert device == Device("lo", None, None, 0, None, None)


def test_an_attribute_that_is_cut_short_ends_them() -> None:
    assert list(netlink.attributes(field(1, b"ab") + b"\x03\0\x02\0")) == [(1, b"ab")]


# -- opening ---------------------------------------------------------------------------------------


def opened_by(monkeypatch: pytest.MonkeyPatch, error: Exception) -> Callable[[Bus], BusError]:
    def refuse(*_arguments: Any) -> Any:
        raise error

    monkeypatch.setattr("canshaper.bus.port.open_sockets", refuse)

    def fail(config: Bus) -> BusError:
        with pytest.raises(BusError) as caught:
            open_port("crane", config, lambda _fault: None)
        return caught.value

    return fail


def test_a_wrong_device_is_no_port(here: FakeDevices, monkeypatch: pytest.MonkeyPatch) -> None:
    error = opened_by(monkeypatch, WrongDeviceError("expected this"))(bus("can2", serial="0A17"))
    assert isinstance(error, WrongBusError)
    assert error.bus == "crane"
    assert error.why == "expected this; the device of the file is can0, can1"
    assert str(error) == f"bus crane: {error.why}"


def test_an_interface_that_is_missing_may_have_another_name(
    here: FakeDevices, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is said and not used: which interface is driven stands in the file."""
    fail = opened_by(monkeypatch, OSError(errno.ENODEV, "No such device"))
    text = "bus crane: cannot open socketcan channel can-x: No such device"
    assert str(fail(bus("can-x", serial="0B99"))) == f"{text}; the device of the file is can2"
    assert str(fail(bus("can-x", driver="peak_usb"))) == text
    assert str(fail(bus("can-x"))) == text


class Opened(Bound):
    """A socket that is opened and bound."""

    made: list["Opened"]

    def __init__(self, *_kind: int) -> None:
        super().__init__("")
        self.closed = False
        self.made.append(self)

    def setblocking(self, _flag: bool) -> None:
        pass

    def setsockopt(self, *_option: Any) -> None:
        pass

    def bind(self, address: tuple[str]) -> None:
        self._names = [address[0]]

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize("ids", [None, IDS])
def test_sockets_of_another_device_are_closed_at_once(
    here: FakeDevices, monkeypatch: pytest.MonkeyPatch, ids: BusRoutes | None
) -> None:
    made: list[Opened] = []
    monkeypatch.setattr(Opened, "made", made, raising=False)
    monkeypatch.setattr("canshaper.bus.socketcan.socket.socket", Opened)
    right = open_sockets(bus("can0", serial="0A17", port=0), ids)
    assert [one.closed for one in made] == [False] * len(right)
    made.clear()
    with pytest.raises(WrongDeviceError, match="expected serial number 0A17, but can2 has"):
        open_sockets(bus("can2", serial="0A17"), ids)
    assert [one.closed for one in made] == [True] * (3 if ids else 1)
    assert open_sockets(bus("can2"), ids)  # without match


@pytest.mark.parametrize(("configured", "matched"), [(bus("can0"), False), (bus(serial="1"), True)])
def test_a_port_knows_whether_its_device_is_named(
    monkeypatch: pytest.MonkeyPatch, configured: Bus, matched: bool
) -> None:
    options: dict[str, Any] = {}
    monkeypatch.setattr("canshaper.bus.port.RawPort", lambda *_, **given: options.update(given))
    open_port("crane", configured, lambda _fault: None)
    assert options == {"confirms": False, "matched": matched, "fd": None, "brs": False}
