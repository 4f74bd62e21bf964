"""The device behind an interface: what /sys and netlink say, held against the deployment."""

import errno

import pytest

from canshaper.bus import device as module
from canshaper.bus.device import Device, device_fault, match_fault
from canshaper.config.bus import Bus, Match
from tests.bus.fake_devices import PCI, SPI, FakeDevices, bus

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
    assert module.read_device(name) == device


def test_a_controller_on_spi_has_a_path(here: FakeDevices) -> None:
    """As of udev: the chip select behind the host."""
    here.add("can4", SPI, driver="mcp251x")
    assert module.read_device("can4").path == "platform-3f204000.spi-cs-0"


def test_an_older_driver_counts_its_channels_in_dev_id(here: FakeDevices) -> None:
    here.add("can4", f"{PCI}.1", dev_id="0x2")
    assert module.read_device("can4").port == 2


def test_an_adapter_with_can_fd_has_two_rates(here: FakeDevices) -> None:
    here.add("can4", f"{PCI}.1", bitrate=500_000, data_bitrate=2_000_000)
    device = module.read_device("can4")
    assert (device.bitrate, device.data_bitrate) == (500_000, 2_000_000)


def test_a_serial_number_that_is_no_text_is_shown_all_the_same(here: FakeDevices) -> None:
    usb = here.root / "sys/devices/pci0000:00/0000:00:14.0/usb1/1-3"
    (usb / "serial").write_bytes(b"0A\xff17\n")
    assert module.read_device("can0").serial == "0A\ufffd17"


def test_a_usb_adapter_without_a_serial_number_has_not_that_of_its_hub(here: FakeDevices) -> None:
    here.add("can4", "pci0000:00/0000:00:14.0/usb1/1-4/1-4:1.0")
    here.serial("pci0000:00/0000:00:14.0/usb1/1-4", None)
    assert module.read_device("can4").serial is None


@pytest.mark.parametrize("name", ["can9", "", "..", "can0/device"])
def test_no_such_interface(here: FakeDevices, name: str) -> None:
    with pytest.raises(OSError, match="No such device") as caught:
        module.read_device(name)
    assert caught.value.errno == errno.ENODEV


def test_a_name_that_changes_hands_while_it_is_read(here: FakeDevices) -> None:
    """Values that were read may be of both devices."""
    file = here.root / "sys/class/net/can0/ifindex"

    def query(index: int) -> tuple[str | None, int | None]:
        file.write_text("77\n")
        return here.query(index)

    with pytest.raises(OSError, match="No such device") as caught:
        module.read_device("can0", here.root, query)
    assert caught.value.errno == errno.ENODEV


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
        (bus("vcan0", driver="can327"), "expected driver can327, but vcan0 has driver vcan"),
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
    assert bool(device_fault(configured, module.read_device(configured.channel))) is bool(fault)


def test_what_is_no_interface_does_not_matter(here: FakeDevices) -> None:
    """Bonding puts a file among the interfaces."""
    (here.root / "sys/class/net/bonding_masters").write_text("\n")
    match = Match(serial="0B99", bitrate=1_000_000)  # it is that device at any bit rate
    other = bus("can9").model_copy(update={"match": match})
    assert module.whereabouts(other) == "; the device of the file is can2"

    def refuse(_index: int) -> tuple[str | None, int | None, int | None]:
        raise OSError(errno.EPERM, "netlink is not permitted")

    text = "; the device of the file is not here"
    assert module.whereabouts(other, here.root, refuse) == text
