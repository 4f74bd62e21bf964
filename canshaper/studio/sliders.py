"""The slider of the page that sets the pendulum length assumed by the filter.

The slider is a factor on numbers of the deployment file; they change together, through the daemon's
control socket. (Settings of the filters: ``preference``.)
"""

import math
from dataclasses import dataclass

from canshaper.config.schema import DeploymentConfig

LENGTH = "length"
RANGES = {LENGTH: (0.5, 2.0)}
"""Allowed factors."""


@dataclass(frozen=True)
class Number:
    """A number of the file, and the power of the slider's factor that scales it.

    Attributes:
        key: dotted path in the deployment file.
        value: value in the file.
        power: the scaled number is value * factor ** power.
    """

    key: str
    value: float
    power: float

    def at(self, factor: float) -> float:
        """Return the number scaled by this factor of the slider."""
        return self.value * math.pow(factor, self.power)


def sliders(config: DeploymentConfig) -> dict[str, list[Number]]:
    """Return the numbers of each slider; empty if no filter of the deployment has such a number.

    The function leaves out an axis with a gain schedule, profiles or a measured rope, whose numbers
    the machine changes, and one whose filter covers a second mode, which the slider cannot scale.
    """
    numbers: list[Number] = []
    for name, axis in config.axes.items():
        design = axis.filter.design()
        several = axis.gain_schedule or axis.profiles or (design and design.second)
        if axis.sway and not several and not axis.sway.length:
            # The period grows with the root of the length.
            for key, power in (("length_m", 1.0), ("period_s", 0.5)):
                if (value := getattr(axis.sway, key)) is not None:
                    numbers.append(Number(f"axes.{name}.sway.{key}", float(value), power))
    return {LENGTH: numbers} if numbers else {}


def adjustable(by_slider: dict[str, list[Number]]) -> dict[str, list[float]]:
    """Return ``adjustable`` of the section control: the range of every number of a slider."""
    ranges = {}
    for name, numbers in by_slider.items():
        for number in numbers:
            ends = sorted(number.at(factor) for factor in RANGES[name])
            room = 1e-6 * abs(number.value)  # the ends are within, however they are rounded
            ranges[number.key] = [ends[0] - room, ends[1] + room]
    return ranges


def values(numbers: dict[str, list[Number]], name: str, factor: float) -> dict[str, float]:
    """Return the numbers of a slider at this factor, by key.

    Raises:
        ValueError: there is no such slider, or the factor is not allowed.
    """
    if name not in numbers:
        there = ", ".join(numbers) or "none"
        raise ValueError(f"expected a slider, got {name[:20]!r}; there are {there}")
    low, high = RANGES[name]
    if not low <= factor <= high:
        raise ValueError(f"slider {name}: expected {low:g} to {high:g}, got {str(factor)[:20]}")
    return {number.key: number.at(factor) for number in numbers[name]}
