"""The daemon as an inline gateway: between two deadlines it waits for frames and passes them on."""

import errno
import logging
import select
import socket
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress

from canshaper.bus.device import check_device
from canshaper.bus.interface import GONE, REOPEN_NS
from canshaper.bus.packet import FD_SIZE
from canshaper.bus.port import Port
from canshaper.bus.socketcan import CAN_INV_FILTER, RECEIVE_BUFFER_BYTES, filter_words
from canshaper.codec.frame import FrameFault
from canshaper.config.bus import Bus
from canshaper.errors import BusError, GatewayError, WrongDeviceError
from canshaper.gate.cycle import FrameProcessor, Standstill, receive_waiting
from canshaper.machine.deployment import Deployment
from canshaper.protocols.gateway.cangw import Rule, between, difference, rules
from canshaper.protocols.gateway.forwarding import Pattern
from canshaper.protocols.gateway.rules import excluded, passing_rules

log = logging.getLogger("canshaper")

# Most frames of others that are passed on before the joysticks are read again.
MOST_AT_ONCE = 8
# Most rounds in which a socket is readable but gives no frame: useless frames, or an error.
MOST_EMPTY = 10
# Time between two checks of the kernel's rules.
CHECK_NS = 10_000_000_000


class Bridge:
    """Passes the frames of other nodes on, in both directions and in order.

    Args:
        buses: the two buses of SocketCAN.
        excluded: patterns of the frames that do not pass.
        on_fault: called for every frame that was read and could not be sent.

    Raises:
        BusError: an interface cannot be opened.
    """

    def __init__(
        self,
        buses: tuple[Bus, Bus],
        excluded: Iterable[Pattern],
        on_fault: Callable[[FrameFault], None],
    ) -> None:
        self._buses = buses
        self._matched = any(bus.match for bus in buses)
        words = [(pattern.value | CAN_INV_FILTER, pattern.mask) for pattern in excluded]
        self._filters = filter_words(words)
        self._on_fault = on_fault
        self._not_before_ns = 0
        self.sockets: list[socket.socket] = []
        try:
            self._open()
        except (OSError, WrongDeviceError) as error:
            names = " and ".join(bus.channel for bus in buses)
            why = error.strerror if isinstance(error, OSError) else error
            raise BusError(f"gateway: cannot open {names}: {why}") from error

    def _open(self) -> None:
        opened: list[socket.socket] = []
        try:
            for bus in self._buses:
                opened.append(socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW))
                opened[-1].setblocking(False)
                opened[-1].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
                opened[-1].setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_JOIN_FILTERS, 1)
                opened[-1].setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, self._filters)
                if bus.fd:
                    opened[-1].setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
                opened[-1].bind((bus.channel,))
                check_device(opened[-1:], bus)
        except (OSError, WrongDeviceError):
            for one in opened:
                one.close()
            raise
        self.sockets = opened

    def pass_on(self) -> int:
        """Pass on ``MOST_AT_ONCE`` frames of each bus at most; return how many were read.

        While an interface is gone, try to open both again.
        """
        if not self.sockets:
            self._reopen()
        count = 0
        for source, destination in zip(self.sockets, self.sockets[::-1], strict=True):
            for _ in range(MOST_AT_ONCE):
                try:
                    data = source.recv(FD_SIZE)
                except BlockingIOError:
                    break
                except OSError as error:
                    if error.errno in GONE or (self._matched and error.errno == errno.ENETDOWN):
                        self._gone()
                        return count
                    break  # down: the port of this bus reports it
                count += 1
                try:
                    destination.send(data)
                except OSError:
                    self._on_fault(FrameFault.SEND_FAILED)
        return count

    def _gone(self) -> None:
        self.close()
        self._not_before_ns = time.monotonic_ns() + REOPEN_NS

    def _reopen(self) -> None:
        now_ns = time.monotonic_ns()
        if now_ns >= self._not_before_ns:
            self._not_before_ns = now_ns + REOPEN_NS
            with suppress(OSError, WrongDeviceError):  # the port of this bus reports it
                self._open()

    def close(self) -> None:
        """Close both sockets."""
        for one in self.sockets:
            one.close()
        self.sockets = []


class InlineGateway:
    """An inline gateway: it forwards frames, or checks the rules by which the kernel does.

    Unless both buses are of SocketCAN, it warns, and no frame of others passes.

    Args:
        deployment: a deployment with a gateway.
        on_fault: called for every frame that the daemon could not pass on.

    Raises:
        BusError: an interface cannot be opened.
    """

    def __init__(self, deployment: Deployment, on_fault: Callable[[FrameFault], None]) -> None:
        gateway = deployment.config.gateway
        assert gateway is not None  # only such deployments have one
        self._bridge: Bridge | None = None
        self._check_ns = 0
        self._logged: str | None = None
        first, second = (deployment.config.buses[bus] for bus in gateway.between)
        self._kernel = gateway.forwarding == "kernel"
        self._real = {first.interface, second.interface} == {"socketcan"}
        self._rules = passing_rules(deployment)
        if not self._real:
            log.warning("gateway=nothing-passes others are passed on with socketcan only")
        elif not self._kernel:
            self._bridge = Bridge((first, second), excluded(deployment), on_fault)

    def wait(
        self,
        seconds: float,
        processor: FrameProcessor,
        ports: Mapping[str, Port],
        standstill: Standstill,
    ) -> None:
        """Pass on incoming frames until a deadline (in ``seconds``); frames of joysticks first.

        Frames that come later are left to the tick, which knows whether the loop stood still: such
        frames must not leave with the velocities of the last tick.
        """
        clock = standstill.clock
        until_ns = clock() + round(seconds * 1e9)
        empty = 0
        while (left_ns := until_ns - clock()) > 0:
            if empty > MOST_EMPTY:
                time.sleep(left_ns / 1e9)
                return
            waiting = [fd for fd in (port.fileno() for port in ports.values()) if fd >= 0]
            if self._bridge:
                waiting += [one.fileno() for one in self._bridge.sockets]
            ready, _, _ = select.select(waiting, [], [], left_ns / 1e9)
            now_ns = clock()
            if not ready or now_ns >= until_ns or standstill.over(now_ns):
                return
            empty += not (
                receive_waiting(processor, ports, now_ns, standstill) + self.pass_others()
            )

    def pass_others(self) -> int:
        """Pass on some frames of others, unless the kernel does; return how many were read."""
        return self._bridge.pass_on() if self._bridge else 0

    def check(self, now_ns: int, *, neutral: bool) -> None:
        """Log when the kernel's rules begin or cease to differ from those of the deployment.

        The check takes a part of a tick, so it is rare, and made only while no axis moves.
        """
        if not self._kernel or not self._real or not neutral or now_ns < self._check_ns:
            return
        self._check_ns = now_ns + CHECK_NS
        if (fault := rules_fault(self._rules)) != self._logged:
            self._logged = fault
            level = logging.WARNING if fault else logging.INFO
            log.log(level, "gateway=%s", fault or "rules-right")

    def close(self) -> None:
        """Close the sockets; no frame is passed on any more."""
        if self._bridge:
            self._bridge.close()


def rules_fault(expected: list[Rule]) -> str:
    """Return what is wrong with the kernel's rules, or why they cannot be read; empty if right."""
    try:
        present = between({rule.source for rule in expected}, rules())
    except GatewayError as error:
        return f"rules-not-known {error}"
    more, missing = difference(present, expected)
    faults = [f"rules-missing {len(missing)} of {len(expected)}"] if missing else []
    faults += [f"rules-too-many {', '.join(map(str, more))}"] if more else []
    return "; ".join(faults)
