"""``unshare -n python -m tests.bus.neighbour``: a machine with a network card, and its neighbour.

One bus of ``udp_multicast`` is used, and a drive as ``canshaper demo`` makes it; the neighbour
counts what reaches it and sends frames of its own. The last line is JSON.
"""

import json
import select
import socket
import struct
import subprocess
import sys
from pathlib import Path

from can import Message
from can.interfaces.udp_multicast.utils import pack_message

from canshaper.bus.multicast import PORT
from canshaper.bus.port import Port, open_port
from canshaper.cli.common import loader
from canshaper.codec.frame import Frame
from canshaper.config.schema import Bus
from canshaper.design.processes import choose_transport, drive_on_bus
from canshaper.errors import DriveError
from canshaper.machine.deployment import Deployment
from canshaper_sim.operator import script_named

CARD, WIRE = "out0", "wire0"
ADDRESS, NEIGHBOUR = "192.0.2.1", "192.0.2.9"
GROUP = "239.81.8.1"
CANNOT = 75
ETH_P_ALL, ETH_P_IP = 3, 0x0800
PACKET_OUTGOING = 4
FRAMES = 50
# One is enough where the machine has time for it.
DRIVES = 3
# A frame is there at once or never; what is not to come is waited for behind one that does.
WAIT_S = 20.0


def main() -> None:
    """Use a bus, count packets, print what was seen."""
    shared = sys.argv[1:] == ["shared"]
    for text in (
        "link set lo up",
        f"link add {CARD} type veth peer name {WIRE}",
        f"addr add {ADDRESS}/24 dev {CARD}",
        f"link set {CARD} up",
        f"link set {WIRE} up",
        f"route add default via {NEIGHBOUR}",
    ):
        for one in ("all", "default"):  # it speaks to its neighbours by itself
            Path(f"/proc/sys/net/ipv6/conf/{one}/disable_ipv6").write_text("1")
        done = subprocess.run(["ip", *text.split()], capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"no card for the network namespace: ip {text}: {done.stderr.strip()}")
            sys.exit(CANNOT)
    capture = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETH_P_ALL))
    capture.bind((CARD, ETH_P_ALL))
    capture.setblocking(False)
    faults: list[object] = []
    bus = Bus(interface="udp_multicast", channel=GROUP, network=shared)
    sender, receiver = (open_port("crane", bus, faults.append) for _ in range(2))
    for number in range(FRAMES):
        assert sender.send(Frame("crane", 0x100 + number, False, b"x"))
    received = received_ids(receiver, 0x100 + FRAMES - 1)
    outcome = {"sent": FRAMES, "received": len(received)}
    if not shared:
        file = loader("forwarder.yaml")()
        outcome["drive"] = any(slewed(file) for _ in range(DRIVES))
    outcome["outside"] = outgoing(capture)
    outcome["from_outside"] = injected(sender, receiver, capture.getsockname()[4])
    for port in (sender, receiver):
        port.close()
    assert not faults, faults
    print(json.dumps(outcome))


def slewed(deployment: Deployment) -> bool:
    """Whether the daemon commanded slewing in a drive of processes on this machine.

    Where a busy machine holds a joystick's frames up, the axis waits for neutral until the end.
    """
    script = script_named("pulse-slew", list(deployment.axes))
    way = choose_transport("udp_multicast", deployment)
    try:
        drive = drive_on_bus(deployment, way, script, [], bypass=False, on_progress=lambda _: None)
    except DriveError as error:  # the processes have not started in time
        print(error)
        return False
    return max(drive.recording.axes["slew"].sent) > 0


def received_ids(port: Port, last: int) -> list[int]:
    """Ids of the frames that come, up to one that is known to."""
    ids: list[int] = []
    while last not in ids:
        assert select.select([port.fileno()], [], [], WAIT_S)[0], ids
        ids += [frame.can_id for frame in port.frames()]
    return ids


def outgoing(capture: socket.socket) -> int:
    """Packets that left by the card."""
    count = 0
    while True:
        try:
            _, (_, _, kind, *_) = capture.recvfrom(2048)
        except BlockingIOError:
            return count
        count += kind == PACKET_OUTGOING


def injected(sender: Port, receiver: Port, mac: bytes) -> list[int]:
    """The neighbour sends a frame to the group, and one to our address: ids of what comes in."""
    group = bytes((1, 0, 0x5E, *socket.inet_aton(GROUP)[1:]))
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW) as wire:
        wire.bind((WIRE, 0))
        for to, address, can_id in ((group, GROUP, 0x7A1), (mac, ADDRESS, 0x7A2)):
            data = pack_message(Message(arbitration_id=can_id, is_extended_id=False))
            wire.send(to + bytes(6) + struct.pack("!H", ETH_P_IP) + datagram(address, data))
    sender.send(Frame("crane", 0x7FF, False, b""))
    # What is sent to our address, one of the sockets of the port gets.
    ids = received_ids(receiver, 0x7FF) + [frame.can_id for frame in sender.frames()]
    return sorted(set(ids) - {0x7FF})


def datagram(to: str, data: bytes) -> bytes:
    """An IPv4 packet of the neighbour's with UDP; its checksum may be left out."""
    addresses = socket.inet_aton(NEIGHBOUR) + socket.inet_aton(to)
    udp = struct.pack("!4H", PORT, PORT, 8 + len(data), 0) + data
    head = struct.pack("!BBHHHBBH", 0x45, 0, 20 + len(udp), 1, 0, 8, 17, 0) + addresses
    total = sum(struct.unpack("!10H", head))
    total = (total & 0xFFFF) + (total >> 16)
    checksum = struct.pack("!H", ~(total + (total >> 16)) & 0xFFFF)
    return head[:10] + checksum + head[12:] + udp


if __name__ == "__main__":
    main()
