"""Filters that know nothing of the swing, as many machines have: first order, and S-curve."""

import math

from canshaper.shaping.shapers.kind import Parameter, ShaperKind


class FirstOrder:
    """First-order lag on the command.

    Args:
        tick_s: time between two calls.
        time_constant_s: time to 63 % of a step.
    """

    __slots__ = ("_value", "share")

    def __init__(self, tick_s: float, time_constant_s: float) -> None:
        self.share = -math.expm1(-tick_s / time_constant_s)
        self._value = 0.0

    def step(self, command: float) -> float:
        """Return the output for this tick's command."""
        self._value += self.share * (command - self._value)
        return self._value

    def reset_to_steady_state(self, command: float) -> None:
        """Set the memory as if the command had been constant for long."""
        self._value = command

    def copy_state(self, old: "FirstOrder") -> None:
        """Copy the state of another filter of this class."""
        self._value = old._value


class SCurve:
    """Follows the command with limited rate and limited change of rate.

    Args:
        tick_s: time between two calls.
        rate_per_s: fastest change of the output, full speeds per second.
        jerk_per_s2: fastest change of that rate, full speeds per second squared.
    """

    __slots__ = ("_slope", "_value", "jerk", "rate", "tick_s")

    def __init__(self, tick_s: float, rate_per_s: float, jerk_per_s2: float) -> None:
        self.tick_s = tick_s
        self.rate = rate_per_s
        self.jerk = jerk_per_s2
        self._value = 0.0
        self._slope = 0.0

    def step(self, command: float) -> float:
        """Return the output for this tick's command."""
        left = command - self._value
        change = self.jerk * self.tick_s
        # Fastest slope from which the command can still be met with this jerk in whole ticks:
        # s T + (s - j T) T + ... <= |left|
        steps = abs(left) / (change * self.tick_s)
        reachable = change * 0.5 * (math.sqrt(1.0 + 8.0 * steps) - 1.0)
        reference = math.copysign(min(self.rate, reachable), left)
        self._slope += min(max(reference - self._slope, -change), change)
        step = self._slope * self.tick_s
        if step * left > 0.0 and abs(step) >= abs(left) and abs(self._slope) <= change:
            step, self._slope = left, 0.0  # arrived
        self._value += step
        return self._value

    def reset_to_steady_state(self, command: float) -> None:
        """Set the memory as if the command had been constant for long."""
        self._value, self._slope = command, 0.0

    def copy_state(self, old: "SCurve") -> None:
        """Copy the state of another filter of this class."""
        self._value, self._slope = old._value, old._slope


KINDS = (
    ShaperKind(
        "first_order",
        "A first-order lag.",
        FirstOrder,
        lambda mode, _tick_s: {"first order": {"time_constant_s": 0.3 * mode.period_s}},
        (Parameter("time_constant_s", 0.01, 5, "s", "time to 63 % of a step"),),
        runs_ahead=False,
    ),
    ShaperKind(
        "s_curve",
        "Limited rate and limited change of rate.",
        SCurve,
        lambda mode, _tick_s: {
            "S-curve": {"rate_per_s": 2.2 / mode.period_s, "jerk_per_s2": 16.0 / mode.period_s}
        },
        (
            Parameter("rate_per_s", 0.2, 100, "full speeds per s", "fastest change"),
            Parameter(
                "jerk_per_s2", 0.2, 1000, "full speeds per s^2", "fastest change of the rate"
            ),
        ),
        runs_ahead=False,
    ),
)
