"""A drive with J1939, read by cantools, by tshark and by the kernel."""

import socket
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from tests.hil.j1939_drive import FILE, as_wireshark_sees, drive, not_decoded, set_points
from tests.hil.j1939_nodes import NAME, kernel_has_j1939, ours
from tests.rigs.j1939 import OWN

DM1 = 0xFECA
# Address claim, request, transport: the kernel keeps them for itself, or their destination varies.
TRANSPORT = {0xEEFF, 0xEAFF, 0xECFF, 0xEBFF}
SHIPPED = (
    "j1939-forwarder",
    "j1939-profiles",
    "j1939-rollers",
    "j1939-sensor",
    "js6000-forwarder",
    "pvedcc-forwarder",
    "remote-forwarder",
)
OTHER_VALVES = ("pvedcc-forwarder", "remote-forwarder")  # of 11 bits
# Set points on the way to full speed and back: a filter makes tens of them, its limits alone ten.
SHAPED = 20


class Kernel(threading.Thread):
    """A socket of the kernel's J1939 for all: NAME and group of what comes from our address."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        kernel_has_j1939()
        self.seen: set[tuple[int, int]] = set()
        self._ended = threading.Event()
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_J1939)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        nothing = socket.J1939_NO_NAME, socket.J1939_NO_PGN, socket.J1939_NO_ADDR
        self._socket.bind(("vcan0", *nothing))
        self._socket.settimeout(0.5)  # how often it looks whether it is to end

    def run(self) -> None:
        while not self._ended.is_set():
            with suppress(TimeoutError):
                _, (_, name, group, source) = self._socket.recvfrom(2000)
                if source == OWN:
                    self.seen.add((name, group))

    def end(self) -> None:
        self._ended.set()
        self.join()
        self._socket.close()


@pytest.mark.parametrize("name", SHIPPED)
def test_a_drive_is_read_by_cantools_by_tshark_and_by_the_kernel(tmp_path: Path, name: str) -> None:
    file = FILE.with_name(f"{name}.yaml")
    kernel = Kernel()
    kernel.start()
    try:
        logs = drive(tmp_path, file=file)
    finally:
        kernel.end()
    points = set_points(logs, file, "near_far")
    assert len(set(points)) > SHAPED, sorted(set(points))
    assert points[0] == points[-1] == 0
    assert not any(set_points(logs, file, "slew"))
    log = logs["vcan0"]
    assert not_decoded(log, file) == []
    sent = {m.arbitration_id >> 8 & 0x3FFFF for m in ours(log)} - TRANSPORT
    valves = {0xFE30, 0xFE31, 0xFE32}
    assert sent >= (valves | {DM1} if name not in OTHER_VALVES else {DM1})
    assert {(NAME, group) for group in sent} <= kernel.seen
    seen = as_wireshark_sees(log)
    if seen is None:
        pytest.skip("no tshark here; cantools and the kernel have read every frame")
    counts, errors = seen
    assert errors == []
    groups = {(int(group), int(source)) for group, source in counts if group}
    assert groups >= {(0xFDD6, 0x33), *((group, OWN) for group in sent)}
    assert counts["60928", str(OWN)] >= 1
    assert counts["65226", str(OWN)] >= 5  # DM1, once a second
