"""The device behind a bus: does ``match`` hold now, and what to write where there is none."""

import errno
import json
import re
from pathlib import Path

from canshaper.bus.device import (
    ROOT,
    Device,
    LinkQuery,
    device_fault,
    kind_and_bitrates,
    read_device,
    whereabouts,
)
from canshaper.commissioning.doctor.verdict import Finding, Level
from canshaper.config.bus import Bus

LONGEST_NAME = 15  # IFNAMSIZ of linux/if.h, without its end
# What udev leaves of a serial number in ID_SERIAL_SHORT; all else is an underscore there.
_REPLACED = re.compile(r"[^0-9A-Za-z#+\-.:=@_]")


def device_findings(
    name: str, bus: Bus, root: Path = ROOT, query_kernel: LinkQuery = kind_and_bitrates
) -> list[Finding]:
    """Whether the interface of a bus is its device; none where there is no such interface.

    Args:
        name: of the bus in the deployment file.
        bus: its section.
        root: of the file system.
        query_kernel: for kind and bit rates of the interface with an index.
    """
    subject = f"{bus.channel} device"
    try:
        device = read_device(bus.channel, root, query_kernel)
    except OSError as error:
        if error.errno == errno.ENODEV:  # said of the interface itself
            return []
        level = Level.BAD if bus.match else Level.WARNING
        return [Finding(subject, level, f"cannot be looked at: {error.strerror}")]
    if bus.match is None:
        level = Level.WARNING if device.serial or device.path else Level.NOTE
        text = f"bus {name} has no match: whatever is called {bus.channel} is driven"
        return [Finding(subject, level, text, to_paste(name, device, root))]
    if fault := device_fault(bus, device):
        there = whereabouts(bus, root, query_kernel)
        remedy = "nothing is sent there: plug it in where it was, or correct names or match"
        return [Finding(subject, Level.BAD, f"{fault}{there}", remedy)]
    return [Finding(subject, Level.OK, f"match of bus {name} holds")]


def to_paste(name: str, device: Device, root: Path = ROOT) -> str:
    """Lines for the deployment file, and for a name of its own: networkd and udev.

    Args:
        name: of the bus in the deployment file.
        device: its device now.
        root: of the file system.
    """
    match: dict[str, str | int | None] = {"driver": device.driver}
    if device.serial:
        match = {"serial": device.serial}
    elif device.path:
        match = {"path": device.path}
    if device.channels > 1:
        match["port"] = device.port
    if device.bitrate:
        match["bitrate"] = device.bitrate
    text = ", ".join(f"{key}: {json.dumps(value)}" for key, value in match.items())
    lines = [f"in the deployment file, bus {name}: match: {{ {text} }}"]
    if not (device.serial or device.path):
        return lines[0]
    new = f"can-{re.sub('[^0-9A-Za-z]+', '-', name)}"[:LONGEST_NAME].rstrip("-")
    lines.append(f"for a name of its own (then channel: {new} in the deployment file)")
    if device.channels == 1:  # a .link file cannot distinguish channels
        if device.serial:
            which = f"Property=ID_SERIAL_SHORT={_REPLACED.sub('_', device.serial)}"
        else:
            which = f"Path={device.path}"
        lines.append(f"/etc/systemd/network/60-{new}.link:")
        lines += ["  [Match]", f"  {which}", "  [Link]", f"  Name={new}"]
        lines.append("  TransmitQueueLength=16")
        lines.append("or, without networkd:")
    lines.append(f"/etc/udev/rules.d/76-{new}.rules:")
    lines.append(f"  {rule(new, device, root)}")
    return "\n".join(lines)


def rule(new: str, device: Device, root: Path = ROOT) -> str:
    """Rule of udev, for after 75-net-description.rules, that gives a device the name ``new``."""
    parts = ['SUBSYSTEM=="net"', 'ACTION=="add"']
    if device.serial:
        parts.append(f'ATTRS{{serial}}=="{device.serial}"')
    else:
        parts.append(f'ENV{{ID_PATH}}=="{device.path}"')
    if device.channels > 1:  # in one of them its driver counts the channels
        directory = root / "sys/class/net" / device.name
        for file in ("dev_port", "dev_id"):
            parts.append(f'ATTR{{{file}}}=="{(directory / file).read_text().strip()}"')
    return ", ".join([*parts, f'NAME="{new}"'])
