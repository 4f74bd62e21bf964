"""Traffic on the buses of a machine, judged by its pages and its DBC files only.

``tests.faults.received`` decides from bytes what each message is worth; it shares no code with us.
"""

from collections import deque

from canshaper.codec.frame import Frame
from tests.faults.axis import Axis
from tests.faults.machine import Key, Machine
from tests.faults.received import (
    LONG_AGO,
    Received,
    ReceivedJoystick,
    ReceivedStop,
    ReceivedSwitches,
)

FOREIGN_NS = 1_000_000_000


class Seen:
    """One axis: what was asked of it, and the reasons to stop. Times are periods of its valve.

    Attributes:
        neutral: joystick valid, enabled and in neutral since the last reason to stop.
        latched: in motion it stopped at once, and neither reset nor enable was pressed since.
        stop_until: period up to which a shaped stop may last.
        demand: what is asked now, [-1, 1]; ``crossed`` since when to this side.
        asked: what was asked within the tail, with the period; ``deflected`` when it was last.
    """

    def __init__(self, axis: Axis, joystick: ReceivedJoystick, stop: ReceivedStop | None) -> None:
        self.axis, self.joystick, self.stop = axis, joystick, stop
        self.partner: Seen | None = None
        self.foreign_ns = LONG_AGO
        self.neutral = self.latched = False
        self.stop_until = self.period = -1
        self.demand, self.crossed, self._side = 0.0, 0, 1.0
        self.asked: deque[tuple[int, float]] = deque()
        self.deflected = -(10**6)
        self._causes: set[str] = set()
        self._seen = (0, 0, 0)
        self._presses = self._pressed = 0  # at the last look, and when it latched

    def failed(self) -> None:
        """Its last frame did not get out; at rest nothing is lost by that."""
        self._causes.add("send failed")

    def stopped_at_once(self, now_ns: int) -> set[str]:
        """Reasons to stop at once, now or since the last look."""
        joystick, stop = self.joystick, self.stop
        causes = set(self._causes)
        releases, disagreements, presses = self._seen
        if joystick.releases > releases or joystick.enable() == 0:
            causes.add("enable")
        if joystick.disagreements > disagreements or joystick.disagree(now_ns):
            causes.add("switch")
        if stop and (stop.presses > presses or stop.says_stop or not stop.fresh(now_ns)):
            causes.add("emergency stop")
        if now_ns - self.foreign_ns <= FOREIGN_NS:
            causes.add("second sender")
        return causes

    def look(self, now_ns: int, period: int, *, moves: bool) -> None:
        """A period begins, and what was received counts."""
        joystick, axis = self.joystick, self.axis
        causes, faults = self.stopped_at_once(now_ns), joystick.faults(axis, now_ns)
        if not moves:
            causes.discard("send failed")
        presses = joystick.presses[axis.name] + joystick.resets
        deflection = joystick.joysticks[axis.name][0]
        self.period, before, self.demand = period, self.asked, 0.0
        if causes:
            if (moves or causes & {"second sender", "emergency stop"}) and not self.latched:
                self.latched, self._pressed = True, self._presses
            self.neutral, self.stop_until = False, -1
            if not axis.moves_with:  # a motion adds by what was asked before as well
                before.clear()
        elif faults:
            if self.neutral:
                self.stop_until = period + axis.stop
            self.neutral = False
        elif abs(deflection) > axis.band:
            self.demand = deflection if self.neutral else 0.0
        elif not self.latched or presses > self._pressed:
            self.neutral, self.latched = True, False
        self._causes.clear()
        self._presses = presses
        self._seen = (
            joystick.releases,
            joystick.disagreements,
            self.stop.presses if self.stop else 0,
        )
        before.append((period, self.demand))
        while before[0][0] < period - axis.tail:
            before.popleft()
        if self.demand:
            self.deflected = period
        if self.demand * self._side < 0.0:
            self._side, self.crossed = -self._side, period

    def stalled(self) -> None:
        """The loop stood still."""
        self._causes.add("loop stalled")

    def most(self, sign: float) -> float:
        """Fastest demand in a direction within the tail; not above 0 for none."""
        return max((sign * demand for _, demand in self.asked), default=0.0)


class Buses:
    """All of a machine."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        joysticks = {name: ReceivedJoystick(one) for name, one in machine.joysticks.items()}
        switches = {one: ReceivedSwitches(one) for one in machine.switches}
        stop = ReceivedStop(machine.stop, machine.stop_field) if machine.stop else None
        self._joysticks = [*joysticks.values()]
        for one in self._joysticks:
            one.connect(joysticks, switches)
        entries: list[Received] = [*self._joysticks, *switches.values(), *([stop] if stop else [])]
        self._inputs: dict[Key, Received] = {one.source.key: one for one in entries}
        self.axes = {
            name: Seen(axis, joysticks[axis.joystick.name], stop)
            for name, axis in machine.axes.items()
        }
        for one in self.axes.values():
            if partner := one.axis.moves_with:
                one.partner = self.axes[partner.name]
        self.speed = dict.fromkeys(self.axes, 0.0)
        self._before: list[tuple[int, dict[str, int]]] | None = None
        self._last = -1

    def receive(self, frame: Frame, now_ns: int) -> None:
        """A frame is on a bus."""
        if one := self._inputs.get(frame[:3]):
            one.receive(frame.data, now_ns)
        for seen in self.axes.values():
            if seen.axis.valve_key == frame[:3]:
                seen.foreign_ns = now_ns

    def stalled(self) -> None:
        """The loop stood still: of what waits good news does not count."""
        self._before = [(one.resets, dict(one.presses)) for one in self._joysticks]
        for seen in self.axes.values():
            seen.stalled()

    def look(self, now_ns: int, number: int) -> None:
        """The deadline of this number, in which a tick is made."""
        if self._before is not None:
            for joystick, before in zip(self._joysticks, self._before, strict=True):
                joystick.resets, joystick.presses = before
            self._forget()
        for name, seen in self.axes.items():
            period = number // seen.axis.period_ticks
            if period > self._last // seen.axis.period_ticks:
                seen.look(now_ns, period, moves=self.speed[name] != 0.0)
        self._last = number

    def _forget(self) -> None:
        self._before = None
        for one in self._inputs.values():
            one.resync()

    def reload(self) -> None:
        """Good news has to come again; what is latched stays so."""
        self._forget()
        for seen in self.axes.values():
            seen.neutral, seen.stop_until, seen.demand = False, -1, 0.0
            seen.asked.clear()
            seen.asked.append((seen.period, 0.0))
