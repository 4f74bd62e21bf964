"""The device behind a CAN interface, known by serial number or port: an interface name can change.

Serial number, port, channel and driver of hardware come from /sys/class/net. The bit rate, and the
kind of an interface without hardware, come from rtnetlink (linux/if_link.h, linux/can/netlink.h).
"""

import errno
import os
import re
import socket
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from canshaper.bus.netlink import KindAndBitrates, kind_and_bitrates
from canshaper.config.bus import Bus
from canshaper.errors import WrongDeviceError

ROOT = Path("/")
IFF_ECHO = 1 << 18  # linux/if.h: the driver returns a frame once it is on the bus
FD_MTU = 72  # linux/can.h, CANFD_MTU
# Directory names of a USB device and of an SPI device below /sys/devices, from which ID_PATH is
# made as the builtin path_id of udev makes it.
_USB_PORT = re.compile(r"\d+-(.+)")
_CHIP_SELECT = re.compile(r"spi\d+\.(\d+)")

LinkQuery = Callable[[int], KindAndBitrates]


@dataclass(frozen=True)
class Device:
    """Device behind an interface; None for each property that it does not have.

    Attributes:
        name: name of the interface.
        serial: serial number of a USB adapter.
        path: port that the adapter is plugged into, as udev's ID_PATH.
        port: channel of an adapter, from 0.
        driver: driver of the kernel; without hardware the kind of the interface, such as vcan.
        bitrate: bit/s.
        channels: number of interfaces of the same adapter.
        data_bitrate: bit/s in the data phase of CAN FD.
    """

    name: str
    serial: str | None
    path: str | None
    port: int
    driver: str | None
    bitrate: int | None
    channels: int = 1
    data_bitrate: int | None = None


def read_device(
    name: str, root: Path = ROOT, query_kernel: LinkQuery = kind_and_bitrates
) -> Device:
    """Return the device behind an interface.

    Args:
        name: name of the interface.
        root: root of the file system.
        query_kernel: returns kind and bit rates of the interface with an index.

    Raises:
        OSError: ENODEV if there is no such interface, or if another interface took the name
            meanwhile; other codes if the kernel cannot be asked.
    """
    directory = root / "sys/class/net" / name
    index = _number(directory / "ifindex")
    if index is None:
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
    kind, bitrate, data_bitrate = query_kernel(index)
    hardware = directory / "device"
    real = hardware.is_dir()
    places = list(_upwards(hardware.resolve(), root)) if real else []
    device = Device(
        name,
        _serial(places),
        _path(places),
        _number(directory / "dev_port") or _number(directory / "dev_id") or 0,
        (_linked(hardware / "driver") if real else None) or kind,
        bitrate,
        max(len(list((hardware / "net").glob("*"))), 1),
        data_bitrate,
    )
    if _number(directory / "ifindex") != index:  # the values may be of two devices
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
    return device


def check_device(sockets: Sequence[socket.socket], bus: Bus) -> None:
    """Compare the device behind bound sockets with the one in the file, if the file gives one.

    The sockets say which interface they are bound to: another interface may have the name by now.

    Raises:
        WrongDeviceError: it is another device, cannot be read, or its name changed hands.
        OSError: the interface is gone.
    """
    if bus.match is None:
        return
    names = [one.getsockname()[0] for one in sockets]
    try:
        device = read_device(names[0])
    except OSError as error:
        if error.errno == errno.ENODEV:
            raise
        raise WrongDeviceError(f"{bus.channel} cannot be looked at: {error.strerror}") from error
    # Each socket was bound by name; the kernel returns the name that its interface has now.
    if {*names, *(one.getsockname()[0] for one in sockets)} != {device.name}:
        raise WrongDeviceError(f"the name {bus.channel} changed hands while it was opened")
    if fault := device_fault(bus, device):
        raise WrongDeviceError(fault)


def check_mtu(bus: Bus, root: Path = ROOT) -> None:
    """Check that the interface of a CAN FD bus is set up for CAN FD.

    Raises:
        OSError: it is not.
    """
    mtu = _number(root / "sys/class/net" / bus.channel / "mtu") if bus.fd else None
    if mtu is not None and mtu < FD_MTU:
        text = f"expected an interface with CAN FD, which has the MTU {FD_MTU}, got {mtu}"
        raise OSError(errno.EINVAL, text)


def has_echo(name: str, root: Path = ROOT, query_kernel: LinkQuery = kind_and_bitrates) -> bool:
    """Return whether a frame that an interface echoes has been on the bus.

    If the driver has no echo (slcan), the kernel returns the frame as soon as it accepts it, even
    in bus-off. A virtual bus has no such difference. The answer is False if the kernel cannot be
    asked.
    """
    directory = root / "sys/class/net" / name
    if (_number(directory / "flags") or 0) & IFF_ECHO:
        return True
    try:
        return query_kernel(interface_index(name, root) or 0)[0] in ("vcan", "vxcan")
    except OSError:
        return False


def interface_index(name: str, root: Path = ROOT) -> int | None:
    """Return the index of the interface with this name now; None without one."""
    return _number(root / "sys/class/net" / name / "ifindex")


def device_fault(bus: Bus, device: Device) -> str | None:
    """Return why a device is not the one of a bus; None if it is, or if the bus names none."""
    values = expected(bus, device)
    wrong = [key for key, value in values.items() if getattr(device, key) != value]
    if not wrong:
        return None
    needed = ", ".join(f"{_WORDS[key]} {values[key]}" for key in wrong)
    there = ", ".join(_text(key, getattr(device, key)) for key in wrong)
    return f"expected {needed}, but {device.name} has {there}"


def expected(bus: Bus, device: Device) -> dict[str, str | int]:
    """Return the values that the device of a bus must have, by field of ``Device``.

    A bus without ``match`` asks for none. Its bit rates count if the interface reports bit rates.
    """
    if bus.match is None:
        return {}
    values: dict[str, str | int] = bus.match.model_dump(exclude_none=True)
    for key in ("bitrate", "data_bitrate"):
        if (rate := getattr(bus, key)) is not None and getattr(device, key) is not None:
            values.setdefault(key, rate)
    return values


def match_fault(bus: Bus) -> str | None:
    """Return why the interface of a bus is another device; None if not, or if none is named.

    Raises:
        OSError: there is no such interface, or the kernel cannot be asked.
    """
    fault = device_fault(bus, read_device(bus.channel))
    return f"{fault}{whereabouts(bus)}" if fault else None


def whereabouts(bus: Bus, root: Path = ROOT, query_kernel: LinkQuery = kind_and_bitrates) -> str:
    """Return the end of a message that names the interface where the device of a bus is now.

    It is empty if the bus names no serial number or path, or if the device is at its own channel.
    The interface is only reported, never driven: the file decides which interface is driven.
    """
    match = bus.match
    if match is None or (match.serial is None and match.path is None):
        return ""
    values = match.model_dump(exclude_none=True, exclude={"bitrate"})
    names = []
    for directory in sorted((root / "sys/class/net").glob("*")):
        try:
            device = read_device(directory.name, root, query_kernel)
        except OSError:  # it is gone, or is no interface
            continue
        if all(getattr(device, key) == value for key, value in values.items()):
            names.append(device.name)
    if names == [bus.channel]:
        return ""
    return f"; the device of the file is {', '.join(names) or 'not here'}"


_WORDS = {
    "serial": "serial number",
    "path": "path",
    "port": "port",
    "driver": "driver",
    "bitrate": "bit rate",
    "data_bitrate": "data bit rate",
}


def _text(key: str, value: str | int | None) -> str:
    return f"no {_WORDS[key]}" if value is None else f"{_WORDS[key]} {value}"


# -- /sys ------------------------------------------------------------------------------------------


def _upwards(place: Path, root: Path) -> Iterator[Path]:
    """Yield a device and the devices that it is plugged into, up to /sys/devices."""
    top = (root / "sys/devices").resolve()
    while place != top and top in place.parents:
        yield place
        place = place.parent


def _serial(places: Iterable[Path]) -> str | None:
    """Return the serial number of the nearest USB device, not of the hub above; None for none."""
    for place in places:
        if (place / "idVendor").exists():
            return _content(place / "serial")
    return None


def _path(places: Iterable[Path]) -> str | None:
    """Return udev's ID_PATH, which stays the same in every boot, whatever else is plugged in.

    Of successive places of one subsystem, such as a chain of hubs, the one nearest to the device
    contains the names of the others.
    """
    parts: list[str] = []
    before = None
    for place in places:
        subsystem = _linked(place / "subsystem")
        if subsystem != before or subsystem is None:
            part = _part(subsystem, place.name)
            parts += [part] if part else []
        before = subsystem
    return "-".join(reversed(parts)) or None


def _part(subsystem: str | None, name: str) -> str | None:
    if subsystem == "usb":
        port = _USB_PORT.fullmatch(name)
        return f"usb-0:{port[1]}" if port else None
    if subsystem == "spi":
        chip = _CHIP_SELECT.fullmatch(name)
        return f"cs-{chip[1]}" if chip else None
    return f"{subsystem}-{name}" if subsystem in ("pci", "platform") else None


def _linked(file: Path) -> str | None:
    """Return the last part of the target of a link; None if it is no link."""
    try:
        return file.readlink().name
    except OSError:
        return None


def _content(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8", errors="replace").strip() or None
    except OSError:
        return None


def _number(file: Path) -> int | None:
    text = _content(file)
    return int(text, 0) if text else None
