"""What one axis may be sent now, and why not more: limits, what was asked, rates."""

import math

from canshaper.guard.bits import CommandBits, StickBits
from canshaper.guard.inputs import Asked, GuardedJoystick, GuardedStop, largest
from canshaper.guard.opening import openings
from canshaper.machine.deployment import BoundAxis, Deployment

# Part of full speed; less than any step, more than the rounding of floats.
EPSILON = 1e-6
# A velocity is rounded to the nearest step; down by up to one where that would be too fast.
UP, DOWN = 0.5, 1.0
# Periods by which an output may be late: tail and stop are whole periods, the last one included,
# and a compensation follows what asks for it.
LATE_PERIODS = 3
FOREVER = 10**19  # ns
# Commands whose velocity is kept, so that a fine one does not fill the memory.
MOST_VELOCITIES = 4096


class GuardedAxis(Asked):
    """One axis: what its valve may be sent now.

    Attributes:
        name: of the axis.
        bits: its command in the valve frame.
        span: the bytes of a frame that tell it.
        part: what they were in the last frame that left.
        at: when that was, as ``refusal`` has it.
    """

    __slots__ = (
        "_added",
        "_adding",
        "_bound",
        "_cut",
        "_cut_ns",
        "_cut_until_ns",
        "_down",
        "_fall",
        "_fall_least",
        "_faster",
        "_full",
        "_joystick",
        "_kept_ns",
        "_length",
        "_maximum",
        "_more",
        "_openings",
        "_own",
        "_period",
        "_period_ns",
        "_reverse",
        "_rise",
        "_silent_ns",
        "_stop",
        "_up",
        "_velocities",
        "_velocity",
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
        stop: GuardedStop | None,
    ) -> None:
        super().__init__()
        config, limits = bound.config, bound.config.limits
        period_ns = deployment.config.tick_ms * 1_000_000 * bound.period_ticks
        period_s = period_ns * 1e-9
        self.name = bound.name
        self.bits = CommandBits(
            bound.valve_message, config.valve, config.stick if bound.rewrites else None
        )
        self._length, self.span = bound.valve_message.length, self.bits.span
        self.part = b""
        self.at = -1, -1
        self._joystick, self._stop = joystick, stop
        self._adding: list[GuardedAxis] = []
        self._added = 0.0
        self._cut, self._cut_ns, self._cut_until_ns = 0.0, 0, 0
        self._own = [0.0, 0.0]  # speed at most without what is added, negative and positive
        message = deployment.levers[config.stick.lever].message
        joystick.drives(StickBits(message, config.stick), self)
        if stop is not None:
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
        # At full command a valve may give less than was meant.
        full = self.bits.full
        self._full = min(one.velocity(full) for one in self._openings) - EPSILON
        self._velocities: dict[bytes, float] = {}
        self._period, self._period_ns = bound.period_ticks, period_ns
        self._velocity = 0.0  # of the last frame
        self._bound = self._down  # its size at most, before it was rounded

    def moves(self, data: bytes) -> bool:
        """Whether a frame is anything but neutral."""
        return len(data) != self._length or self.bits.steps(data) != 0

    def refusal(self, data: bytes, now_ns: int, at: tuple[int, int]) -> str:
        """Why a frame may not leave; empty where it may.

        Args:
            data: the frame.
            now_ns: monotonic time.
            at: number of this deadline, and of this tick, which does not count those missed.
        """
        part, (number, tick) = data[self.span], at
        velocity = self._velocities.get(part)
        if velocity is None or len(data) != self._length:
            velocity = self._learn(data)
        good_ns, bound = FOREVER, self._down
        if velocity != 0.0:
            reach, good_ns = self._asked_for(velocity, now_ns)
            last, period, size = self._velocity, self._period, abs(velocity)
            before = self._up - abs(last) if velocity * last < 0.0 else self._bound
            periods = number // period - self.at[0] // period
            highest = self._highest(before, periods)
            cut = own = 0.0
            if now_ns < self._cut_until_ns:
                # What was added against the axis' own part may end at once, and leaves that.
                cut, own = self._cut, self._own[velocity > 0.0]
                highest = max(highest, min(own, self._highest(before + cut, periods)))
            allowed = reach if reach < highest else highest
            bound = size + self._down
            if size > allowed and good_ns and velocity * last > 0.0:
                # On its way back. The rates do not catch up on deadlines that were missed, so for
                # the fall they do not count; and it has to be lower with each frame.
                fallen = self._bound - (tick - self.at[1]) // period * self._fall_least
                fallen = max(fallen, min(own, fallen + cut))
                if fallen > allowed:
                    allowed, good_ns = fallen, 0
                    bound = min(bound, fallen)
            elif size >= self._full:
                bound = allowed
            if size > allowed + EPSILON:
                return self._why(velocity, reach, allowed, now_ns)
        self.part, self.good_ns, self.at = part, good_ns, at
        self._velocity, self._bound = velocity, bound
        return ""

    def _highest(self, before: float, periods: int) -> float:
        """Speed that the rates allow after one in the same direction, negative in the other."""
        if before < 0.0:  # a part of the time goes by on the way to zero
            left = periods + before / self._fall
            return (left * self._rise if left > 0.0 else 0.0) + self._up
        return before + periods * self._rise + self._up

    def _asked_for(self, velocity: float, now_ns: int) -> tuple[float, int]:
        """Speed that was asked for in the direction of a velocity, and until when that holds.

        Both are 0 where nothing may move at all.
        """
        since_ns, joystick = now_ns - self._kept_ns, self._joystick
        from_ns = heard_ns = joystick.heard_ns
        if joystick.released or heard_ns < now_ns - self._silent_ns:
            return 0.0, 0
        free_ns = heard_ns + self._silent_ns
        if self._stop is not None:
            free_ns = min(free_ns, self._stop.free_ns())
            if free_ns < now_ns:
                return 0.0, 0
        if velocity > 0.0:
            reach, sizes = self.now, self.positive
        else:
            reach, sizes = -self.now, self.negative
        if reach < 0.0 or heard_ns < since_ns:
            reach = 0.0
        if sizes and (before := largest(sizes, since_ns)) > reach:
            reach, from_ns = before, sizes[0][1]
        if self._more:
            reach, from_ns = self._reach(reach, now_ns, velocity > 0.0), since_ns  # for this moment
        until_ns = from_ns + self._kept_ns
        reach = min(reach, self._maximum)
        return reach, until_ns if until_ns < free_ns else free_ns

    def _learn(self, data: bytes) -> float:
        """Velocity of a command; infinite where its signals contradict each other."""
        steps = self.bits.steps(data) if len(data) == self._length else None
        if steps is None:
            return math.inf
        if steps > 0:  # a command is one, however small
            velocity = max(self._openings[0].velocity(steps), 2 * EPSILON)
        else:
            velocity = min(-self._openings[1].velocity(-steps), -2 * EPSILON if steps else 0.0)
        if len(self._velocities) >= MOST_VELOCITIES:
            self._velocities.clear()
        self._velocities[data[self.span]] = velocity
        return velocity

    def _why(self, velocity: float, reach: float, allowed: float, now_ns: int) -> str:
        """What a frame is beyond, for the log."""
        if self._stop is not None and now_ns > self._stop.free_ns():
            limit = "emergency-stop"
        elif self._joystick.released:
            limit = "enable"
        elif now_ns - self._joystick.heard_ns > self._silent_ns:
            limit = "silence"
        elif velocity == math.inf:
            limit = "command"
        else:
            limit = "maximum" if allowed == self._maximum else "asked"
            limit = limit if allowed == reach else "rate"
        return f"axis={self.name} limit={limit} speed={velocity:.3f} allowed={allowed:.3f}"

    def _reach(self, reach: float, now_ns: int, up: bool) -> float:
        """What may be, beyond what was asked in the direction of the output."""
        if self._reverse:
            reach = max(reach, self._most(now_ns))
        if self._faster and reach:
            reach = 1.0
        self._own[up] = max(reach + self._up, self._own[up] - self._fall_least)
        if any(axis._most(now_ns) for axis in self._adding):
            self._cut_until_ns = now_ns + self._cut_ns  # when asked for no more, it falls
            # A step is paid that rounding has left out before, and rounding comes on top.
            reach += self._added + 1.0 / self.bits.full + self._up
        return reach

    def compensates(self, slew: "GuardedAxis", most: float) -> None:
        """The operator of a slewing axis moves this one too, up to a part of full speed."""
        self._more = True
        self._adding.append(slew)
        self._added = max(self._added, most)
        if slew is not self:
            self._cut = self._added
            self._cut_ns = math.ceil(1.0 / self._fall_least) * self._period_ns

    def _most(self, now_ns: int) -> float:
        """Speed that was asked for in any direction within the tail."""
        since_ns = now_ns - self._kept_ns
        now = abs(self.now) if self._joystick.heard_ns >= since_ns else 0.0
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
    inputs = [*deployment.levers.values(), deployment.emergency_stop]
    timeouts = [one.config.timeout_ms for one in inputs if one]
    timeouts += [axis.config.valve.timeout_ms for axis in deployment.axes.values()]
    return min(timeouts) * 1_000_000
