"""The daemon's controller at the ticks of a log."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from canshaper.codec.codecs import Sender
from canshaper.codec.e2e import COUNTER, E2e
from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.controller.counters import Counters
from canshaper.controller.runner import AxisRunner
from canshaper.daemon.standstill import Standstill
from canshaper.machine.deployment import Deployment
from canshaper.recording.sorting import Key
from canshaper.recording.ticks import Tick, Timed
from canshaper.shaping.states import Reason, State

# A status waits for its turn on the bus; a valve frame of the next tick may be seen before it.
MOST_BEHIND = 2
DEGREES = math.degrees(1.0)
AT_REST = frozenset((State.NEUTRAL_WAIT, State.READY, State.TRIPPED))


class Row(NamedTuple):
    """One axis after a tick: stick and velocity sent, [-1, 1]; predicted sway, degrees."""

    stick: float
    sent: float
    sway_deg: float


new_row = tuple.__new__  # Row(...) in half the time


class Choice(NamedTuple):
    """What a tick has read, where the log leaves it open.

    Attributes:
        first: number of the first frame that was read, of those that wait.
        last: and of the first one that was not yet.
        shift_ns: how much earlier or later than its valve frame says it was.
        earlier: how many deadlines before the one that its valve frame says it was for: a daemon
            that is held up between reading and sending.
    """

    first: int
    last: int
    shift_ns: int = 0
    earlier: int = 0


@dataclass(slots=True)
class Difference:
    """A frame that is not what the log says; None where there is none."""

    key: Key
    ours: bytes | None
    logged: bytes | None


@dataclass(slots=True)
class Result:
    """What a tick has made.

    Attributes:
        sent: frames, in order.
        rows: by axis.
        events: what the daemon would have logged.
        differences: to the log, of commands and of status of axes.
        service: the same, of the status of the service.
        compared: frames that were compared.
        agrees: nothing that a replay must have the same is different.
        behind: a frame is missing that may come behind the next tick's valve frame.
    """

    sent: list[Frame]
    rows: dict[str, Row]
    events: list[str]
    differences: list[Difference] = field(default_factory=list)
    service: list[Difference] = field(default_factory=list)
    compared: int = 0
    agrees: bool = True
    behind: bool = False


class Stepper:
    """One deployment, driven tick by tick.

    Args:
        load: reads the deployment; called again for every daemon that starts in the log, because
            what has been sent is counted in its messages.
        compare: whether the log has what a daemon sent.

    Attributes:
        controller: the daemon's own.
        carried: frames that were there at the last tick and that it has not read.
        number: of the last tick.
        heard: when the last frame that was read arrived, by message.
        standstill: the daemon's own, by the times of the log.
    """

    def __init__(self, load: Callable[[], Deployment], *, compare: bool) -> None:
        self._load = load
        self._compare = compare
        self._begin(load())

    def _begin(self, deployment: Deployment) -> None:
        self.deployment = deployment
        self.controller = Controller(deployment)
        self.carried: list[Timed] = []
        self.heard: dict[Key, int] = {}
        self.number = -1
        self._stamped = {
            n for n, b in deployment.config.buses.items() if b.interface == "socketcan"
        }
        self.fresh = True
        self._tick_ns = deployment.config.tick_ms * 1_000_000
        self.standstill = Standstill(deployment)
        self._waiting: dict[Key, deque[bytes]] = {}
        self._valves = {a.valve.message.sender.key for a in deployment.axes.values()}
        self._service = deployment.status.sender.key if deployment.status else None
        self._unknown: set[str] = set()
        self._rows = [(n, _row_of(self.controller, r)) for n, r in self.controller.axes.items()]

    def begin(self, tick: Tick) -> None:
        """Prepare for a tick that does not follow the one before.

        A controller as fresh as that of a daemon that starts. One that has read its files again
        knows what was latched, and whether it stood still meanwhile. For one that ran before, what
        the log says of it is put in: states, counters, alive counters. What it knew of the swing
        is not in the log; the model begins at rest.
        """
        if not self.fresh:
            before, last_ns = self.controller, self.standstill.last_ns
            self._begin(self._load())
            if tick.reloaded:
                self.controller.carry_over(before)
                self.standstill.last_ns = last_ns
        self.fresh = False
        if tick.starts:
            return
        for number in range(tick.number):
            for _ in self.controller.tick(tick.now_ns + (number - tick.number) * self._tick_ns):
                pass
        self.controller.events.clear()
        self.number = tick.number - 1
        first: dict[Key, bytes] = {}
        for _, frame in tick.says:
            first.setdefault(frame[:3], frame.data)
        self._unknown = {name for name, axis in self.deployment.axes.items() if axis.status}
        self._take_over(tick.says)
        counters = self.controller.counters = Counters()
        if (status := self.deployment.status) and (data := first.get(status.sender.key)):
            raw = status.sender.fields.layout.decode(data)
            counters.values = {name: int(raw[name]) for name in counters.values}
            counters.last_fault = FrameFault(raw["LastFault"])
        for sender in self.deployment.senders():
            if data := first.get(sender.key):
                _count_to(sender, data)

    def _take_over(self, sent: list[Timed]) -> None:
        """States of axes of a daemon that ran before, once they are seen at rest."""
        for name in sorted(self._unknown):
            sender = self.deployment.axes[name].status.sender  # type: ignore[union-attr]
            data = next((frame.data for _, frame in sent if frame[:3] == sender.key), None)
            if data is None:
                continue
            raw = sender.fields.layout.decode(data)
            if raw["State"] in AT_REST:
                axis = self.controller.axes[name].axis
                axis.state, axis.reason = State(raw["State"]), Reason(raw["Reason"])
                self._unknown.discard(name)

    def waiting(self, tick: Tick) -> list[Timed]:
        """Frames that the tick may read."""
        return self.carried + tick.taken if self.carried else tick.taken

    def step(self, tick: Tick, choice: Choice | None = None) -> Result:
        """One tick; without a choice it reads all that waits."""
        controller, now_ns = self.controller, tick.now_ns
        taken = self.waiting(tick)
        self.carried = []
        if choice is not None:
            now_ns += choice.shift_ns
            self.carried = taken[choice.last :]
            taken = taken[choice.first : choice.last]
        sent: list[Frame] = []
        if tick.starts and not tick.reloaded:
            sent += controller.neutral_frames()
        number = tick.number - (choice.earlier if choice else 0)
        missed = number - self.number - 1
        self.number, before_ns = number, self.standstill.last_ns
        stalled = self.standstill.over(now_ns)
        self.standstill.last_ns = tick.now_ns
        if stalled:
            controller.stalled()
        for time_ns, frame in taken:
            # Without stamps a port knows only when it was read before.
            arrived_ns = min(time_ns if frame.bus in self._stamped else before_ns, now_ns)
            controller.receive(frame, arrived_ns)
            if not stalled:
                self.heard[frame[:3]] = arrived_ns
        sent += controller.tick(now_ns, missed)
        for frame in tick.others:
            controller.receive(frame, now_ns)
        rows = {name: row() for name, row in self._rows}
        events = [event.text for event in controller.events] if controller.events else []
        controller.events.clear()
        if tick.ends:
            sent += controller.neutral_frames()
        result = Result(sent, rows, events)
        if self._compare:
            self._compared(tick, result)
            if self._unknown:
                self._take_over(tick.sent)
        return result

    def _compared(self, tick: Tick, result: Result) -> None:
        """Compare with the log: the frames of each message in their order."""
        waiting = self._waiting
        if not waiting and result.sent == [frame for _, frame in tick.sent]:  # nearly always
            result.compared = len(tick.sent)
            return
        for bus, can_id, extended, data in result.sent:
            waiting.setdefault((bus, can_id, extended), deque()).append(data)
        for _, frame in tick.sent:
            key = frame[:3]
            queue = waiting.get(key)
            ours = queue.popleft() if queue else None
            result.compared += 1
            if ours != frame.data:
                self._differs(result, Difference(key, ours, frame.data))
        for key in [key for key, queue in waiting.items() if not queue]:
            del waiting[key]
        result.behind = bool(waiting) and not tick.open
        for key, queue in waiting.items() if not tick.open else ():
            while len(queue) > (0 if key in self._valves else MOST_BEHIND):
                self._differs(result, Difference(key, queue.popleft(), None))

    def _differs(self, result: Result, difference: Difference) -> None:
        if difference.key != self._service:
            result.differences.append(difference)
            result.agrees = False
            return
        result.service.append(difference)
        # Faults of the bus are not in the log, but every deadline that was missed is.
        if self._missed(difference.ours) != self._missed(difference.logged):
            result.agrees = False

    def _missed(self, data: bytes | None) -> int | None:
        status = self.deployment.status
        if data is None or status is None or len(data) != status.sender.fields.message.length:
            return None
        return int(status.sender.fields.layout.decode(data)["MissedDeadlines"])

    def align(self) -> None:
        """After a difference that stays: begin to compare anew with the next tick."""
        self._waiting = {}


def _row_of(controller: Controller, runner: AxisRunner) -> Callable[[], Row]:
    """Makes what is drawn of an axis."""
    config, axis = runner.bound.config, runner.axis
    joystick, signal = controller.joysticks[config.command.joystick], config.command.signal
    full_speed_m_s = config.sway.full_speed_m_s if config.sway else 0.0

    def row() -> Row:
        stick = joystick.commands.get(signal, 0.0)
        sway = axis.sway
        sway_deg = DEGREES * sway.sway_rad(full_speed_m_s) if sway is not None else 0.0
        return new_row(Row, (0.0 if type(stick) is Reason else stick, axis.sent, sway_deg))

    return row


def count_of(sender: Sender, data: bytes) -> int:
    """Alive counter of a frame of a message that has one."""
    protection = sender.protection
    if isinstance(protection.check, E2e):
        return data[1] & COUNTER
    return int(sender.fields.layout.decode(data)[protection.counter or ""])


def _count_to(sender: Sender, data: bytes) -> None:
    """Let the next frame of a message be the one that follows on the frame before this one."""
    counts = sender.protection.counts
    wanted = (count_of(sender, data) - 1) % counts if counts else 0
    for _ in range(counts):
        if count_of(sender, sender.protector.protect(dict(sender.fields.start))) == wanted:
            return
