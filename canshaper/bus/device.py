"""The device behind a CAN interface: names change hands, a serial number and a place do not.

Where the facts come from: /sys/class/net for serial number, place, channel and driver of hardware;
rtnetlink (linux/if_link.h, linux/can/netlink.h) for the bit rate, and for the kind of an interface
without hardware.
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
IFF_ECHO = 1 << 18  # linux/if.h: the driver hands a frame back once it is on the bus
FD_MTU = 72  # linux/can.h, CANFD_MTU
# What two places in the tree of devices are called, and which of their parents they stand for; as
# the builtin path_id of udev makes ID_PATH.
_USB_PORT = re.compile(r"\d+-(.+)")
_CHIP_SELECT = re.compile(r"spi\d+\.(\d+)")

LinkQuery = Callable[[int], KindAndBitrates]


@dataclass(frozen=True)
class Device:
    """Device behind an interface; None for each property that it does not have.

    Attributes:
        name: of the interface.
        serial: serial number of a USB adapter.
        path: where it is plugged in, as udev's ID_PATH.
        port: channel of an adapter, from 0.
        driver: of the kernel; the kind of an interface without hardware, such as vcan.
        bitrate: bit/s.
        channels: interfaces of the same adapter.
        data_bitrate: bit/s of the data of CAN FD.
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
    """The device behind an interface.

    Args:
        name: of the interface.
        root: of the file system.
        query_kernel: for kind and bit rates of the interface with an index.

    Raises:
        OSError: ENODEV where there is no such interface, or the name changed hands meanwhile;
            others where the kernel cannot be asked.
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
    if _number(directory / "ifindex") != index:  # what was read may be of two devices
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
    return device


def check_device(sockets: Sequence[socket.socket], bus: Bus) -> None:
    """Compare the device that bound sockets are on with the one of the deployment.

    By what they are bound to: the name may have changed hands since it was looked up.

    Raises:
        WrongDeviceError: it is another one, or what it is cannot be known.
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
    # Each socket was bound by the name, and the kernel returns the name that its device has now.
    if {*names, *(one.getsockname()[0] for one in sockets)} != {device.name}:
        raise WrongDeviceError(f"the name {bus.channel} changed hands while it was opened")
    if fault := device_fault(bus, device):
        raise WrongDeviceError(fault)


def check_mtu(bus: Bus, root: Path = ROOT) -> None:
    """Whether the interface of a bus of CAN FD is set up for it.

    Raises:
        OSError: it is not.
    """
    mtu = _number(root / "sys/class/net" / bus.channel / "mtu") if bus.fd else None
    if mtu is not None and mtu < FD_MTU:
        text = f"expected an interface with CAN FD, which has the MTU {FD_MTU}, got {mtu}"
        raise OSError(errno.EINVAL, text)


def has_echo(name: str, root: Path = ROOT, query_kernel: LinkQuery = kind_and_bitrates) -> bool:
    """Whether a frame of ours that comes back from an interface is on the bus.

    Without an echo of the driver (slcan) the kernel hands it back as soon as it takes it, also in
    bus-off. On a virtual bus both are the same. Where the kernel cannot be asked: no.
    """
    directory = root / "sys/class/net" / name
    if (_number(directory / "flags") or 0) & IFF_ECHO:
        return True
    try:
        return query_kernel(interface_index(name, root) or 0)[0] in ("vcan", "vxcan")
    except OSError:
        return False


def interface_index(name: str, root: Path = ROOT) -> int | None:
    """Number of the interface that has a name now; None where none has it."""
    return _number(root / "sys/class/net" / name / "ifindex")


def device_fault(bus: Bus, device: Device) -> str | None:
    """Why a device is not the one of a bus; None where it is, or the bus names none."""
    values = expected(bus, device)
    wrong = [key for key, value in values.items() if getattr(device, key) != value]
    if not wrong:
        return None
    needed = ", ".join(f"{_WORDS[key]} {values[key]}" for key in wrong)
    there = ", ".join(_text(key, getattr(device, key)) for key in wrong)
    return f"expected {needed}, but {device.name} has {there}"


def expected(bus: Bus, device: Device) -> dict[str, str | int]:
    """Return the values that a device has to have, by its fields.

    The bit rates of the bus count too, for an interface that has them.
    """
    if bus.match is None:
        return {}
    values: dict[str, str | int] = bus.match.model_dump(exclude_none=True)
    for key in ("bitrate", "data_bitrate"):
        if (rate := getattr(bus, key)) is not None and getattr(device, key) is not None:
            values.setdefault(key, rate)
    return values


def match_fault(bus: Bus) -> str | None:
    """Why the interface of a bus is not its device now; None where it is.

    Raises:
        OSError: there is no such interface, or the kernel cannot be asked.
    """
    fault = device_fault(bus, read_device(bus.channel))
    return f"{fault}{whereabouts(bus)}" if fault else None


def whereabouts(bus: Bus, root: Path = ROOT, query_kernel: LinkQuery = kind_and_bitrates) -> str:
    """Which interface is the device of a bus now, behind a message; empty where none is named.

    It is only reported, never used by itself: which bus is driven stands in the file.
    """
    match = bus.match
    if match is None or (match.serial is None and match.path is None):
        return ""
    values = match.model_dump(exclude_none=True, exclude={"bitrate"})
    names = []
    for directory in sorted((root / "sys/class/net").glob("*")):
        try:
            device = read_device(directory.name, root, query_kernel)
        except OSError:  # it went away, or is no interface
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
    """A device and those that it is plugged into, up to /sys/devices."""
    top = (root / "sys/devices").resolve()
    while place != top and top in place.parents:
        yield place
        place = place.parent


def _serial(places: Iterable[Path]) -> str | None:
    """Serial number of the USB device that a place belongs to; not that of the hub above it."""
    for place in places:
        if (place / "idVendor").exists():
            return _content(place / "serial")
    return None


def _path(places: Iterable[Path]) -> str | None:
    """As udev's ID_PATH: the same in every boot, whatever else is plugged in.

    Of neighbours of one subsystem, such as the hubs of an adapter, the one next to the device
    says it all.
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
    """Last part of where a link leads."""
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
