"""The sliders of the page: how calm the filter is, and how long it believes the pendulum to be.

Each slider is a factor on numbers of the deployment file: "calm" stretches a filter in time that
has no settings to choose from (see ``preference``); "length" makes the pendulum that the filter
believes in longer. Several numbers change together, through the daemon's control socket.
"""

import math
from dataclasses import dataclass
from typing import Any

from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.shaping.registry import KINDS

CALM, LENGTH = "calm", "length"
RANGES = {CALM: (0.5, 2.0), LENGTH: (0.5, 2.0)}
"""Allowed factors."""


@dataclass(frozen=True)
class Number:
    """A number of the file, and with which power of the slider's factor it goes.

    Attributes:
        key: dotted path in the deployment file.
        value: what the file says.
        power: the value is that of the file times factor ** power.
    """

    key: str
    value: float
    power: float

    def at(self, factor: float) -> float:
        """The number at a factor."""
        return self.value * math.pow(factor, self.power)


def sliders(config: DeploymentConfig) -> dict[str, list[Number]]:
    """The numbers of each slider; none where no filter of the deployment has any.

    An axis with a gain schedule or profiles is left out: what is in force there
    changes with the machine.
    """
    by_slider: dict[str, list[Number]] = {CALM: [], LENGTH: []}
    for name, axis in config.axes.items():
        if not axis.gain_schedule and not axis.profiles:
            by_slider[CALM] += _calm(name, axis)
            by_slider[LENGTH] += _length(name, axis)
    return {name: numbers for name, numbers in by_slider.items() if numbers}


def _calm(name: str, axis: AxisSection) -> list[Number]:
    """Time constants: all poles move along their rays, so that the filter keeps its shape."""
    if axis.sway is None:  # the daemon refuses: without a model there is nothing to join to
        return []
    parameters = KINDS[axis.filter.kind].parameters
    powers = {p.name: p.stretch for p in parameters if p.stretch}
    return _numbers(f"axes.{name}.filter", axis.filter, powers)


def _length(name: str, axis: AxisSection) -> list[Number]:
    """The period grows with the root of the length."""
    if axis.sway is None:
        return []
    return _numbers(f"axes.{name}.sway", axis.sway, {"length_m": 1.0, "period_s": 0.5})


def _numbers(place: str, section: Any, powers: dict[str, float]) -> list[Number]:
    numbers = []
    for key, power in powers.items():
        value = getattr(section, key)
        if value is not None:
            numbers.append(Number(f"{place}.{key}", float(value), power))
    return numbers


def adjustable(by_slider: dict[str, list[Number]]) -> dict[str, list[float]]:
    """The control section's ``adjustable``: the range of every number that a slider changes."""
    ranges = {}
    for name, numbers in by_slider.items():
        for number in numbers:
            ends = sorted(number.at(factor) for factor in RANGES[name])
            room = 1e-6 * abs(number.value)  # the ends are within, however they are rounded
            ranges[number.key] = [ends[0] - room, ends[1] + room]
    return ranges


def values(numbers: dict[str, list[Number]], name: str, factor: float) -> dict[str, float]:
    """Return the numbers of a slider at a factor.

    Raises:
        ValueError: no such slider, or a factor that is not allowed.
    """
    if name not in numbers:
        there = ", ".join(numbers) or "none"
        raise ValueError(f"expected a slider, got {name[:20]!r}; there are {there}")
    low, high = RANGES[name]
    if not low <= factor <= high:
        raise ValueError(f"slider {name}: expected {low:g} to {high:g}, got {str(factor)[:20]}")
    return {number.key: number.at(factor) for number in numbers[name]}
