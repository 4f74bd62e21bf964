"""The judge: what every axis may do at a moment, from what was on the bus and when.

It knows docs/states.md and docs/deployment.md and nothing of the controller. It sees the frames
that came in, the frames that went out and what the loop told the controller, and keeps for every
axis whether motion is allowed at all:

    WAIT     nothing may move before a fresh, valid, enabled joystick in neutral was seen
    FREE     the joystick moves the axis
    STOP     the input was lost or invalid in motion: to zero, within stop_s
    LATCHED  neutral at once, until enable or reset is pressed with the joystick in neutral

and within which velocities: never faster than was asked within the tail, never against the
joystick, never quicker than the valve's rates, all on the grid of the valve's frame.
"""

from collections import Counter, deque
from typing import Any

from canshaper.codec.frame import Frame
from tests.faults import heard
from tests.faults.heard import LONG_AGO, Heard, HeardJoystick, HeardStop
from tests.faults.machine import Axis, Machine

WAIT, FREE, STOP, LATCHED = range(4)
WORDS = ("WAIT", "FREE", "STOP", "LATCHED")

# States of the status message by their numbers in docs/states.md, and the ways between them.
STOPPING, TRIPPED = 4, 5
MOVING = (2, 3, STOPPING)
WAYS = {(0, 1), (1, 0), (1, 2), (1, 3), (2, 3), (3, 2), (2, 1), (3, 1), (2, 4), (3, 4), (4, 0)}
WAYS |= {(state, TRIPPED) for state in range(5)} | {(TRIPPED, 0)}

# Causes that latch an axis in any state; the others only one in motion.
ALWAYS_LATCHED = {heard.EMERGENCY_STOP, heard.SECOND_SENDER}
# Counters of the service status that the judge keeps too, and where they stop.
COUNTERS = {"MissedDeadlines": 65535, "WrongLength": 255, "UnknownId": 255}
COUNTERS |= {"InvalidSignals": 255, "SendFailures": 255}

# Steps that rounding to the grid may make between two frames, down by one and up by half of one.
ROUNDING = 1.5
# How long another sender of a valve's id must be silent before a trip for it can be reset.
FOREIGN_NS = 1_000_000_000
# Ticks after which a filter that answers the last swing of the joystick is done with it.
SETTLED = {"off": 3, "first_order": 3, "s_curve": 3}
SETTLED_OTHERS = 25
# An overrun of the loop must be one: late ticks among the last ones.
OVERRUN_OF, OVERRUN_LATE = 200, 8


class Violation(AssertionError):
    """The controller did what was not allowed."""


class AxisJudge:
    """What one axis may do."""

    def __init__(self, axis: Axis, joystick: HeardJoystick) -> None:
        self.axis = axis
        self.joystick = joystick
        self.mode = WAIT
        self.raw = 0
        self.low = self.high = 0.0
        self.asked = self.was_asked = False
        self.command = 0.0
        self.causes: set[int] = set()  # of neutral at once, since the last frame of the valve
        self.contested_ns = LONG_AGO
        self.state = 0
        self.reasons: set[int] = set()  # of a stop or trip that hold now
        self._asks: deque[tuple[int, float]] = deque()
        self._range = (0.0, 0.0)
        self._end = 0
        self._releases = self._presses = self._resets = 0
        self._steady = 0
        self._count: int | None = None
        self._must_fall = False
        self._pressed_since = False
        self._pressed_again = False  # and released between two frames of the valve
        self._told: dict[str, Any] = {}

    # -- may it move? ---------------------------------------------------------------------------

    def decide(self, now_ns: int, index: int, overrun: bool, slewing: bool) -> None:
        """Bring mode and bounds to this frame of the valve.

        Args:
            now_ns: time of the tick.
            index: number of this frame's deadline.
            overrun: so many ticks came late that the axis may stop for it.
            slewing: the other axis of a two-axis motion may move this one.
        """
        joystick, axis = self.joystick, self.axis
        faults = joystick.faults(axis, now_ns)
        released = joystick.releases > self._releases or (
            joystick.fresh(now_ns) and joystick.enable() == 0
        )
        pressed = joystick.presses[axis.name] > self._presses or joystick.resets > self._resets
        pressed |= self._pressed_again
        self._releases, self._resets = joystick.releases, joystick.resets
        self._presses = joystick.presses[axis.name]
        causes, self.causes = self.causes, set()
        self._pressed_since = pressed or (self._pressed_since and not causes)
        in_motion = self.state in MOVING  # as it told last; ``agrees`` holds that against the valve
        if now_ns - self.contested_ns <= FOREIGN_NS:
            causes.add(heard.SECOND_SENDER)
        if not in_motion:
            causes.discard(heard.SEND_FAILED)
        usable = not faults and not causes and joystick.enable() == 1
        deflection = joystick.joysticks[axis.name][0] if usable else 0.0
        centred = usable and abs(deflection) <= axis.band
        self.reasons = causes | faults | ({heard.LOOP_OVERRUN} if overrun else set())
        if released:
            self.reasons.add(heard.ENABLE_LOST)
        told = self._told.get("State", self.state)
        began = self.mode

        if causes & ALWAYS_LATCHED or ((causes or released) and in_motion):
            self._go(LATCHED)
        elif self.mode == LATCHED:
            # A press among frames that say nothing else, or with enable off, may count later.
            late = self._pressed_since and told == 0 and not faults and not causes
            if (pressed and centred) or (
                late and abs(joystick.joysticks[axis.name][0]) <= axis.band
            ):
                self._go(WAIT)
        elif causes or released:
            self._go(WAIT)
        elif self.mode == FREE and faults:
            self._go(STOP if in_motion else WAIT)
            self._end = index + axis.stop
        elif self.mode == STOP and (index >= self._end or told not in MOVING):
            self._go(WAIT)
        elif self.mode == FREE and overrun and told in (0, STOPPING):
            # It may stop for late ticks; then it has to wait for neutral like after any stop.
            self._go(WAIT if told == 0 else STOP)
            self._end = index + axis.stop
        if told == TRIPPED:  # latched is latched, whatever for
            self._go(LATCHED)
        self._pressed_again = released and pressed and self.mode == LATCHED
        if self.mode == began == WAIT and centred:
            self._go(FREE)
        self._bounds(index, deflection if abs(deflection) > axis.band else 0.0, slewing)
        stops = began == FREE and self.mode == STOP and bool(faults)
        self._must_fall = stops and self._settled()

    def _go(self, mode: int) -> None:
        self.mode = mode
        if mode in (WAIT, LATCHED):
            self._asks.clear()
            self._range = (0.0, 0.0)
            self.asked = False

    def _settled(self) -> bool:
        return self._steady >= SETTLED.get(self.axis.filter, SETTLED_OTHERS)

    def _bounds(self, index: int, command: float, slewing: bool) -> None:
        axis = self.axis
        before, self.asked = self.asked, False
        self.was_asked = before
        self.low = self.high = 0.0
        self.command = 0.0
        if self.mode in (WAIT, LATCHED):
            return
        self.command = command if self.mode == FREE else 0.0
        low, high = self._range = self._asked_within(index - axis.tail, index)
        self.asked = low < 0.0 or high > 0.0
        if axis.allow_faster:
            low, high = -float(low < 0.0), float(high > 0.0)
        if axis.allow_reverse:
            low, high = min(low, -high), max(high, -low)
        elif not axis.brake_shaped:
            low = low if self.command <= 0.0 else 0.0
            high = high if self.command >= 0.0 else 0.0
        added = axis.largest_added and (before or self.asked or slewing) and self.mode == FREE
        if added and not self.joystick.bypasses():
            # Where its operator asked for nothing and holds nothing against it, another one may.
            if not self._range[0] and self.command <= 0.0:
                low = -axis.largest_added
            if not self._range[1] and self.command >= 0.0:
                high = axis.largest_added
        self.low, self.high = max(low, -axis.maximum), min(high, axis.maximum)

    def _asked_within(self, first: int, index: int) -> tuple[float, float]:
        """Smallest and largest command since a deadline, zero included, with the one of now."""
        asks, (low, high), command = self._asks, self._range, self.command
        asks.append((index, command))
        gone = False
        while asks[0][0] < first:
            old = asks.popleft()[1]
            gone = gone or (old != 0.0 and old in (low, high))
        if gone:
            commands = [c for _, c in asks]
            return min(0.0, *commands), max(0.0, *commands)
        return min(low, command), max(high, command)

    # -- what was sent ----------------------------------------------------------------------------

    def check(self, frame: Frame) -> str:
        """What is wrong with a frame of the valve; nothing when it is allowed."""
        axis = self.axis
        raw, count = axis.sent(frame.data)
        if axis.valve_counter:
            if self._count is not None and count != (self._count + 1) & axis.valve_counter.mask:
                return f"alive counter {count} after {self._count}"
            self._count = count
        before, self.raw = self.raw, raw
        wrong = self._wrong(axis.velocity(before), axis.velocity(raw), raw)
        if wrong:
            return f"{WORDS[self.mode]}: sent {raw} after {before}: {wrong}"
        follows = self.mode == FREE and abs(self.command) >= 0.2
        follows = follows and abs(axis.velocity(raw) - self.command) <= axis.step
        self._steady = self._steady + 1 if follows and raw == before else 0
        return ""

    def _wrong(self, before: float, now: float, raw: int) -> str:
        axis = self.axis
        if self.mode in (WAIT, LATCHED):
            return "allowed is neutral" if raw else ""
        slack = ROUNDING * axis.step
        edge = 1e-9
        if raw and not now:
            return "allowed is no command inside the deadband"
        # Beyond the bounds only on the way back to them, at the rate of the fall.
        high = max(self.high, before - axis.fall + slack)
        low = min(self.low, before + axis.fall - slack)
        if not low - edge <= now <= high + edge:
            return f"allowed is {low:.4f} to {high:.4f}, found {now:.4f}"
        low, high = self._range
        if before < 0.0:
            before, now, low, high = -before, -now, -high, -low
        grown = before + axis.rise + slack
        # An added velocity may end at once: the rate holds for what is left of the command.
        most = axis.largest_added
        own = max(0.0, before - most)
        if own > 0.0 > now:
            fallen = -axis.rise * max(0.0, 1.0 - own / axis.fall) - slack
        else:
            fallen = own - axis.fall - slack if own else -axis.rise - slack
        if most:  # where it went against what is left, that is faster, as far as it was asked for
            grown = max(grown, min(high + slack, grown + most))
            fallen = min(fallen, max(low - slack, before - most - axis.rise - slack))
        if not fallen - edge <= now <= grown + edge:
            return f"rates allow {fallen:.4f} to {grown:.4f}, found {now:.4f}"
        if self._must_fall and now >= before:
            return f"the input is lost and nothing falls: {before:.4f} to {now:.4f}"
        return ""

    def read(self, frame: Frame) -> None:
        """Take the status frame of this tick."""
        self._told = self.axis.status(frame.data)

    def told(self) -> str:
        """What is wrong with the status frame of this tick, if there is one."""
        values, self._told = self._told, {}
        if not values:
            return ""
        before, self.state = self.state, values["State"]
        if before != self.state:
            if (before, self.state) not in WAYS:
                return f"state {self.state} after {before}"
            if self.state in (STOPPING, TRIPPED) and values["Reason"] not in self.reasons:
                known = ", ".join(map(str, sorted(self.reasons))) or "none"
                return f"state {self.state} for reason {values['Reason']}, true are {known}"
        shown = values["ShapedCommand"]
        if abs(shown - 100.0 * self.axis.velocity(self.raw)) > 0.01:
            return f"status shows {shown} % for {self.raw} steps"
        return ""

    def agrees(self) -> str:
        """What the state told so far says against the frame sent."""
        if self.raw and self.state not in MOVING:
            return f"moves in state {self.state}"
        if self.mode == LATCHED and self.state != TRIPPED:
            return f"state {self.state}, allowed is {TRIPPED}"
        return ""


class Judge:
    """All axes of a machine."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.heard = {name: HeardJoystick(v) for name, v in machine.joysticks.items()}
        self.stop = HeardStop(machine.stop, machine.stop_field) if machine.stop else None
        self._inputs: dict[tuple[str, int, bool], Heard] = {
            h.source.key: h for h in self.heard.values()
        }
        if self.stop:
            self._inputs[self.stop.source.key] = self.stop
        self._presses = 0
        self._stood_still = False
        self._before: dict[str, tuple[int, dict[str, int]]] = {}
        self.axes = {n: AxisJudge(a, self.heard[a.joystick.name]) for n, a in machine.axes.items()}
        self._by_valve = {a.axis.valve_key: a for a in self.axes.values()}
        self._by_status = {a.axis.status_key: a for a in self.axes.values() if a.axis.status_key}
        ours = {*self._by_valve, *self._by_status, *({machine.service} - {None})}
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

    def hear(self, frame: Frame, now_ns: int) -> None:
        """A frame is on a bus."""
        key = frame[:3]
        machine = self.machine
        if entry := self._inputs.get(key):
            fault = entry.hear(frame.data, now_ns)
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
                axis.contested_ns = now_ns
                axis.causes.add(heard.SECOND_SENDER)  # however old it is when it is read
        else:
            fault = "" if key[1:] in self._others else "UnknownId"
        if fault:
            self.counts[fault] += 1

    def stalled(self) -> None:
        """The loop tells that it stood still."""
        self._stood_still = True
        self._before = {n: (h.resets, dict(h.presses)) for n, h in self.heard.items()}
        for axis in self.axes.values():
            axis.causes.add(heard.LOOP_STALLED)
        self.stats["stalls"] += 1

    # -- what goes out ----------------------------------------------------------------------------

    def tick(self, sent: list[Frame], failed: list[Frame], now_ns: int, missed: int) -> None:
        """The controller has ticked.

        Args:
            sent: the frames that it gave, in order.
            failed: those of them that did not go out, which it was told at once.
            now_ns: time of the tick.
            missed: deadlines missed since the last one.

        Raises:
            Violation: that is not allowed.
        """
        last, now = self._last, self._last + 1 + missed
        self._last = now
        if self._stood_still:
            self._forget()
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
            slewing = slewing and (other.asked or other.was_asked)  # it follows with the next tick
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
                axis.causes.add(heard.SEND_FAILED)

    def _forget(self) -> None:
        """Of what waited while the loop stood still only a stop, a release or another sender count.

        A press that came back with it does not: it may be over by now.
        """
        self._stood_still = False
        for entry in self._inputs.values():
            entry.forget()
        for name, joystick in self.heard.items():
            joystick.resets, joystick.presses = self._before[name]

    def words(self) -> str:
        """What is allowed now, for a reader."""
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
                axis.causes.add(heard.EMERGENCY_STOP)
            if lost and axis in due:
                axis.causes.add(heard.EMERGENCY_STOP_LOST)

    def _status(self, frames: list[Frame]) -> None:
        for axis in self.axes.values():
            before = axis.state
            if wrong := axis.told():
                raise Violation(f"{axis.axis.name}: {wrong}")
            if before != axis.state and axis.state in (STOPPING, TRIPPED):
                self.stats["stops" if axis.state == STOPPING else "trips"] += 1
        for frame in frames:
            if frame[:3] == self.machine.service:
                assert self.machine.service_message is not None
                shown: Any = self.machine.service_message.decode(frame.data)
                for name, most in COUNTERS.items():
                    if shown[name] != min(self.counts[name], most):
                        raise Violation(f"{name} is told as {shown[name]}: {self.counts[name]}")
            elif frame[:3] not in self._by_status:
                raise Violation(f"frame {frame} that nobody asked for")
