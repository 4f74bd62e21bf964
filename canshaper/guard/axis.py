"""What one axis may be sent now, and why not more: limits, commands, rates."""

import math
from collections.abc import Sequence

from canshaper.guard.bits import MOST_KNOWN, CommandBits, JoystickBits
from canshaper.guard.inputs import (
    BACK,
    FOREVER,
    FORTH,
    NEUTRAL,
    CommandedAxis,
    GuardedJoystick,
    GuardedSwitch,
    largest,
)
from canshaper.guard.opening import openings
from canshaper.machine.bound_axis import BoundAxis
from canshaper.machine.deployment import Deployment

# Part of full speed; less than any step, more than the rounding of floats.
EPSILON = 1e-6
# A velocity is rounded to the nearest step; down by up to one where that would be too fast.
UP, DOWN = 0.5, 1.0
# Periods by which an output may be late: tail and stop are whole periods, the last one included,
# and a compensation follows its command.
LATE_PERIODS = 3
At = tuple[int, int]
BEFORE: At = (-1, -1)  # the first deadline and the first tick
Command = tuple[int, float, float, float]
"""Direction, size, that at most before it was rounded, and the size that may follow at once."""


class GuardedAxis(CommandedAxis):
    """One axis: what its valve may be sent now.

    Attributes:
        name: of the axis.
        bits: its command in the valve frame.
        span: the bytes of a frame that carry it.
        part: what they were in the last frame that left.
        at: when that was, as ``refusal`` has it.
    """

    __slots__ = (
        "_added",
        "_adding",
        "_commands",
        "_down",
        "_fall",
        "_fall_least",
        "_faster",
        "_full",
        "_joystick",
        "_kept_ns",
        "_last",
        "_length",
        "_maximum",
        "_more",
        "_openings",
        "_period",
        "_reverse",
        "_rise",
        "_silent_ns",
        "_step",
        "_stops",
        "_up",
        "at",
        "bits",
        "name",
        "part",
        "span",
    )

    def __init__(
        self,
        deployment: Deployment,
        bound: BoundAxis,
        joystick: GuardedJoystick,
        stops: Sequence[GuardedSwitch],
    ) -> None:
        config, limits = bound.config, bound.config.limits
        message = deployment.joysticks[config.command.joystick].message
        super().__init__(JoystickBits(message, config.command))
        joystick.drives(self)
        period_ns = deployment.config.tick_ms * 1_000_000 * bound.period_ticks
        period_s = period_ns * 1e-9
        self.name = bound.name
        self.bits = CommandBits(
            bound.valve_message, config.valve, config.command if bound.rewrites else None
        )
        self._length, self.span = bound.valve_message.length, self.bits.span
        self.part = b""
        self.at = BEFORE
        self._joystick, self._stops = joystick, tuple(stops)
        self._adding: tuple[GuardedAxis, ...] = ()
        self._added = 0.0
        for stop in stops:
            stop.stops.append(self)
        self._maximum = _ends(deployment, bound, "max_pct")[1] / 100.0
        self._rise = _ends(deployment, bound, "rise_per_s")[1] * period_s
        slowest, fastest = _ends(deployment, bound, "fall_per_s")
        self._fall_least, self._fall = slowest * period_s, fastest * period_s
        self._faster, self._reverse = limits.allow_faster, limits.allow_reverse
        self._more = self._faster or self._reverse
        late_ns = LATE_PERIODS * period_ns + _standstill_ns(deployment)
        timeout_ns = joystick.timeout_ns + late_ns
        self._kept_ns = timeout_ns + round(limits.tail_s * 1e9)
        self._silent_ns = timeout_ns + round(limits.stop_s * 1e9)
        self._openings = openings(limits, self.bits.full)
        step = max(slope for one in self._openings for slope in one.slopes)
        self._up, self._down = UP * step, DOWN * step
        # From one frame to the next, which in a gateway may leave in the same period.
        self._step = self._up if bound.rewrites else self._rise + self._up
        # At full command a valve may give less than was meant.
        full = self.bits.full
        self._full = min(one.velocity(full) for one in self._openings) - EPSILON
        self._commands: dict[bytes, Command] = {}
        self._period = bound.period_ticks
        self._last: Command = NEUTRAL, 0.0, self._down, self._down + self._step

    def demand(self, part: float, now_ns: int) -> None:
        """Take a demand in the place of the joystick's, whose enable and age still count.

        Args:
            part: of the full command of the valve, [-1, 1].
            now_ns: monotonic time.
        """
        self.demanded = True
        opening = self._openings[part < 0.0]
        speed = opening.velocity(math.ceil(abs(part) * self.bits.full))
        # In the dead band too it is a command, as ``_learn`` has it.
        self.take(math.copysign(max(speed, 2 * EPSILON), part) if part else 0.0, now_ns)

    def moves(self, data: bytes) -> bool:
        """Whether a frame is anything but neutral."""
        return len(data) != self._length or self.bits.steps(data) != 0

    def refusal(self, data: bytes, part: bytes, now_ns: int, at: At) -> str:
        """Why a frame may not leave; empty where it may.

        Args:
            data: the frame.
            part: the bytes of it with the command.
            now_ns: monotonic time.
            at: number of this deadline, and of this tick, which does not count those missed.
        """
        command = self._commands.get(part)
        if command is None or len(data) != self._length:
            command = self._learn(data)
        direction, size, _, _ = command
        last, valid_until_ns = self._last, self.sure_ns
        # The usual one: within what is sure to be commanded, and one step of the rates.
        if size >= self.sure or now_ns >= valid_until_ns or direction != last[0] or size > last[3]:
            command, valid_until_ns, why = self._look(command, now_ns, at)
            if why:
                self.forbid()
                return why
        self.part, self.valid_until_ns, self.at, self._last = part, valid_until_ns, at, command
        return ""

    def _look(self, command: Command, now_ns: int, at: At) -> tuple[Command, int, str]:
        """A command with its bound, until when that is valid, and why it may not leave."""
        direction, size, bound, _ = command
        if direction == NEUTRAL:
            return command, FOREVER, ""
        last, last_size, last_bound, _ = self._last
        number, tick = at
        reach, valid_until_ns = self._commanded_speed(direction, now_ns)
        period = self._period
        before = self._up - last_size if direction + last == BACK + FORTH else last_bound
        periods = number // period - self.at[0] // period
        highest = self._highest(before, periods)
        allowed = reach if reach < highest else highest
        if size > allowed and valid_until_ns and direction == last:
            # On its way back. The rates do not catch up on deadlines that were missed, so for
            # the fall they do not count; and it has to be lower with each frame.
            fallen = last_bound - (tick - self.at[1]) // period * self._fall_least
            if fallen > allowed:
                allowed, valid_until_ns = fallen, 0
                bound = min(bound, fallen)
        elif size >= self._full:
            bound = allowed
        refused = size > allowed + EPSILON
        why = self._why(command, reach, allowed, now_ns) if refused else ""
        return (direction, size, bound, bound + self._step), valid_until_ns, why

    def _highest(self, before: float, periods: int) -> float:
        """Speed that the rates allow after one in the same direction, negative in the other."""
        if before < 0.0:  # a part of the time goes by on the way to zero
            left = periods + before / self._fall
            return (left * self._rise if left > 0.0 else 0.0) + self._up
        return before + periods * self._rise + self._up

    def _commanded_speed(self, direction: int, now_ns: int) -> tuple[float, int]:
        """Speed that was commanded in a direction, and until when that holds.

        Both are 0 where nothing may move at all.
        """
        since_ns, joystick = now_ns - self._kept_ns, self._joystick
        from_ns = received_ns = joystick.received_ns
        if joystick.released or received_ns < now_ns - self._silent_ns:
            return 0.0, 0
        free_ns = received_ns + self._silent_ns
        for stop in self._stops:
            free_ns = min(free_ns, stop.free_ns)
            if free_ns < now_ns:
                return 0.0, 0
        joystick.read()
        if direction == FORTH:
            reach, sizes = self.now, self.positive
        else:
            reach, sizes = -self.now, self.negative
        if reach < 0.0 or received_ns < since_ns:
            reach = 0.0
        if sizes and (before := largest(sizes, since_ns)) > reach:
            reach, from_ns = before, sizes[0][1]
        reach, until_ns = min(reach, self._maximum), min(from_ns + self._kept_ns, free_ns)
        self.sure, self.sure_ns = min(reach, self._full), until_ns
        if self._more:  # for this moment
            reach, until_ns = self._reach(reach, now_ns), now_ns
        return reach, until_ns

    def _learn(self, data: bytes) -> Command:
        """Read a command; of endless speed where its signals contradict each other."""
        steps = self.bits.steps(data) if len(data) == self._length else None
        if steps is None:
            return self._last[0] or FORTH, math.inf, math.inf, math.inf
        direction = (NEUTRAL if steps == 0 else FORTH) if steps >= 0 else BACK
        size = 0.0
        if steps:  # a command is one, however small
            size = max(self._openings[direction - FORTH].velocity(abs(steps)), 2 * EPSILON)
        if len(self._commands) >= MOST_KNOWN:
            self._commands.clear()
        bound = size + self._down
        command = self._commands[data[self.span]] = direction, size, bound, bound + self._step
        return command

    def _why(self, command: Command, reach: float, allowed: float, now_ns: int) -> str:
        """What a frame is beyond, for the log."""
        direction, size, _, _ = command
        if stops := [stop.limit for stop in self._stops if now_ns > stop.free_ns]:
            limit = stops[0]
        elif self._joystick.released:
            limit = "enable"
        elif now_ns - self._joystick.received_ns > self._silent_ns:
            limit = "silence"
        elif size == math.inf:
            limit = "command"
        else:
            limit = "maximum" if allowed == self._maximum else "asked"
            limit = limit if allowed == reach else "rate"
        speed = size if direction == FORTH else -size
        return f"axis={self.name} limit={limit} speed={speed:.3f} allowed={allowed:.3f}"

    def _reach(self, reach: float, now_ns: int) -> float:
        """What may be, beyond what was commanded in the direction of the output."""
        if self._reverse:
            reach = max(reach, self._most(now_ns))
        if self._faster and reach:
            reach = self._maximum
        # Another operator may move it. Not against a joystick that is held: but which of its frames
        # count is not known here.
        if any(axis._most(now_ns) for axis in self._adding):
            reach = max(reach, self._added + self._up)
        return min(reach, self._maximum)

    def moves_with(self, other: "GuardedAxis", most: float) -> None:
        """In a two-axis motion its other axis moves this one too.

        Args:
            other: that axis.
            most: up to this part of full speed, where the operator of this axis commands nothing.
        """
        self._more = True
        self._adding, self._added = (other, self), most

    def _most(self, now_ns: int) -> float:
        """Speed that was commanded in any direction within the tail."""
        self._joystick.read()
        since_ns = now_ns - self._kept_ns
        now = abs(self.now) if self._joystick.received_ns >= since_ns else 0.0
        return max(now, largest(self.positive, since_ns), largest(self.negative, since_ns))


def _ends(deployment: Deployment, bound: BoundAxis, key: str) -> tuple[float, float]:
    """Least and most that a limit may be set to while the daemon runs."""
    now: float = getattr(bound.config.limits, key)
    control = deployment.config.control
    ranges = control.adjustable if control else {}
    low, high = ranges.get(f"axes.{bound.name}.limits.{key}", (now, now))
    return low, high


def _standstill_ns(deployment: Deployment) -> int:
    """The longest that the loop may stand still without notice: the shortest of all timeouts."""
    timeouts = [one.config.timeout_ms for one in deployment.stopping_inputs]
    timeouts += [axis.config.valve.timeout_ms for axis in deployment.axes.values()]
    return min(timeouts) * 1_000_000
