"""How far an axis still travels after its input ends, at full speed.

Travel is in seconds of full speed: times the speed of the tip it is metres, times the angular speed
of a slewing axis radians. It is that of the commands; the valve adds its own lag.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Self

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.states import MOVING, CommandInput, Reason

# Until a filter of the schema gives full speed: five times the longest time constant.
WARM_UP_S = 25.0
# Releases that are tried: up to so long a stroke, at such intervals.
LONGEST_PULSE_S = 4.0
RELEASES_S = 0.1
# Longer than the longest tail and the slowest fall of the schema.
LONGEST_STOP_S = 15.0


@dataclass(frozen=True, slots=True)
class Travel:
    """Travel after each event, seconds of full speed; and time.

    Attributes:
        release: the joystick goes to neutral.
        reversal: the joystick goes to full speed the other way; what is still travelled in the old
            direction.
        lost: the joystick's frames end.
        enable: enable released, or emergency stop.
        reversal_s: how long it moves in the old direction after that reversal, s.
    """

    release: float
    reversal: float
    lost: float
    enable: float
    reversal_s: float

    @classmethod
    def worst(cls, travels: "list[Travel]") -> Self:
        """The longest after each event."""
        return cls(*(max(getattr(t, f.name) for t in travels) for f in fields(cls)))


def allowed_s(limits: OutputLimits, *, stop_s: float, timeout_s: float, period_s: float) -> float:
    """Travel that the limits allow after release or a lost joystick, whatever the filter does.

    Full speed until the event is seen, full speed for the whole tail, then the slowest fall; where
    the run-on is bounded no farther than that, and a period for the tick in which it ends.

    Args:
        limits: limits of the axis.
        stop_s: longest duration of STOPPING.
        timeout_s: age at which the joystick counts as lost.
        period_s: time between two commands to the valve; an event waits so long at most.

    Returns:
        Seconds of full speed.
    """
    full, fall = limits.maximum, limits.fall_per_s
    # Durations are whole ticks; the longest that rounding makes of them.
    tail_s, stop_s = limits.tail_s + 0.5 * period_s, max(stop_s + 0.5 * period_s, period_s)
    falling_s = min(full / fall, max(0.0, stop_s - tail_s))
    stop = full * min(tail_s, stop_s) + (full - 0.5 * fall * falling_s) * falling_s
    release = full * tail_s + 0.5 * full * full / fall
    run_on = limits.run_on + full * period_s
    stop, release = min(stop, run_on), min(release, run_on)
    return max(full * (timeout_s + period_s) + stop, full * period_s + release)


def travel(new_axis: Callable[[], ShapedAxis], *, timeout_s: float, period_s: float) -> Travel:
    """Travel of an axis with its filter, computed by letting it run, in the worse direction.

    Args:
        new_axis: makes the axis.
        timeout_s: age at which the joystick counts as lost.
        period_s: time between two calls of ``ShapedAxis.tick``.
    """
    return Travel.worst([_travel(new_axis(), sign, timeout_s, period_s) for sign in (1.0, -1.0)])


def _travel(axis: ShapedAxis, sign: float, timeout_s: float, period_s: float) -> Travel:
    axis.tick(CommandInput())
    for _ in range(round(WARM_UP_S / period_s)):
        axis.tick(CommandInput(sign))
    # An event waits for the next tick, and silence for the timeout before; until then it goes on.
    full = sign * axis.sent

    def after(joystick: CommandInput, wait_s: float = period_s) -> float:
        return full * wait_s + _way(axis, joystick, sign, period_s)[0]

    way, ticks = _way(axis, CommandInput(-sign), sign, period_s)
    return Travel(
        release=after(CommandInput()),
        reversal=full * period_s + way,
        lost=after(CommandInput(fault=Reason.JOYSTICK_TIMEOUT), timeout_s + period_s),
        enable=after(CommandInput(enabled=False)),
        reversal_s=ticks * period_s,
    )


def needed_s(new_axis: Callable[[], ShapedAxis], *, timeout_s: float, period_s: float) -> float:
    """Travel to which an axis can be bounded without cutting the run-on of its filter short.

    Of all strokes at full speed the worst one counts, and the wait for a lost joystick.

    Args:
        new_axis: makes the axis, with ``OutputLimits.run_on`` that bounds nothing.
        timeout_s, period_s: as of ``travel``.
    """
    most = 0.0
    ticks = max(round(RELEASES_S / period_s), 1)
    for sign in (1.0, -1.0):
        axis, way = new_axis(), 0.0
        axis.tick(CommandInput())
        for _ in range(round(LONGEST_PULSE_S / RELEASES_S)):
            for _ in range(ticks):
                axis.tick(CommandInput(sign))
            way = max(way, _way(axis, CommandInput(), sign, period_s)[0])
        most = max(most, sign * axis.sent * (timeout_s + 2.0 * period_s) + way)
    return most


def _way(
    steady: ShapedAxis, joystick: CommandInput, sign: float, period_s: float
) -> tuple[float, int]:
    """How far the axis gets in the old direction, and for how many ticks it moves there."""
    axis = copy.deepcopy(steady)
    way_s = most_s = 0.0
    last = 0
    for tick in range(1, round(LONGEST_STOP_S / period_s) + 1):
        axis.tick(joystick)
        if axis.state not in MOVING:
            break
        velocity = sign * axis.sent
        way_s += velocity * period_s
        most_s = max(most_s, way_s)
        last = tick if velocity > 0.0 else last
    return most_s, last
