"""A serial CAN adapter on a pseudo-terminal behind the kernel's slcan, with states of its own."""

import fcntl
import os
import pty
import struct
import subprocess
import termios
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

N_TTY, N_SLCAN = 0, 17  # linux/tty.h
SIOCGIFNAME = 0x8910  # linux/sockios.h
BUS_OFF, ACTIVE = b"sb000255\r", b"sa000000\r"


class Adapter(threading.Thread):
    """The far end of the serial line.

    Attributes:
        channel: name of the interface.
        seen: what the driver has written to the line.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        subprocess.run(["modprobe", "slcan"], check=True)
        self._far, self._near = pty.openpty()
        for one in (self._far, self._near):
            tty.setraw(one)
        self.speaks(N_SLCAN)
        name: bytes = fcntl.ioctl(self._near, SIOCGIFNAME, bytes(16))
        self.channel = name.rstrip(b"\0").decode()
        self.seen = bytearray()

    def run(self) -> None:
        with suppress(OSError):  # closed
            while data := os.read(self._far, 4096):
                self.seen += data

    def speaks(self, discipline: int) -> None:
        fcntl.ioctl(self._near, termios.TIOCSETD, struct.pack("i", discipline))

    def says(self, line: bytes) -> None:
        os.write(self._far, line)

    def down(self) -> None:
        subprocess.run(["ip", "link", "set", self.channel, "down"], check=True)

    def up(self) -> None:
        subprocess.run(["ip", "link", "set", self.channel, "up"], check=True)

    def valve_frames(self) -> int:
        return self.seen.count(b"t200")


@contextmanager
def adapter() -> Iterator[Adapter]:
    one = Adapter()
    one.start()
    options = ["type", "can", "bitrate", "250000"]
    subprocess.run(["ip", "link", "set", one.channel, *options], check=True)
    one.up()
    assert not int(Path(f"/sys/class/net/{one.channel}/flags").read_text(), 0) & 0x40000
    try:
        yield one
    finally:
        one.speaks(N_TTY)  # which ends the interface
