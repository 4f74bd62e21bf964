"""Interface and device of a bus: whether its ``match`` holds, and the lines for a file without."""

import errno
import json
import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from canshaper.bus.device import (
    IFF_ECHO,
    ROOT,
    Device,
    LinkQuery,
    device_fault,
    read_device,
    whereabouts,
)
from canshaper.bus.netlink import kind_and_bitrates
from canshaper.commissioning.doctor.verdict import Finding, Level
from canshaper.config.bus import Bus

# The directories of ``ip``, which an ordinary user's path may lack.
SBIN = ":/usr/sbin:/sbin"
ARPHRD_CAN = 280  # linux/if_arp.h
IFF_UP = 0x1  # linux/if.h
SYS_FILES = ("type", "flags", "tx_queue_len", "mtu")


@dataclass(frozen=True)
class Link:
    """A network interface.

    Attributes:
        can: whether it is a CAN interface.
        kind: of its driver: can (a controller), vcan, vxcan; None where it is not known.
        up: whether it is set up.
        echo: whether its driver hands a frame back once it is on the bus.
        queue: length of its transmit queue, frames.
        mtu: bytes of the kernel's frames that it carries: 16 of classical CAN, 72 of CAN FD.
        data: details of a controller, in the words of ``ip``; empty where there are none.
        counts: its errors since it was plugged in, by the names of ``ip``.
    """

    name: str
    can: bool
    kind: str | None
    up: bool
    echo: bool
    queue: int
    mtu: int
    data: dict[str, Any]
    counts: dict[str, int]

    def rate(self, timing: str = "bittiming") -> int | None:
        """Return the rate of a timing, bit/s, or of an adapter without timings; None if unknown."""
        rate = self.data.get(timing, {}).get("bitrate", self.data.get(f"{timing}_bitrate"))
        return int(rate) if rate else None


def read_link(name: str, root: Path = Path("/")) -> Link | None:
    """Return an interface as ``ip`` shows it, else as /sys does; None where there is none."""
    tool = shutil.which("ip", path=os.environ.get("PATH", "") + SBIN)
    if tool:
        command = [tool, "-details", "-statistics", "-json", "link", "show", "dev", name]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0 and (link := parse_ip(done.stdout)):
            return link
    return read_sys(name, root)


def parse_ip(text: str) -> Link | None:
    """Return what ``ip -details -statistics -json link show`` printed; None for no interface."""
    try:
        entries = [entry for entry in json.loads(text) if entry.get("ifname")]
    except ValueError:  # an ip without -json
        return None
    if not entries:
        return None
    entry = entries[0]
    info = entry.get("linkinfo", {})
    return Link(
        name=entry["ifname"],
        can=entry.get("link_type") == "can",
        kind=info.get("info_kind"),
        up="UP" in entry["flags"],
        echo="ECHO" in entry["flags"],
        queue=entry.get("txqlen", 0),
        mtu=entry.get("mtu", 0),
        data=info.get("info_data", {}),
        counts=info.get("info_xstats", {}),
    )


def read_sys(name: str, root: Path) -> Link | None:
    """Return an interface as /sys/class/net shows it, without its controller; None for none."""
    directory = root / "sys/class/net" / name
    try:
        texts = {f: (directory / f).read_text().strip() for f in SYS_FILES}
    except OSError:
        return None
    return Link(
        name=name,
        can=int(texts["type"]) == ARPHRD_CAN,
        kind=None,
        up=bool(int(texts["flags"], 0) & IFF_UP),
        echo=bool(int(texts["flags"], 0) & IFF_ECHO),
        queue=int(texts["tx_queue_len"]),
        mtu=int(texts["mtu"]),
        data={},
        counts={},
    )


LONGEST_NAME = 15  # IFNAMSIZ of linux/if.h, without its end
# Characters of a serial number that udev replaces by an underscore in ID_SERIAL_SHORT.
_REPLACED = re.compile(r"[^0-9A-Za-z#+\-.:=@_]")


def device_findings(
    name: str, bus: Bus, root: Path = ROOT, query_kernel: LinkQuery = kind_and_bitrates
) -> list[Finding]:
    """Check that the interface of a bus is the device that the file names.

    Without such an interface there is no finding.

    Args:
        name, bus: of the bus in the deployment file, and its section.
        root: of the file system.
        query_kernel: asks for kind and bit rates of the interface with an index.
    """
    subject = f"{bus.channel} device"
    try:
        device = read_device(bus.channel, root, query_kernel)
    except OSError as error:
        if error.errno == errno.ENODEV:  # a finding on the interface says so
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
    """Return lines to paste: ``match`` for the file; with serial or path files that name it too.

    Args:
        name, device: of the bus in the deployment file, and its device now.
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
    """Return the udev rule that names a device by its serial number, or else by its path.

    It needs one of the two, and has to run after 75-net-description.rules.

    Raises:
        OSError: the interface of an adapter with several channels is gone.
    """
    parts = ['SUBSYSTEM=="net"', 'ACTION=="add"']
    if device.serial:
        parts.append(f'ATTRS{{serial}}=="{device.serial}"')
    else:
        parts.append(f'ENV{{ID_PATH}}=="{device.path}"')
    if device.channels > 1:  # a driver counts its channels in one of these files
        directory = root / "sys/class/net" / device.name
        for file in ("dev_port", "dev_id"):
            parts.append(f'ATTR{{{file}}}=="{(directory / file).read_text().strip()}"')
    return ", ".join([*parts, f'NAME="{new}"'])
