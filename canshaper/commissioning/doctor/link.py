"""A network interface of this machine as the system reports it, by ``ip`` or by /sys."""

import json
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from canshaper.bus.device import IFF_ECHO

# Not in the path of an ordinary user everywhere.
SBIN = ":/usr/sbin:/sbin"
ARPHRD_CAN = 280  # linux/if_arp.h
IFF_UP = 0x1  # linux/if.h
SYS_FILES = ("type", "flags", "tx_queue_len", "mtu")


@dataclass(frozen=True)
class Link:
    """A network interface.

    Attributes:
        name: of the interface.
        can: whether it is a CAN interface.
        kind: of its driver: can (a controller), vcan, vxcan; None where it is not known.
        up: whether it is set up.
        echo: whether its driver hands a frame back once it is on the bus.
        queue: length of its transmit queue, frames.
        mtu: bytes of the kernel's frames that it carries: 16 of classical CAN, 72 of CAN FD.
        data: details of a controller, in the words of ``ip``; empty where there are none.
        counts: its errors since it was set up first.
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

    @property
    def bitrate(self) -> int | None:
        """Bit rate, bit/s."""
        return self._rate("bittiming")

    @property
    def data_bitrate(self) -> int | None:
        """Bit rate of the data of CAN FD, bit/s."""
        return self._rate("data_bittiming")

    def _rate(self, timing: str) -> int | None:
        """Return the rate of a timing; of an adapter without timings, the rate that it reports."""
        rate = self.data.get(timing, {}).get("bitrate", self.data.get(f"{timing}_bitrate"))
        return int(rate) if rate else None


def read_link(name: str, root: Path = Path("/")) -> Link | None:
    """The interface of that name by ``ip``, or without one by /sys; None where there is none."""
    tool = shutil.which("ip", path=os.environ.get("PATH", "") + SBIN)
    if tool:
        command = [tool, "-details", "-statistics", "-json", "link", "show", "dev", name]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0 and (link := parse_ip(done.stdout)):
            return link
    return read_sys(name, root)


def parse_ip(text: str) -> Link | None:
    """An interface from the output of ``ip -details -statistics -json link show``."""
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
    """An interface from /sys/class/net, which has no details of controllers."""
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
