"""The judge: what every axis may do at a moment, from what was on the bus and when.

It knows docs/states.md and docs/deployment.md and nothing of the controller. It sees the frames
that came in, the frames that went out and what the loop reported to the controller.
"""

from collections import Counter, deque
from typing import Any

from canshaper.codec.frame import Frame
from tests.faults import received
from tests.faults.axis_judge import FREE, STOP, STOPPING, TRIPPED, WORDS, AxisJudge
from tests.faults.machine import Machine
from tests.faults.received import Received, ReceivedJoystick, ReceivedStop, ReceivedSwitches

# Counters of the service status that the judge keeps too, and where they stop.
COUNTERS = {"MissedDeadlines": 65535, "WrongLength": 255, "UnknownId": 255}
COUNTERS |= {"InvalidSignals": 255, "SendFailures": 255}

# An overrun of the loop must be one: late ticks among the last ones.
OVERRUN_OF, OVERRUN_LATE = 200, 8


class Violation(BaseException):
    """The controller did what was not allowed; nothing of the program catches it."""


class Judge:
    """All axes of a machine."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.joysticks = {name: ReceivedJoystick(v) for name, v in machine.joysticks.items()}
        self.stop = ReceivedStop(machine.stop, machine.stop_field) if machine.stop else None
        self._inputs: dict[tuple[str, int, bool], Received] = {
            one.source.key: one for one in self.joysticks.values()
        }
        if self.stop:
            self._inputs[self.stop.source.key] = self.stop
        switches = {one: ReceivedSwitches(one) for one in machine.switches}
        self._inputs |= {one.source.key: one for one in switches.values()}
        for joystick in self.joysticks.values():
            joystick.connect(self.joysticks, switches)
        self._presses = 0
        self._stood_still = False
        self._before: dict[str, tuple[int, dict[str, int]]] = {}
        self.axes = {
            n: AxisJudge(a, self.joysticks[a.joystick.name]) for n, a in machine.axes.items()
        }
        self._by_valve = {a.axis.valve_key: a for a in self.axes.values()}
        self._by_status = {a.axis.status_key: a for a in self.axes.values() if a.axis.status_key}
        service = {machine.service, machine.identity} - {None}
        ours = {*self._by_valve, *self._by_status, *service, *machine.aims}
        self._ours = ours
        radius = {machine.radius[0]} if machine.radius else set()
        used = {key[1:] for key in (*self._inputs, *radius, *ours) if key}
        self._others = machine.ids - used
        self._order = sorted(self.axes.values(), key=lambda a: not a.axis.slews)
        self._other = {
            a.axis.name: self.axes[a.axis.moves_with.name]
            for a in self.axes.values()
            if a.axis.moves_with
        }
        self._last = -1
        self._late: deque[int] = deque()
        self.counts: Counter[str] = Counter()
        self.stats: Counter[str] = Counter()

    # -- what comes in ----------------------------------------------------------------------------

    def receive(self, frame: Frame, now_ns: int) -> None:
        """A frame is on a bus."""
        key = frame[:3]
        machine = self.machine
        if entry := self._inputs.get(key):
            fault = entry.receive(frame.data, now_ns)
        elif machine.radius and key == machine.radius[0]:
            fault = ""
            if len(frame.data) != machine.radius[1]:
                fault = "WrongLength"
            else:
                field = machine.radius[2]
                value = field.get(int.from_bytes(frame.data, "little"))
                if not 0 <= value <= field.full or value in field.special:
                    fault = "InvalidSignals"
        elif key in self._ours:
            fault = ""
            if axis := self._by_valve.get(key):
                axis.foreign_ns = now_ns
                axis.causes.add(received.SECOND_SENDER)  # however old it is when it is read
        else:
            fault = "" if key[1:] in self._others else "UnknownId"
        if fault:
            self.counts[fault] += 1

    def stalled(self) -> None:
        """The loop reports that it stood still."""
        self._stood_still = True
        self._before = {n: (h.resets, dict(h.presses)) for n, h in self.joysticks.items()}
        for axis in self.axes.values():
            axis.causes.add(received.LOOP_STALLED)
        self.stats["stalls"] += 1

    # -- what goes out ----------------------------------------------------------------------------

    def tick(self, sent: list[Frame], failed: list[Frame], now_ns: int, missed: int) -> None:
        """The controller has ticked.

        Args:
            sent: the frames that it gave, in order.
            failed: those of them that did not go out, which was reported to it at once.
            now_ns: time of the tick.
            missed: deadlines missed since the last one.

        Raises:
            Violation: that is not allowed.
        """
        last, now = self._last, self._last + 1 + missed
        self._last = now
        if self._stood_still:
            self._resync()
        self.counts["MissedDeadlines"] += missed
        self.counts["SendFailures"] += len(failed)
        if missed:
            self._late.append(now)
        while self._late and self._late[0] < now - OVERRUN_OF:
            self._late.popleft()
        overrun = len(self._late) >= OVERRUN_LATE
        due = [a for a in self._order if now // a.axis.period_ticks > last // a.axis.period_ticks]
        valves = {f[:3]: f for f in sent[: len(due)]}
        if len(valves) != len(due) or not all(a.axis.valve_key in valves for a in due):
            raise Violation(f"first frames sent are {[hex(k[1]) for k in valves]}")
        for frame in sent[len(due) :]:
            if axis := self._by_status.get(frame[:3]):
                axis.read(frame)
        self._emergency(now_ns, due)
        for judge in due:
            other = self._other.get(judge.axis.name)
            slewing = other is not None and other.mode in (FREE, STOP)
            # It follows with the next tick.
            slewing = slewing and (other.commanded or other.was_commanded)
            index = now // judge.axis.period_ticks
            judge.decide(now_ns, index, overrun, slewing)
            if wrong := judge.check(valves[judge.axis.valve_key]):
                raise Violation(f"{judge.axis.name}: {wrong}")
            self.stats["frames"] += 1
            self.stats["moves"] += judge.raw != 0
            self.stats[WORDS[judge.mode]] += 1
        self._status(sent[len(due) :])
        for judge in due:
            if wrong := judge.agrees():
                raise Violation(f"{judge.axis.name}: {wrong}")
        for frame in failed:
            if axis := self._by_valve.get(frame[:3]):
                axis.causes.add(received.SEND_FAILED)

    def _resync(self) -> None:
        """Of what waited while the loop stood still only a stop, a release or another sender count.

        A press that came back with it does not: it may be over by now.
        """
        self._stood_still = False
        for entry in self._inputs.values():
            entry.resync()
        for name, joystick in self.joysticks.items():
            joystick.resets, joystick.presses = self._before[name]

    def words(self) -> str:
        """The limits in force now, for a reader."""
        return "; ".join(
            f"{name} {WORDS[a.mode]} state {a.state} sent {a.raw} in {a.low:.3f}..{a.high:.3f}"
            for name, a in self.axes.items()
        )

    def _emergency(self, now_ns: int, due: list[AxisJudge]) -> None:
        """Every axis stops for an emergency stop that was seen, also if only for a moment."""
        if self.stop is None:
            return
        stop = self.stop
        lost = not stop.fresh(now_ns)
        pressed = stop.presses > self._presses or stop.says_stop
        self._presses = stop.presses
        for axis in self.axes.values():
            if pressed:
                axis.causes.add(received.EMERGENCY_STOP)
            if lost and axis in due:
                axis.causes.add(received.EMERGENCY_STOP_LOST)

    def _status(self, frames: list[Frame]) -> None:
        for axis in self.axes.values():
            before = axis.state
            if wrong := axis.wrong_status():
                raise Violation(f"{axis.axis.name}: {wrong}")
            if before != axis.state and axis.state in (STOPPING, TRIPPED):
                self.stats["stops" if axis.state == STOPPING else "trips"] += 1
        for frame in frames:
            if frame[:3] == self.machine.service:
                assert self.machine.service_message is not None
                shown: Any = self.machine.service_message.decode(frame.data)
                for name, most in COUNTERS.items():
                    if shown[name] != min(self.counts[name], most):
                        raise Violation(f"{name} is reported as {shown[name]}: {self.counts[name]}")
            elif frame[:3] not in self._by_status and frame[:3] not in self.machine.aims:
                raise Violation(f"frame {frame} that no one asked for")
