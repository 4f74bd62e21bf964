"""Output limits: the last line before the frame, pure functions, the same for every filter.

Order: range the operator allows -> minimum and maximum -> rise and fall rate -> grid of the frame.
The code compares instead of calling min and max, which take ten times as long in every frame.
Velocities are fractions of full speed in [-1, 1]; "command" is what the frame carries, with the
valve's deadband already added, or by the measured curve of the valve.
"""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise


class ValveCurve:
    """Speed over command of one valve, in straight lines between measured points.

    Args:
        commands: commands, rising from -1 to 1.
        speeds: speed at each command, rising, 1 or -1 at the faster end; zero at two neighbours,
            the ends of the dead band, of which the first is at a command up to 0 and the second
            from 0 on.

    Raises:
        ValueError: the points are no such curve.
    """

    __slots__ = ("commands", "speeds")

    def __init__(self, commands: Sequence[float], speeds: Sequence[float]) -> None:
        if fault := next(_faults(commands, speeds), None):
            raise ValueError(fault)
        self.commands = tuple(commands)
        self.speeds = tuple(speeds)

    def command(self, velocity: float) -> float:
        """Return the command for a velocity; full command beyond what the valve gives."""
        if velocity == 0.0:
            return 0.0
        speeds, commands = self.speeds, self.commands
        if velocity >= speeds[-1]:
            return commands[-1]
        if velocity <= speeds[0]:
            return commands[0]
        # Of the two points with speed zero the right one is found for each direction.
        return _between(velocity, speeds, commands, bisect_right(speeds, velocity))

    def velocity(self, command: float) -> float:
        """Return the velocity that a command gives; zero within the dead band."""
        speeds, commands = self.speeds, self.commands
        if command >= commands[-1]:
            return speeds[-1]
        if command <= commands[0]:
            return speeds[0]
        return _between(command, commands, speeds, bisect_right(commands, command))


def _faults(commands: Sequence[float], speeds: Sequence[float]) -> Iterator[str]:
    """Yield the faults of the points of a curve; each check relies on those before it."""
    if len(commands) != len(speeds):
        yield f"expected a speed for each command, got {len(commands)} and {len(speeds)}"
    if len(commands) < 4 or commands[0] != -1.0 or commands[-1] != 1.0:
        yield "expected commands from -100 to 100 %, with the ends of the dead band between"
    if any(b <= a for a, b in pairwise(commands)):
        yield "commands do not rise"
    zeros = [i for i, speed in enumerate(speeds) if speed == 0.0]
    if len(zeros) != 2 or zeros[1] != zeros[0] + 1 or not 0 < zeros[0] < len(speeds) - 2:
        yield "expected two neighbouring commands with speed 0, the ends of the dead band"
    if not commands[zeros[0]] <= 0.0 <= commands[zeros[1]]:
        yield "the dead band does not lie around command 0"
    if any(b <= a for a, b in pairwise([*speeds[: zeros[1]], *speeds[zeros[1] + 1 :]])):
        yield "speeds do not rise with the command"
    if not 0.999 <= max(-speeds[0], speeds[-1]) <= 1.0:
        yield "the faster direction has speed 100 % at full command, and none has more"


def _between(value: float, xs: Sequence[float], ys: Sequence[float], high: int) -> float:
    """Return y at ``value`` on the line through the points ``high - 1`` and ``high``."""
    x0, x1, y0, y1 = xs[high - 1], xs[high], ys[high - 1], ys[high]
    return y0 + (value - x0) * (y1 - y0) / (x1 - x0)


@dataclass(frozen=True, slots=True)
class OutputLimits:
    """Limits of one axis.

    Attributes:
        maximum: largest |velocity|, 0 to 1.
        minimum: |velocity| below which the output goes to zero, 0 to below ``maximum``; the rates
            hold on the way through.
        rise_per_s: fastest growth of |velocity|, full scales per second.
        fall_per_s: fastest fall of |velocity| towards zero, full scales per second.
        deadband: fraction of the command in which the valve does not open; added to every
            command that is not zero.
        curve: curve of the measured valve, instead of the deadband.
        tail_s: how long the output may stay as fast as the operator demanded before, seconds.
        allow_faster: the output may exceed the demands now and within the tail.
        allow_reverse: the output may go against the joystick.
        reversal_s: how long after a reversal of the joystick the output may run on in the old
            direction, the fall included, seconds; 0: it falls at once.
        run_on: how far the output may run beyond the present demand, the fall included, full speed
            times seconds.
    """

    maximum: float = 1.0
    minimum: float = 0.0
    rise_per_s: float = 5.0
    fall_per_s: float = 5.0
    deadband: float = 0.0
    curve: ValveCurve | None = None
    tail_s: float = 2.0
    allow_faster: bool = False
    allow_reverse: bool = False
    reversal_s: float = 0.0
    run_on: float = math.inf

    def velocity(self, command: float) -> float:
        """Return the velocity for a command to the valve, both as parts of full."""
        curve, deadband = self.curve, self.deadband
        return curve.velocity(command) if curve else without_deadband(command, deadband)


class RecentDemand:
    """Largest and smallest command of this tick and the ``ticks`` before it, zero included.

    Amortised constant time: two monotonic queues, of positive and of negative commands.
    """

    __slots__ = ("_largest", "_now", "_smallest", "_ticks", "high", "low")

    def __init__(self, ticks: int) -> None:
        self._ticks = ticks
        self._now = 0
        self._largest: deque[tuple[int, float]] = deque()
        self._smallest: deque[tuple[int, float]] = deque()
        self.low = 0.0
        self.high = 0.0

    def clear(self) -> None:
        """Invalidate every command: nothing was commanded within the tail."""
        self._largest.clear()
        self._smallest.clear()
        self.low = self.high = 0.0

    def clear_against(self, held: float) -> None:
        """Invalidate the commands against the sign of ``held``, which is not 0."""
        if held > 0.0:
            self._smallest.clear()
            self.low = 0.0
        else:
            self._largest.clear()
            self.high = 0.0

    def age(self, ticks: int) -> None:
        """Let ``ticks`` pass without a command; the bounds follow with the next ``add``."""
        self._now += ticks

    def add(self, command: float) -> None:
        """Take this tick's command; then ``low <= 0 <= high`` bound all recent commands."""
        now = self._now = self._now + 1
        largest, smallest = self._largest, self._smallest
        if command > 0.0:
            while largest and largest[-1][1] <= command:
                largest.pop()
            largest.append((now, command))
        elif command < 0.0:
            while smallest and smallest[-1][1] >= command:
                smallest.pop()
            smallest.append((now, command))
        expired = now - self._ticks
        if largest:  # else high is 0 already
            while largest and largest[0][0] < expired:
                largest.popleft()
            self.high = largest[0][1] if largest else 0.0
        if smallest:
            while smallest and smallest[0][0] < expired:
                smallest.popleft()
            self.low = smallest[0][1] if smallest else 0.0


def allowed_range(
    recent_low: float, recent_high: float, limits: OutputLimits
) -> tuple[float, float]:
    """Return the range of the output: as fast as demanded within the tail, or faster if allowed.

    Args:
        recent_low: smallest command within the tail, 0 or negative.
        recent_high: largest command within the tail, 0 or positive.
        limits: the axis' limits: ``maximum``, ``allow_faster`` and ``allow_reverse``.

    Returns:
        (low, high) with low <= 0 <= high.
    """
    if recent_low == 0.0 and recent_high == 0.0:
        return 0.0, 0.0  # nothing asked within the tail: nothing moves, whatever is configured
    low, high = recent_low, recent_high
    if limits.allow_faster:
        low, high = (-1.0 if low < 0.0 else 0.0), (1.0 if high > 0.0 else 0.0)
    if limits.allow_reverse:
        low, high = min(low, -high), max(high, -low)
    maximum = limits.maximum
    return (-maximum if low < -maximum else low), (maximum if high > maximum else high)


def within(
    velocity: float, low: float, high: float, minimum: float, name: str = "velocity"
) -> float:
    """Clamp to [low, high]; below ``minimum`` in magnitude the result is zero.

    Raises:
        ValueError: the velocity, called by this name, is not finite: it must not reach a valve.
    """
    if low <= velocity <= high:
        clipped = velocity
    elif math.isfinite(velocity):
        clipped = low if velocity < low else high
    else:
        raise ValueError(f"{name} is {velocity}")
    return clipped if abs(clipped) >= minimum else 0.0


def rate_limited(target: float, last: float, rise: float, fall: float) -> float:
    """Move from ``last`` towards ``target`` by at most ``rise`` (away from zero) or ``fall``.

    Both are changes per tick. A change of sign falls to zero first, and rises in the rest of the
    tick.
    """
    if last < 0.0:
        return -rate_limited(-target, -last, rise, fall)
    if target >= last:
        highest = last + rise
        return highest if target > highest else target
    if target >= 0.0 or last > fall:
        lowest = last - fall
        return lowest if target < lowest else target
    # last/fall of the tick are used up by the way to zero
    return max(target, -rise * (1.0 - last / fall))


def with_deadband(velocity: float, deadband: float) -> float:
    """Command for a velocity: the deadband is jumped over, full speed stays full command."""
    if velocity > 0.0:
        return (1.0 - deadband) * velocity + deadband
    return (1.0 - deadband) * velocity - deadband if velocity < 0.0 else velocity


def without_deadband(command: float, deadband: float) -> float:
    """Velocity that a command gives: the inverse of ``with_deadband``, zero inside the deadband."""
    if command > deadband:
        return (command - deadband) / (1.0 - deadband)
    return (command + deadband) / (1.0 - deadband) if command < -deadband else 0.0


def on_grid(
    velocity: float,
    low: float,
    high: float,
    deadband: float,
    steps: int,
    *,
    curve: ValveCurve | None = None,
) -> tuple[int, float]:
    """Round a velocity to a step of the frame, or towards zero where a bound is in the way.

    Args:
        velocity: limited velocity, [-1, 1].
        low: lower bound that rounding must not pass, except to zero.
        high: upper bound, as ``low``.
        deadband: deadband to add, fraction of full command.
        steps: raw steps of the frame from zero to full command.
        curve: curve of the measured valve, instead of the deadband.

    Returns:
        (raw step of the frame, velocity that this step gives, with which the filter goes on).
    """
    if curve is not None:
        return _on_curve(velocity, low, high, curve, steps)
    raw = round(with_deadband(velocity, deadband) * steps)
    sent = without_deadband(raw / steps, deadband)
    while raw and not low <= sent <= high:
        raw += -1 if raw > 0 else 1
        sent = without_deadband(raw / steps, deadband)
    return (raw, sent) if sent else (0, 0.0)


def _on_curve(
    velocity: float, low: float, high: float, curve: ValveCurve, steps: int
) -> tuple[int, float]:
    raw = round(curve.command(velocity) * steps)
    sent = curve.velocity(raw / steps)
    while raw and not low <= sent <= high:
        raw += -1 if raw > 0 else 1
        sent = curve.velocity(raw / steps)
    return (raw, sent) if sent else (0, 0.0)
