"""A tick of a replay, its result, and the clock that makes ticks for a log without them."""

import math
import re
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from canshaper.codec.frame import Frame, MessageKey
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.gate.cycle import Standstill, io_cycle
from canshaper.recording.channels import Kind
from canshaper.shaping.states import Reason, State
from canshaper.shaping.sway import SwayMode

Timed = tuple[int, Frame]
Sorted = tuple[int, Frame, Kind]
# Every axis is in neutral, and nothing changes any more, when no frame has come for so long: the
# longest timeout and the longest stop are over.
PAUSE_NS = 12_000_000_000
LEAD_NS = 1_000_000_000
DEGREES = math.degrees(1.0)
STATE_CHANGE = re.compile(r"axis=(\S+) state=(\S+) .*?reason=(\S+)")
"""An event of an axis: its name, state and reason."""


@dataclass(slots=True)
class Tick:
    """One tick; times are those of the log.

    Attributes:
        number: number of its deadline, from 0.
        now_ns: time of the tick.
        received: (arrival in ns, frame) since the tick before, in order.
        others: frames that the daemon reads after the valves have their frames.
        logged: (arrival in ns, frame) of the kind that the daemon sends, from any sender.
    """

    number: int
    now_ns: int
    received: list[Timed] = field(default_factory=list)
    others: list[Frame] = field(default_factory=list)
    logged: list[Timed] = field(default_factory=list)


class Row(NamedTuple):
    """One axis after a tick.

    The row has the demand ``command`` and the sent velocity ``applied``, [-1, 1]; the predicted
    sway, 0.0 without a model; the part ``added`` to the velocity by a motion of two axes, which
    makes no swing; state, number of the parameter set, and its sway mode, None without a model.
    """

    command: float
    applied: float
    sway_deg: float
    added: float
    state: State
    active_set: int
    mode: SwayMode | None


new_row = tuple.__new__  # Row(...) in half the time


@dataclass(slots=True)
class Difference:
    """Data of a frame in the replay and in the recording that differ; None where it is missing."""

    key: MessageKey
    ours: bytes | None
    recorded: bytes | None


@dataclass(slots=True)
class Result:
    """Result of a tick.

    Attributes:
        sent: sent frames, in order.
        rows: row of each axis.
        events: texts that the daemon would have logged.
        differences: differences from the recorded frames.
        compared: number of compared frames.
    """

    sent: list[Frame]
    rows: dict[str, Row]
    events: list[str]
    differences: list[Difference] = field(default_factory=list)
    compared: int = 0


def rows_of(controller: Controller) -> Callable[[], dict[str, Row]]:
    """Return a function that returns the present row of each axis of a controller."""
    rows = [(name, _row_of(controller, one)) for name, one in controller.axes.items()]
    return lambda: {name: row() for name, row in rows}


def _row_of(controller: Controller, control: AxisControl) -> Callable[[], Row]:
    config, axis = control.bound.config, control.axis
    joystick, signal = controller.joysticks[config.command.joystick], config.command.signal
    full_speed_m_s = config.sway.full_speed_m_s if config.sway else 0.0

    def row() -> Row:
        command = joystick.commands.get(signal, 0.0)
        sway = axis.sway
        sway_deg = DEGREES * sway.sway_rad(full_speed_m_s) if sway is not None else 0.0
        command = 0.0 if type(command) is Reason else command
        sent, mode = axis.output.setpoint, sway.mode if sway is not None else None
        added = sent - axis.output.applied
        values = command, sent, sway_deg, added, axis.state, control.active_set, mode
        return new_row(Row, values)

    return row


def clocked(frames: Iterable[Sorted], tick_ns: int) -> Iterator[Tick]:
    """Yield the ticks of a clock, from half a tick after the first received frame to the last one.

    Frames before that first one are dropped; those of the kind that the daemon sends go into
    ``logged``. In a pause the ticks from 12 s after a frame to 1 s before the next are left out.
    """
    tick: Tick | None = None
    for time_ns, frame, kind in frames:
        if tick is None:
            if kind is not Kind.RECEIVED:
                continue
            tick = Tick(0, time_ns + tick_ns // 2)
        quiet_ns = tick.now_ns
        while time_ns > tick.now_ns:
            yield tick
            now_ns = tick.now_ns + tick_ns
            if now_ns - quiet_ns > PAUSE_NS and time_ns - now_ns > LEAD_NS:
                now_ns += (time_ns - LEAD_NS - now_ns) // tick_ns * tick_ns
            tick = Tick(tick.number + 1, now_ns)
        if kind is Kind.RECEIVED:
            tick.received.append((time_ns, frame))
        elif kind is Kind.OTHER:
            tick.others.append(frame)
        else:
            tick.logged.append((time_ns, frame))
    if tick is not None:
        yield tick


class LogPort:
    """One port in place of all buses of a log.

    Args:
        stamped: names of the buses whose frames carry the time of their arrival.

    Attributes:
        arrived_ns: arrival of the frame that ``frames`` yielded last; for a bus that is not
            ``stamped``, the time of the last cycle.
        sent: frames sent since the tick began.
    """

    def __init__(self, stamped: Container[str]) -> None:
        self.arrived_ns = 0
        self.sent: list[Frame] = []
        self._stamped = stamped
        self._received: list[Timed] = []
        self._others: list[Frame] = []
        self._before_ns = 0

    def begin(self, tick: Tick, before_ns: int) -> None:
        """Begin a tick; ``before_ns`` is the time of the last cycle."""
        self.sent, self._before_ns = [], before_ns
        self._received, self._others = tick.received, tick.others

    def frames(self) -> Iterator[Frame]:
        """Yield every waiting frame."""
        waiting, self._received = self._received, []
        for time_ns, frame in waiting:
            # Without stamps a port knows only the time of its last reading.
            self.arrived_ns = time_ns if frame.bus in self._stamped else self._before_ns
            yield frame

    def background(self) -> Iterator[Frame]:
        """Return the frames that the daemon reads after the valves have their frames."""
        waiting, self._others = self._others, []
        return iter(waiting)

    def send(self, frame: Frame) -> bool:
        """Keep a sent frame; return True."""
        self.sent.append(frame)
        return True


class Stepper:
    """A deployment driven by the ticks of a clock, through the I/O cycle of the daemon.

    Args:
        controller: a new controller.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        buses = controller.deployment.config.buses
        stamped = {name for name, bus in buses.items() if bus.interface == "socketcan"}
        self._port = LogPort(stamped)
        self._ports = dict.fromkeys(buses, self._port)
        self._standstill = Standstill(controller.deployment)
        self._standstill.clock = lambda: 0  # nothing is ever late here
        self._gated = GatedController(controller)
        self._rows = rows_of(controller)

    def step(self, tick: Tick) -> Result:
        """Run a tick with its frames; return what is sent, before tick 0 also neutral frames."""
        controller, port = self._controller, self._port
        first = self._gated.neutral_frames() if tick.number == 0 else []
        port.begin(tick, self._standstill.last_ns)
        io_cycle(self._gated, self._ports, tick.now_ns, 0, self._standstill)
        events = [event.text for event in controller.events]
        controller.events.clear()
        return Result(first + port.sent, self._rows(), events)
