"""The operator's joysticks as a process: their frames at their cycle time, each with its moment."""

import json
import math
import select
import socket
from contextlib import suppress
from pathlib import Path
from typing import Any

from canshaper.bus.packet import FD_SIZE, FDF, pack
from canshaper.codec.frame import EFF_FLAG
from canshaper.commissioning.doctor.processes import JOYSTICKS_PRIORITY, real_time, say_ready
from canshaper.gate.cycle import boottime_ns, run_at_deadlines
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.strokes import Script

# Clock of the joysticks, slower than ours by so much: their frames pass through every phase of the
# tick, as those of a real joystick do over the hours.
SLOWER = 1.01
# The hand: neutral for a moment, out and back in a triangle, then the other way.
NEUTRAL_S = 0.2
STROKE_S = 1.0
LARGEST = 0.8
# Frames of so many steps are sent late and not left out; sending all would make it later still.
MOST_CAUGHT_UP = 5


class Waving(Script):
    """A hand that moves every joystick of any machine, always."""

    def command(self, axis: str, time_s: float) -> float:
        """Joystick value; the same for all axes."""
        stroke, at_s = divmod(time_s, NEUTRAL_S + STROKE_S)
        way = (at_s - NEUTRAL_S) / STROKE_S
        if way <= 0.0:
            return 0.0
        side = LARGEST if stroke % 2 else -LARGEST
        return side * (1.0 - abs(2.0 * way - 1.0))


class Joysticks:
    """All joysticks of a deployment on sockets that stand for its buses.

    Attributes:
        sent: for each bus and frame, in order: number of its joystick in the deployment (-1 for
            other messages), ns by ``boottime_ns``.
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
        """Play until the other end is closed."""
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
    """Play from the first frame that comes until the loop ends; print what was sent when."""
    sockets = {name: socket.socket(fileno=fd) for name, fd in options["sockets"].items()}
    for one in sockets.values():
        one.setblocking(False)
    joysticks = Joysticks(load_deployment(Path(options["file"])), sockets)
    real_time(JOYSTICKS_PRIORITY)
    say_ready()
    select.select(list(sockets.values()), [], [])
    joysticks.run()
    print(json.dumps(joysticks.sent))
