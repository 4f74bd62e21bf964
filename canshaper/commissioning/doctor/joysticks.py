"""The joysticks: listened to on the real bus, and played to the measured loop by a process."""

import json
import math
import select
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

from canshaper.bus.packet import (
    ANCILLARY_BYTES,
    FD_SIZE,
    FDF,
    SO_TIMESTAMPNS,
    frame_of,
    pack,
    stamp_ns,
)
from canshaper.bus.socketcan import open_sockets
from canshaper.codec.frame import EFF_FLAG, Frame
from canshaper.commissioning.doctor.processes import JOYSTICKS_PRIORITY, real_time, say_ready
from canshaper.commissioning.doctor.verdict import Finding, Level, summary
from canshaper.gate.cycle import boottime_ns, run_at_deadlines
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.recording.channels import InputFinder
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.strokes import Script

LOOK_S = 0.2


def inputs_of(deployment: Deployment) -> dict[str, BoundInput]:
    """Return the messages that the deployment always needs, by a name for people."""
    inputs: dict[str, BoundInput] = {f"joystick {n}": lv for n, lv in deployment.joysticks.items()}
    if deployment.emergency_stop:
        inputs["emergency stop"] = deployment.emergency_stop
    return inputs


def listen(
    deployment: Deployment, seconds: float, on_progress: Callable[[float], None]
) -> dict[str, list[int]]:
    """Listen; return when each message on SocketCAN came, ns, by the names of ``inputs_of``.

    ``on_progress`` is called with the seconds that have passed.

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
    """Return the next frame and when the kernel received it, ns; None without data or time."""
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


# The clock of the joysticks is slower than ours by this factor, so that their frames meet every
# phase of the tick, as those of a real joystick do within hours.
SLOWER = 1.01
# The hand rests in neutral, deflects in a triangle, then does the same in the other direction.
NEUTRAL_S = 0.2
STROKE_S = 1.0
LARGEST = 0.8
# After a delay the frames of so many steps are sent late; sending more would delay the next.
MOST_CAUGHT_UP = 5


class Waving(Script):
    """A script that moves every joystick of any machine without end."""

    def command(self, axis: str, time_s: float) -> float:
        """Return the deflection at a time, part of full, the same for all axes."""
        stroke, at_s = divmod(time_s, NEUTRAL_S + STROKE_S)
        way = (at_s - NEUTRAL_S) / STROKE_S
        if way <= 0.0:
            return 0.0
        side = LARGEST if stroke % 2 else -LARGEST
        return side * (1.0 - abs(2.0 * way - 1.0))


class Joysticks:
    """All joysticks and the emergency stop of a deployment on sockets that stand for its buses.

    Attributes:
        sent: by bus, of each frame in order: number of its joystick in the deployment (-1 of
            another message), and when it was sent, ns of ``boottime_ns``.
    """

    def __init__(self, deployment: Deployment, sockets: dict[str, socket.socket]) -> None:
        self._node = JoystickNode(deployment, Waving("waving", (), math.inf))
        self._sockets = sockets
        self._fd = deployment.fd
        joysticks = list(deployment.joysticks.values())
        inputs = [*joysticks, *([deployment.emergency_stop] if deployment.emergency_stop else [])]
        self._numbers = {joystick.key: number for number, joystick in enumerate(joysticks)}
        self._step_ms = math.gcd(*(i.message.cycle_time or 0 for i in inputs))
        self._time_ms = 0
        self.sent: dict[str, list[tuple[int, int]]] = {name: [] for name in sockets}

    def run(self) -> None:
        """Send the frames of the joysticks until the other end is closed."""
        run_at_deadlines(round(self._step_ms * 1_000_000 * SLOWER), self._body)

    def _body(self, _now_ns: int, missed: int, _late_ns: int) -> bool:
        for one in self._sockets.values():  # what valves and displays receive
            with suppress(BlockingIOError, ConnectionError):
                while one.recv(FD_SIZE):
                    pass
        try:
            for late in range(missed, -1, -1):
                self._send(late <= MOST_CAUGHT_UP)
        except ConnectionError:  # the loop has ended
            return False
        return True

    def _send(self, now: bool) -> None:
        for frame in self._node.frames(self._time_ms) if now else ():
            word = frame.can_id | EFF_FLAG if frame.extended else frame.can_id
            flags = FDF if frame[:3] in self._fd else None
            data = pack(word, frame.data, flags)
            at_ns = boottime_ns()
            try:
                self._sockets[frame.bus].send(data)
            except BlockingIOError:  # the loop stands still
                continue
            self.sent[frame.bus].append((self._numbers.get(frame[:3], -1), at_ns))
        self._time_ms += self._step_ms


def main(options: dict[str, Any]) -> None:
    """Send from the first frame received until the loop ends; print ``Joysticks.sent``."""
    sockets = {name: socket.socket(fileno=fd) for name, fd in options["sockets"].items()}
    for one in sockets.values():
        one.setblocking(False)
    joysticks = Joysticks(load_deployment(Path(options["file"])), sockets)
    real_time(JOYSTICKS_PRIORITY)
    say_ready()
    select.select(list(sockets.values()), [], [])
    joysticks.run()
    print(json.dumps(joysticks.sent))
