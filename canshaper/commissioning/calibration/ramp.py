"""The ramp of a measurement, the speed that answers it, and the end stop that ends it."""

import math
from bisect import bisect_left
from dataclasses import dataclass

from cantools.database.can import Message, Signal

from canshaper.codec.frame import NULL, Frame, group_of
from canshaper.codec.layout import CLASSICAL_BYTES, FD_LENGTHS, Layout
from canshaper.codec.message import UNPROTECTED
from canshaper.codec.signals import find_signal
from canshaper.config.inputs import InputSection
from canshaper.config.limits import Limits
from canshaper.errors import ConfigError, Problem, UsageError
from canshaper.inputs.value import ValueInput, measurable
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper_sim.axes import SPEED_SIGNALS

# Slow enough for a lag of 0.3 s, quick enough for a joint that has room for 2 s of full speed.
RATE_PER_S, TOP = 0.1, 0.4
# Of two axes at once, which go up to full speed: they have room for 3 s of it.
TOGETHER_PER_S = 0.5


@dataclass(frozen=True, slots=True)
class Ramp:
    """A command that rises and falls: positive first, then negative, with rests around them.

    Attributes:
        rate_per_s: how fast the command rises and falls, parts of full command per second.
        top: largest command, part of full.
        rest_s: length of each rest; how much the feedback trembles is measured in it.
        hold_s: how long the largest command is held.
    """

    rate_per_s: float
    top: float
    rest_s: float = 2.0
    hold_s: float = 1.0

    @property
    def half_s(self) -> float:
        """Time of a rest and one direction."""
        return self.rest_s + 2.0 * self.up_s + self.hold_s

    @property
    def up_s(self) -> float:
        """Time in which the command rises to the top, or falls from it."""
        return self.top / self.rate_per_s

    @property
    def duration_s(self) -> float:
        """Time of the whole ramp, both directions and three rests."""
        return 2.0 * self.half_s + self.rest_s

    @property
    def travel_s(self) -> float:
        """How far the axis goes in one direction, seconds of full speed; less with a dead band."""
        return self.top * (self.up_s + self.hold_s)

    def command(self, time_s: float) -> float:
        """Return the command at a time, part of full; 0 before the beginning and after the end."""
        half, into_s = divmod(time_s, self.half_s)
        if half not in (0, 1):
            return 0.0
        rising = (into_s - self.rest_s) * self.rate_per_s
        falling = (self.half_s - into_s) * self.rate_per_s
        return min(self.top, max(0.0, min(rising, falling))) * (1.0 if half == 0 else -1.0)

    def part(self, time_s: float) -> str:
        """Return the part of the ramp: settling, rest, or up, hold, held, down with + or - behind.

        Second halves of a rest (rest) and of the largest command (held) are measured: all settled.
        """
        half, into_s = divmod(time_s, self.half_s)
        if half > 1 or into_s < self.rest_s:
            return "rest" if into_s > 0.5 * self.rest_s else "settling"
        direction = "+-"[int(half)]
        into_s -= self.rest_s + self.up_s
        if into_s < 0.0:
            return f"up{direction}"
        if into_s < self.hold_s:
            return f"held{direction}" if into_s > 0.5 * self.hold_s else f"hold{direction}"
        return f"down{direction}"


def usual_top(limits: Limits) -> float:
    """Return the default top of the ramp, part of full command; at most what the file allows."""
    return min(TOP, limits.max_pct / 100.0)


# An axis moves where its speed is farther from rest than so many times its noise at rest.
LEAST = 5.0
# An axis is at its end where its speed stays below this part of what the same command gave before,
# for so long.
PART, LASTING_S = 0.5, 0.5


class EndStopDetector:
    """Notices by its speed that an axis on its ramp has reached an end stop."""

    def __init__(self) -> None:
        self._low, self._high = math.inf, -math.inf  # at rest
        # Commands of the way up and the largest speed until each, in order.
        self._commands: list[float] = []
        self._speeds: list[float] = []
        self._moved_s = 0.0

    def reached(self, part: str, time_s: float, command: float, speed: float) -> bool:
        """Take a speed; return whether it has been too slow for its command for ``LASTING_S``.

        Args:
            part: of the ramp, as ``Ramp.part`` names it.
            time_s: since this run of the ramp began.
            command: of the ramp, part of full.
            speed: of the feedback, in its own unit.
        """
        if part in ("settling", "rest"):
            if part == "rest":
                self._low, self._high = min(self._low, speed), max(self._high, speed)
            self._commands, self._speeds = [], []
            return False
        away = abs(speed - 0.5 * (self._low + self._high))
        if not part.startswith("down"):
            self._commands.append(abs(command))
            self._speeds.append(max(away, self._speeds[-1] if self._speeds else 0.0))
        number = min(bisect_left(self._commands, abs(command)), len(self._speeds) - 1)
        before = self._speeds[number]
        if before <= LEAST * 0.5 * (self._high - self._low) or away >= PART * before:
            self._moved_s = time_s
        return time_s - self._moved_s >= LASTING_S


def speed_signal(deployment: Deployment, axis: str, speed: str | None) -> tuple[str, str]:
    """Return message and signal with the speed of an axis.

    Args:
        deployment, axis: the machine, and the name of its axis.
        speed: MESSAGE.SIGNAL; None for the feedback in the file, else that of the simulated crane.

    Raises:
        UsageError: no such axis, no name of that form, or none is known.
    """
    bound = deployment.axes.get(axis)
    if bound is None:
        names = ", ".join(deployment.axes)
        raise UsageError(f"--axis: expected an axis, got {axis!r}; there are {names}")
    if speed is None and bound.config.feedback:
        return bound.config.feedback.message, bound.config.feedback.signal
    moved = deployment.coordinates.get(axis, axis)
    message, dot, signal = (speed or SPEED_SIGNALS.get(moved, "")).partition(".")
    if not (message and dot and signal):
        raise UsageError(f"--speed: expected MESSAGE.SIGNAL, got {speed or 'none'}")
    return message, signal


# Older feedback counts as lost: an axis must not move unseen.
SILENT_MS = 500


class SpeedFeedback:
    """Feedback of the speed of one axis.

    Where the deployment names the signal as ``feedback`` of the axis, its bus, source, counter and
    checksum hold. Any other message has to come on the bus of the valve.

    Args:
        deployment, axis: the machine, and the name of its axis.
        message, signal: their names in the DBC.

    Raises:
        ConfigError: no such message or signal, or one that cannot be measured with.
    """

    def __init__(self, deployment: Deployment, axis: str, message: str, signal: str) -> None:
        bus = deployment.config.buses[deployment.axes[axis].config.valve.bus]
        feedback = _find(deployment, message, signal, fd=bus.fd)
        self._bound = bound = _bound(deployment, axis, message, feedback[0], signal)
        self._input = ValueInput(bound, feedback[1], *measurable(feedback[1]))
        self._keys = frozenset(bound.keys)
        _, can_id, _ = bound.key
        self._source = None if can_id & 0xFF == NULL else can_id & 0xFF

    @property
    def value(self) -> float:
        """The last valid speed, in the unit of the DBC; 0 before there is one, see ``valid``."""
        return self._input.value

    def valid(self, now_ns: int) -> bool:
        """Return whether there is a valid speed now: no silence, no error code."""
        measured_ns = self._input.measured_ns
        return measured_ns is not None and now_ns - measured_ns <= SILENT_MS * 1_000_000

    def receive(self, frame: Frame, arrived_ns: int) -> None:
        """Take a frame; those of other messages are ignored."""
        if self._mine(frame):
            self._input.receive(frame.data, arrived_ns)

    def _mine(self, frame: Frame) -> bool:
        if not self._bound.by_group:
            return frame[:3] in self._keys
        bus, can_id, _ = self._bound.key
        if frame.bus != bus or not frame.extended or group_of(frame.can_id) != group_of(can_id):
            return False
        source = frame.can_id & 0xFF
        if self._source is None:
            self._source = source  # the first that is received, and no other any more
        return source == self._source


def _find(deployment: Deployment, message: str, signal: str, *, fd: bool) -> tuple[Message, Signal]:
    match = deployment.messages.find(message)
    if isinstance(match, str):
        raise ConfigError([Problem("command line", None, "--speed", match)])
    definition = find_signal(match[1], signal)
    if definition is None:
        names = ", ".join(s.name for s in match[1].signals)
        text = f"expected a signal of {message}, got {signal!r}; there are {names}"
        raise _problem(deployment, text)
    if match[1].is_multiplexed():
        raise _problem(deployment, f"{message} is multiplexed; nothing can be read from it")
    lengths = FD_LENGTHS if fd else range(CLASSICAL_BYTES + 1)
    if match[1].length not in lengths:
        text = f"{message}: expected the length of a frame, {lengths[-1]} bytes at most"
        text += f", got {match[1].length}"
        raise _problem(deployment, text)
    return match[1], definition


def _bound(
    deployment: Deployment, axis: str, name: str, message: Message, signal: str
) -> BoundInput:
    of_axis = deployment.axes[axis].feedback
    if of_axis and (of_axis.config.message, of_axis.config.signal) == (name, signal):
        return of_axis
    bus = deployment.axes[axis].config.valve.bus
    config = InputSection(bus=bus, message=name, timeout_ms=SILENT_MS)
    return BoundInput(config, message, Layout(message), UNPROTECTED, None)


def _problem(deployment: Deployment, text: str) -> ConfigError:
    return ConfigError([Problem(str(deployment.path), None, "--speed", text)])
