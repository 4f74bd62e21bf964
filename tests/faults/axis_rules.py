"""Rules of docs/safety.md for one axis; see ``rules``."""

from collections import deque

from canshaper.codec.frame import Frame
from tests.faults.axis import Axis
from tests.faults.axis_judge import FOREIGN_NS, ROUNDING
from tests.faults.received import LONG_AGO, ReceivedJoystick

# Where the daemon may be a tick, and the wait for it, behind what is on the bus.
SLACK_NS = 2_000_000
RELEASED = "enable released"


class AxisRules:
    """Rules for the frames of one axis."""

    def __init__(self, axis: Axis, joystick: ReceivedJoystick, tick_ns: int) -> None:
        self.axis, self.joystick = axis, joystick
        self.velocity = 0.0
        self.raw = 0
        self.causes: set[str] = set()  # of neutral at once, since it was decided last
        self.foreign_ns = LONG_AGO
        self.armed = self.latched = False
        self._tick_ns = tick_ns
        self._stop_until_ns: int | None = None
        self._commands: deque[tuple[int, float, bool]] = deque()
        self._moved = False  # since it was armed
        self._low = self._high = self._command = 0.0
        self._commanded_down = self._commanded_up = False
        self._side, self._turned_ns, self._turns = 1.0, 0, False
        self._why = ""
        self._releases = self._disagreements = 0
        self._presses = self._resets = 0
        self._pressed_again = False
        self._skipped = 0
        self.partner: AxisRules | None = None  # of a two-axis motion
        self.lost = 0  # frames that were not sent since the last one
        self.bypassed_ns = LONG_AGO  # anti-sway was off last
        self._oil: deque[tuple[int, float]] = deque()  # command that there is oil for
        self._count: int | None = None

    # -- before a frame ---------------------------------------------------------------------------

    def decide(self, now_ns: int, *, joystick_works: bool) -> None:
        """Take what has been read up to now.

        Args:
            now_ns: when it was read.
            joystick_works: whether the node of the joystick does.
        """
        joystick, axis = self.joystick, self.axis
        if joystick.bypasses():
            self.bypassed_ns = now_ns
        causes, self.causes = self.causes, set()
        if self._stop_until_ns is not None and now_ns > self._stop_until_ns:
            self._stop_until_ns = None
        if joystick.releases > self._releases or joystick.enable() == 0:
            causes.add(RELEASED)
        # Silence of a switch, too, counts a tick later, when the loop looks.
        seen = joystick.disagreements > self._disagreements
        if seen or joystick.disagree(now_ns - self._tick_ns - SLACK_NS):
            causes.add("a switch does not agree")
        elif joystick.disagree(now_ns):
            self.may_stop(now_ns)
        self._disagreements = joystick.disagreements
        if now_ns - self.foreign_ns < FOREIGN_NS - 2 * self._tick_ns:
            causes.add("another sender")
        presses, resets = joystick.presses[axis.name] + joystick.resets, joystick.resets
        pressed = presses > self._presses or self._pressed_again
        reset = resets > self._resets
        self._releases, self._presses, self._resets = joystick.releases, presses, resets
        # Released and pressed again between two ticks is a press, though a release too.
        self._pressed_again = pressed and causes == {RELEASED} and joystick.enable() == 1
        # Silence counts a tick later, when the loop looks.
        faults = joystick.faults(axis, now_ns - self._tick_ns - SLACK_NS) if joystick_works else {0}
        deflection = joystick.joysticks[axis.name][0]
        healthy = not causes and not faults
        centred = healthy and abs(deflection) <= axis.band and joystick.enable() == 1
        if faults or joystick.faults(axis, now_ns):  # the loop may take it for silent already
            self.may_stop(now_ns)
        if causes:
            # The reset button counts with enable off, too.
            reset &= causes == {RELEASED} and not faults and abs(deflection) <= axis.band
            self.latched &= not reset
            self.latched |= self.velocity != 0.0 or "another sender" in causes
            self.armed, self._stop_until_ns = False, None
        elif self.latched:
            self.latched = not (pressed and centred)
        elif faults:
            self.armed = False
        elif centred and (self._stop_until_ns is None or not self.velocity):
            self.armed = True  # a stop that is not at rest goes on, whatever the joystick does
        self._why = ", ".join(sorted(causes))
        usable = healthy and self.armed and not self.latched and abs(deflection) > axis.band
        self._follow_command(now_ns, deflection if usable else 0.0)
        if self._stop_until_ns is not None:  # in a stop the joystick does not count
            self._command = 0.0

    def may_stop(self, now_ns: int) -> None:
        """The axis stops, or may: until then it runs out, wherever the joystick is."""
        if self.armed:  # else there is nothing to stop, or it stops already
            stop_ns = (self.axis.stop * self.axis.period_ticks + 1) * self._tick_ns
            self._stop_until_ns = now_ns + stop_ns + SLACK_NS

    def _follow_command(self, now_ns: int, command: float) -> None:
        axis, recent = self.axis, self._commands
        self._command = command
        if command * self._side < 0.0:
            self._side, self._turned_ns = -self._side, now_ns
        turns_ns = (axis.reversal + 2) * axis.period_ticks * self._tick_ns + SLACK_NS
        self._turns = bool(axis.reversal) and now_ns - self._turned_ns <= turns_ns
        # The daemon may not have been ready in the tick in which it was armed here; what moves in a
        # stop, at rest in between or not, shows nothing of that.
        ready = self.armed and self._stop_until_ns is None
        self._moved = ready and (self._moved or self.raw != 0)
        recent.append((now_ns, command, self._moved))
        tail_ns = self.tail_ns
        # What was commanded until the next entry counts up to there.
        while len(recent) > 1 and recent[1][0] < now_ns - tail_ns:
            recent.popleft()
        commands = [c for _, c, _ in recent]
        self._low, self._high = min(0.0, *commands), max(0.0, *commands)
        # And what it counts for certain: an added part waits until this is nothing.
        certain_ns = tail_ns - 4 * axis.period_ticks * self._tick_ns - 2 * SLACK_NS
        still = [c for since_ns, c, sure in recent if sure and since_ns >= now_ns - certain_ns]
        self._commanded_down = min((0.0, *still)) < 0.0
        self._commanded_up = max((0.0, *still)) > 0.0

    @property
    def certain(self) -> float:
        """Command that moves the axis for certain."""
        return self._command if self._moved else 0.0

    @property
    def tail_ns(self) -> int:
        """Time in which a command counts after it is over."""
        return (self.axis.tail + 2) * self.axis.period_ticks * self._tick_ns + SLACK_NS

    def share_oil(self, now_ns: int, factor: float) -> None:
        """Only so much of its command counts from now on."""
        self._oil.append((now_ns, factor * self._commands[-1][1]))
        while len(self._oil) > 1 and self._oil[1][0] < now_ns - self.tail_ns:
            self._oil.popleft()

    def reloaded(self) -> None:
        """An axis forgets what was commanded before: its partner may move it all the same."""
        self._commands = deque((at_ns, command, False) for at_ns, command, _ in self._commands)

    def silenced(self) -> None:
        """Nothing is sent any more, and the valve closes by itself; from neutral after that."""
        self.velocity, self.armed, self.latched, self._moved = 0.0, False, False, False
        self._stop_until_ns = None

    def after(self, gap_ns: int, now_ns: int, *, longest_ns: int) -> None:
        """So much time has passed since the last tick."""
        # What was late has not left, perhaps of several ticks.
        self._skipped = self._skipped + 1 if gap_ns > self._tick_ns + SLACK_NS else 0
        if gap_ns > longest_ns:
            self.causes.add(f"stood still for {gap_ns / 1e6:.1f} ms")
        elif gap_ns > longest_ns - 3 * self._tick_ns:  # the last frames before it may be too old
            self.may_stop(now_ns)

    # -- a frame ----------------------------------------------------------------------------------

    def check(self, frame: Frame, ticks: int) -> str:
        """Return the fault of a frame of the valve; nothing when it is allowed.

        Args:
            frame: the frame.
            ticks: how often the axis may have moved since its last frame.
        """
        raw, _ = self.axis.sent(frame.data)
        before, self.velocity = self.velocity, self.axis.velocity(raw)
        self.raw = raw
        wrong = self._wrong(before, self.velocity, ticks) if raw else ""
        return f"sent {raw}: {wrong}" if wrong else ""

    def count(self, frame: Frame, *, late: bool) -> str:
        """Return the fault of the alive counter of a frame."""
        field = self.axis.valve_counter
        if (
            field is None or self.axis.valve_key[1] == self.axis.joystick.key[1]
        ):  # the joystick's own
            return ""
        gaps, self.lost = 1 + late + self._skipped + self.lost, 0
        last, self._count = self._count, self.axis.sent(frame.data)[1]
        if last is None or 1 <= (self._count - last) & field.mask <= gaps:
            return ""
        return f"alive counter {self._count} after {last}"

    def _wrong(self, before: float, now: float, ticks: int) -> str:
        if self._why:
            return f"allowed is neutral: {self._why}"
        if self.latched:
            return "allowed is neutral: latched, and not reset with the joystick in neutral"
        if not self.armed and self._stop_until_ns is None:
            return "allowed is neutral: no enabled joystick seen in neutral"
        return self._too_fast(before, now, ticks)

    def _too_fast(self, before: float, now: float, ticks: int) -> str:
        axis = self.axis
        slack = ROUNDING * axis.step + 1e-9
        low, high = self._low, self._high
        if axis.allow_faster:
            low, high = -float(low < 0.0), float(high > 0.0)
        if axis.allow_reverse:
            low, high = min(low, -high), max(high, -low)
        elif not self._turns:
            low = low if self._command <= 0.0 else 0.0
            high = high if self._command >= 0.0 else 0.0
        if self._oil:
            commands = [command for _, command in self._oil]
            low, high = max(low, min(0.0, *commands)), min(high, max(0.0, *commands))
        # Where its operator commands nothing and holds nothing against it, another one may.
        if axis.largest_added and not self._commanded_down and self._command <= 0.0:
            low = min(low, -axis.largest_added)
        if axis.largest_added and not self._commanded_up and self._command >= 0.0:
            high = max(high, axis.largest_added)
        fall = ticks * axis.fall - slack
        low, high = max(low, -axis.maximum), min(high, axis.maximum)
        low, high = min(low - slack, before + fall), max(high + slack, before - fall)
        if not low <= now <= high:
            return f"{now:.4f} after {before:.4f}, allowed is {low:.4f} to {high:.4f}"
        most = ticks * max(axis.rise, axis.fall) + slack
        # An added part may end at once; what goes to the other side begins at rest.
        if axis.largest_added and abs(now) < abs(before) and now * before >= 0.0:
            ends = self.partner is None or not self.partner.armed  # however large it was
            most += 1.0 if ends else axis.largest_added
        if abs(now - before) > most:
            return f"{now:.4f} after {before:.4f}, a jump: rates allow {most:.4f}"
        return ""
