"""python-can's ``udp_multicast`` restricted to this computer.

python-can itself joins the group on the network card, and sends and receives there. So every
computer of the network would receive the frames of a bench, and could send frames to it.
"""

import os
import socket
import struct

import can
from can.interfaces.udp_multicast.bus import GeneralPurposeUdpMulticastBus, UdpMulticastBus

from canshaper.bus.packet import SO_TIMESTAMPNS

LOOPBACK = "lo"
PORT = 43113  # as in python-can
# linux/in.h, linux/in6.h; Python has no names for these.
IP_MULTICAST_ALL, IPV6_MULTICAST_ALL = 49, 29
# struct ip_mreqn: group, address of an interface, its index
_MEMBERSHIP = struct.Struct("@4s4si")


class LocalMulticastBus(UdpMulticastBus):
    """``udp_multicast`` over the loopback interface: no frame leaves or enters this computer.

    Args:
        channel: an IPv4 group such as 239.1.2.3; every program on this computer may join it.

    Raises:
        ValueError: the channel is no such group.
        can.CanInitializationError: the socket cannot be made: another program holds its port.
    """

    def __init__(self, channel: str) -> None:
        if not _is_group(channel):
            text = f"expected a group of IPv4 such as 239.1.2.3 or network: true, got {channel}"
            raise ValueError(text)
        self._multicast = _LocalSocket(channel, PORT, hop_limit=0)
        # Not the constructor of UdpMulticastBus, which joins the group on the network card.
        can.BusABC.__init__(self, channel)
        self._can_protocol = can.CanProtocol.CAN_FD


class _LocalSocket(GeneralPurposeUdpMulticastBus):
    """Socket bound to the group and joined on the loopback interface alone, with TTL 0."""

    def _create_socket(self, address_family: socket.AddressFamily) -> socket.socket:
        one = socket.socket(address_family, socket.SOCK_DGRAM)
        try:
            group = socket.inet_aton(self.group)
            membership = _MEMBERSHIP.pack(group, bytes(4), socket.if_nametoindex(LOOPBACK))
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            one.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            one.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, membership)
            one.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, self.hop_limit)
            # Receive only the group that this socket joined, on the interface where it did.
            one.setsockopt(socket.IPPROTO_IP, IP_MULTICAST_ALL, 0)
            one.bind((self.group, self.port))  # no datagrams to an address of this computer
            one.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        except OSError:
            one.close()
            raise
        self.timestamp_nanosecond = True
        return one


def _is_group(channel: str) -> bool:
    try:
        return 224 <= socket.inet_pton(socket.AF_INET, channel)[0] <= 239
    except OSError:
        return False


def receive_one_group(fileno: int) -> None:
    """Let a multicast socket receive the frames of its own group only.

    Otherwise Linux delivers the frames of every group that any program on this computer has joined
    at the same port, so that two buses would be one.
    """
    with socket.socket(fileno=os.dup(fileno)) as one:
        if one.family == socket.AF_INET6:
            one.setsockopt(socket.IPPROTO_IPV6, IPV6_MULTICAST_ALL, 0)
        else:
            one.setsockopt(socket.IPPROTO_IP, IP_MULTICAST_ALL, 0)
