"""The joysticks on the real bus, only listened to: are they there, and how regular are they?"""

import select
import socket
import time
from collections.abc import Callable
from itertools import pairwise

from canshaper.bus.packet import ANCILLARY_BYTES, FD_SIZE, SO_TIMESTAMPNS, frame_of, stamp_ns
from canshaper.bus.socketcan import open_sockets
from canshaper.codec.frame import Frame
from canshaper.commissioning.doctor.verdict import Finding, Level, summary
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.recording.channels import InputFinder

LOOK_S = 0.2


def inputs_of(deployment: Deployment) -> dict[str, BoundInput]:
    """Messages that the deployment needs all the time, by a name for people."""
    inputs: dict[str, BoundInput] = {f"joystick {n}": lv for n, lv in deployment.joysticks.items()}
    if deployment.emergency_stop:
        inputs["emergency stop"] = deployment.emergency_stop
    return inputs


def listen(
    deployment: Deployment, seconds: float, on_progress: Callable[[float], None]
) -> dict[str, list[int]]:
    """Times of reception, ns, of the messages on SocketCAN buses, by the names of ``inputs_of``.

    Raises:
        OSError: an interface cannot be opened.
        WrongDeviceError: one is another device than the deployment names.
    """
    inputs = inputs_of(deployment)
    names = {bound.key: name for name, bound in inputs.items()}
    finder = InputFinder(deployment.config.buses, inputs.values())
    arrivals_ns: dict[str, list[int]] = {}
    sockets: dict[socket.socket, str] = {}
    try:
        for bus, config in deployment.config.buses.items():
            expected = [name for key, name in names.items() if key[0] == bus]
            if expected and config.interface == "socketcan":
                (one,) = open_sockets(config, None)
                sockets[one] = bus
                one.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
                arrivals_ns |= {name: [] for name in expected}
        begin = time.monotonic()
        while sockets and (passed := time.monotonic() - begin) < seconds:
            on_progress(passed)
            ready, _, _ = select.select(list(sockets), [], [], min(LOOK_S, seconds - passed))
            for one in ready:
                if received := _next(one, sockets[one]):
                    frame, time_ns = received
                    if bound := finder.find(frame, time_ns):
                        arrivals_ns[names[bound.key]].append(time_ns)
    finally:
        for one in sockets:
            one.close()
    return arrivals_ns


def _next(one: socket.socket, bus: str) -> tuple[Frame, int] | None:
    """The next data frame of a socket and when the kernel received it, ns; None for another one."""
    packet, ancillary, _, _ = one.recvmsg(FD_SIZE, ANCILLARY_BYTES)
    frame, time_ns = frame_of(bus, packet), stamp_ns(ancillary)
    return None if frame is None or time_ns is None else (frame, time_ns)


def arrival_findings(deployment: Deployment, arrivals_ns: dict[str, list[int]]) -> list[Finding]:
    """Check period and gaps of each message against its cycle and its timeout."""
    findings = []
    for name, bound in inputs_of(deployment).items():
        if name in arrivals_ns:
            cycle_ms = bound.message.cycle_time or 0
            findings.append(_regular(name, arrivals_ns[name], cycle_ms, bound.config.timeout_ms))
        else:
            findings.append(Finding(name, Level.NOTE, "not on SocketCAN: not listened to"))
    return findings


def _regular(name: str, times_ns: list[int], cycle_ms: int, timeout_ms: int) -> Finding:
    gaps_ns = [after - before for before, after in pairwise(times_ns)]
    gaps = summary(gaps_ns)
    if gaps is None:
        remedy = "switch the machine on; look at bit rate, wiring and the id in the DBC file"
        return Finding(name, Level.BAD, f"{len(times_ns)} frames received", remedy)
    text = (
        f"{gaps.count + 1} frames, a period of {gaps.p50 / 1000:.1f} ms (DBC: {cycle_ms} ms),"
        f" the longest {gaps.max / 1000:.1f} ms"
    )
    if gaps.max >= timeout_ms * 1000:
        remedy = "joystick or bus are disturbed, or timeout_ms is too short for it"
        return Finding(name, Level.BAD, f"{text}: lost by timeout_ms {timeout_ms}", remedy)
    if not 0.5 * cycle_ms <= gaps.p50 / 1000 <= 1.5 * cycle_ms:
        remedy = "give the message the GenMsgCycleTime that it really has"
        return Finding(name, Level.WARNING, text, remedy)
    if gaps.max >= timeout_ms * 500:
        remedy = f"more than half of timeout_ms {timeout_ms}: how busy is the bus?"
        return Finding(name, Level.WARNING, text, remedy)
    return Finding(name, Level.OK, text)
