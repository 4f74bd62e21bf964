"""SocketCAN sockets with the filters and options that a control loop needs.

Why not python-can: docs/decisions.md#raw-sockets.
"""

import errno
import os
import select
import socket
import struct
from collections.abc import Callable, Iterable
from pathlib import Path

from canshaper.bus.device import ROOT, check_device, check_mtu, has_echo, interface_index
from canshaper.codec.frame import EFF_FLAG, EFF_MASK, SERVICES, SFF_MASK, group_mask
from canshaper.config.bus import Bus
from canshaper.errors import WrongDeviceError
from canshaper.machine.routing import BusRoutes

# linux/can/raw.h, linux/can.h, asm/socket.h; Python has no names for these.
CAN_RAW_ERR_FILTER = 2
CAN_INV_FILTER = 0x20000000
SO_MEMINFO = 55
MOST_FILTERS = 512  # CAN_RAW_FILTER_MAX
# linux/can/error.h: all classes but 0x2, lost arbitration, which is normal on a bus.
ERROR_CLASSES = 0x1FFFFFFD
# Classes that show the state of the CAN controller: 0x4, 0x40, 0x100. A disturbed bus sends floods
# of the others.
STATE_CLASSES = 0x144
# linux/sockios.h, linux/if.h
SIOCGIFFLAGS, IFF_UP, IFF_RUNNING = 0x8913, 0x1, 0x40
NO_ECHO = (
    "it does not say whether a frame got onto the bus (no echo, as slcan), so a cut line to a valve"
    " would trip no axis; another adapter, or unconfirmed: true in its section"
)
# Size for the backlog of a long stall; the kernel's default holds about 300 frames.
RECEIVE_BUFFER_BYTES = 1 << 20

_FILTER = struct.Struct("=II")
_MEMINFO = struct.Struct("=9I")  # linux/sock_diag.h; the last member is SK_MEMINFO_DROPS


def open_sockets(bus: Bus, ids: BusRoutes | None) -> list[socket.socket]:
    """Open the sockets of one interface, and check its device if the deployment file names one.

    With ``ids`` there are three. The first receives the messages that we read. The second sends; it
    receives our own frames back, frames of other senders with our ids, and the error frames. The
    third receives unknown ids, but on a bus of a gateway nothing. So neither our own frames nor a
    flood of others delays a joystick frame. Without ``ids`` there is one socket for all frames.

    Raises:
        OSError: the kernel has no CAN, or there is no such interface, or it has no CAN FD, or the
            bus has valves and the interface confirms no frame.
        WrongDeviceError: the device is another one or cannot be read; no frame was handed on.
    """
    opened: list[socket.socket] = []
    try:
        for _ in range(1 if ids is None else 3):
            opened.append(socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW))
            opened[-1].setblocking(False)
            if bus.fd:
                opened[-1].setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        opened[0].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        receive_errors(opened[0 if ids is None else 1], ERROR_CLASSES)
        if ids is not None:
            # We send on the second socket: a frame sent on the first would come back on the second
            # without MSG_CONFIRM, as the frame of another program.
            opened[1].setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, 1)
            # A frame must fit every filter of the third socket, not one of them.
            opened[2].setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_JOIN_FILTERS, 1)
            set_filters(opened, ids)
        check_present(bus)
        for one in opened:
            one.bind((bus.channel,))
        check_mtu(bus)
        if ids is not None and ids.valves and not bus.unconfirmed and not has_echo(bus.channel):
            raise OSError(errno.EOPNOTSUPP, NO_ECHO)
        check_device(opened, bus)
    except (OSError, WrongDeviceError):
        for one in opened:
            one.close()
        raise
    return opened


def check_present(bus: Bus, root: Path = ROOT) -> None:
    """Check that the interface of a bus exists, before a socket is bound to it.

    If a process with root's rights binds to an unknown name, the kernel searches for a module that
    provides the interface. That takes up to half a second, in which no axis is driven. An empty
    name would bind to every interface.

    Raises:
        OSError: ENODEV, there is no such interface; without /sys only an empty name raises it.
    """
    names = root / "sys/class/net"
    if not bus.channel or (names.is_dir() and not (names / bus.channel).exists()):
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))


def receive_errors(one: socket.socket, classes: int) -> None:
    """Let a socket receive error frames of these classes only, bits of linux/can/error.h."""
    one.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, classes)


def carrier(one: socket.socket) -> bool | None:
    """Return whether an interface has a carrier, up to a second late; None if it is down or gone.

    The request does not wait for the lock that a change of any interface holds.

    Args:
        one: a socket that is bound to the interface.

    Raises:
        OSError: the interface disappears during the request.
    """
    from fcntl import ioctl  # noqa: PLC0415  (only POSIX has it)

    name = one.getsockname()[0].encode()
    if not name:  # it is gone, and the kernel would search for a module without a name
        return None
    flags = struct.unpack_from("=16xH", ioctl(one, SIOCGIFFLAGS, struct.pack("=16s24x", name)))[0]
    return bool(flags & IFF_RUNNING) if flags & IFF_UP else None


def renamed(one: socket.socket, channel: str, root: Path = ROOT) -> str:
    """Return a log line with an interface's new name; empty if it is gone or still ``channel``."""
    name = one.getsockname()[0]
    if name in ("", channel):
        return ""
    other = interface_index(channel, root)
    text = f"interface={name} ifindex={interface_index(name, root)}: no longer {channel}"
    return f"{text}, which is another one now, ifindex {other}" if other else text


def set_filters(sockets: list[socket.socket], ids: BusRoutes) -> None:
    """Set what each of the three sockets of ``open_sockets`` receives."""
    # If the DBC files have more ids than the kernel allows, the third socket receives them too. The
    # controller distinguishes them from unknown ids.
    ours = ids.received | ids.sent
    all_known = [m for m in ours | ids.known if not (m[1] and ids.j1939)]
    whole_kinds = ids.j1939 + len(SERVICES) * ids.canopen
    others = all_known if len(all_known) + whole_kinds <= MOST_FILTERS else ours
    groups: tuple[Iterable[int], ...] = ids.received_groups, ids.sent_groups, ()
    for one, messages, some, flag in zip(
        sockets, (ids.received, ids.sent, others), groups, (0, 0, CAN_INV_FILTER), strict=True
    ):
        words = [_word_and_mask(message) for message in messages]
        words += [(group | EFF_FLAG, group_mask(group) | EFF_FLAG) for group in some]
        if flag and ids.j1939:
            words.append((EFF_FLAG, EFF_FLAG))
        if flag and ids.canopen:
            words += [(base, mask | EFF_FLAG) for base, mask, _ in SERVICES]
        if flag and ids.in_line:
            words = []  # an empty list of filters: the socket receives no frame
        filters = filter_words((word | flag, mask) for word, mask in words)
        one.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, filters)


def filter_words(words: Iterable[tuple[int, int]]) -> bytes:
    """Return filters in the kernel's format from (id with its flags, mask of the tested bits)."""
    return b"".join(_FILTER.pack(word, mask) for word, mask in words)


def dropped_frames(sockets: list[socket.socket]) -> int:
    """Return how many frames these sockets have lost so far because a receive queue was full."""
    return sum(
        _MEMINFO.unpack(one.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, _MEMINFO.size))[8]
        for one in sockets
    )


def readable(one: socket.socket) -> Callable[[int], list[tuple[int, int]]]:
    """Return a function that waits so many ms at most; its list is empty if nothing waits."""
    poll = select.poll()
    poll.register(one, select.POLLIN)
    return poll.poll


def _word_and_mask(message: tuple[int, bool]) -> tuple[int, int]:
    """Return (id, mask) for one message; the mask tests the width of the id, too."""
    can_id, extended = message
    if extended:
        return can_id | EFF_FLAG, EFF_MASK | EFF_FLAG
    return can_id, SFF_MASK | EFF_FLAG
