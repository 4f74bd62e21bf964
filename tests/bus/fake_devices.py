"""A tree of /sys with CAN interfaces, as Linux shows them, and what netlink says of them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from canshaper.config.bus import Bus, Match

PCI = "pci0000:00/0000:00:04.0"
USB = "pci0000:00/0000:00:14.0/usb1/1-3/1-3:1.0"
HUB = "platform/soc/3f980000.usb/usb1/1-1/1-1.2/1-1.2:1.0"
SPI = "platform/soc/3f204000.spi/spi_master/spi0/spi0.0"


@dataclass
class FakeDevices:
    """Interfaces under a root of a file system.

    Attributes:
        root: of the file system.
        kinds: kind and bit rates by the index of the interface.
    """

    root: Path
    kinds: dict[int, tuple[str | None, int | None, int | None]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        (self.root / "sys/class/net").mkdir(parents=True)
        (self.root / "sys/devices").mkdir()

    def add(
        self,
        name: str,
        place: str | None,
        *,
        driver: str = "peak_usb",
        bitrate: int | None = 250_000,
        data_bitrate: int | None = None,
        dev_port: str = "0",
        dev_id: str = "0x0",
    ) -> None:
        """An interface at a place below /sys/devices; without one it has no hardware."""
        index = len(self.kinds) + 3
        devices = self.root / "sys/devices"
        net = devices / (place or "virtual") / "net" / name
        net.mkdir(parents=True)
        files = {"ifindex": str(index), "dev_port": dev_port, "dev_id": dev_id, "type": "280"}
        for file, text in files.items():
            (net / file).write_text(f"{text}\n")
        (self.root / "sys/class/net" / name).symlink_to(net)
        self.kinds[index] = ("can" if place else driver, bitrate, data_bitrate)
        if place:
            (net / "device").symlink_to(devices / place)
            self._link(devices / place / "driver", f"bus/drivers/{driver}")
            self._subsystems(place)

    def serial(self, place: str, number: str | None) -> None:
        """A USB device: a place with idVendor, and mostly with a serial number."""
        directory = self.root / "sys/devices" / place
        (directory / "idVendor").write_text("0c72\n")
        if number is not None:
            (directory / "serial").write_text(f"{number}\n")

    def query(self, index: int) -> tuple[str | None, int | None]:
        """As the kernel would answer."""
        return self.kinds[index]

    def _subsystems(self, place: str) -> None:
        directory = self.root / "sys/devices"
        for part in place.split("/"):
            directory /= part
            if subsystem := _subsystem(part):
                self._link(directory / "subsystem", f"bus/{subsystem}")

    def _link(self, file: Path, target: str) -> None:
        if not file.is_symlink():
            file.symlink_to(self.root / "sys" / target)


def _subsystem(part: str) -> str | None:
    """That of the parts of the places above."""
    if part.startswith("spi_master"):
        return None
    if part.startswith("spi"):
        return "spi" if "." in part else "spi_master"
    if part.startswith("0000:"):
        return "pci"
    if part.startswith("usb") or "-" in part:
        return "usb"
    return None if part.startswith("pci") or part == "platform" else "platform"


def bus(channel: str = "can0", bitrate: int | None = None, **match: Any) -> Bus:
    expected = Match(**match) if match else None
    return Bus(interface="socketcan", channel=channel, bitrate=bitrate, match=expected)
