"""Numbers that change while the machine runs, within the ranges of its deployment file.

A changed number holds until the daemon ends, or reads its file again.
"""

from collections.abc import Iterable, Mapping

from canshaper.config.adjust import AxisKey, adjusted, value
from canshaper.config.schema import AxisSection
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.controller import Controller
from canshaper.machine.filters import filter_fault
from canshaper.machine.stop_distance import stop_fault

# Most numbers in one request: each axis that changes takes about 40 us of the loop.
MOST_NUMBERS = 16


class Adjuster:
    """Changes the numbers that the section ``control`` of the file makes adjustable.

    Args:
        controller: controller of the machine.
    """

    def __init__(self, controller: Controller) -> None:
        self._axes, self._motions = controller.axes, controller.motions
        self._deployment = controller.deployment
        section = self._deployment.config.control
        self._ranges = section.adjustable if section else {}
        self._in_file = {text: self._now(text) for text in self._ranges}

    def table(self) -> dict[str, dict[str, float]]:
        """Return each adjustable number: its value now and in the file, its minimum and maximum."""
        return {
            text: {"now": self._now(text), "file": self._in_file[text], "low": low, "high": high}
            for text, (low, high) in self._ranges.items()
        }

    def change(self, values: Mapping[str, object]) -> list[str]:
        """Change all of these numbers or none, without a jump of any output.

        Args:
            values: new numbers by their keys, as in the file's ``adjustable``.

        Returns:
            A line for the log for each number, also an equal one, with its value before.

        Raises:
            ValueError: a number is refused; the text says what was expected and what came. No
                number has changed.
        """
        numbers = dict(self._checked(values))
        by_axis: dict[str, dict[AxisKey, float]] = {}
        for key, number in numbers.items():
            by_axis.setdefault(key.axis, {})[key] = number
        configs = {
            name: self._config(name, self._axes[name], axis) for name, axis in by_axis.items()
        }
        changes = [
            f"{key}={number:g} was={self._now(str(key)):g}" for key, number in numbers.items()
        ]
        for name, config in configs.items():
            self._axes[name].adjust(config)
        for motion in self._motions:
            motion.adjust()
        return changes

    def _now(self, text: str) -> float:
        key = _key(text)
        number = value(self._axes[key.axis].bound.config, key)
        assert number is not None  # checked with the deployment
        return number

    def _checked(self, values: Mapping[str, object]) -> Iterable[tuple[AxisKey, float]]:
        if not values:
            raise ValueError("expected a number to change, got none")
        if len(values) > MOST_NUMBERS:
            text = f"expected {MOST_NUMBERS} numbers at most, got {len(values)}"
            raise ValueError(text)
        for text, number in values.items():
            if text not in self._ranges:
                names = ", ".join(self._ranges) or "none"
                raise ValueError(f"{text}: expected an adjustable number; there are {names}")
            low, high = self._ranges[text]
            if isinstance(number, bool) or not isinstance(number, int | float):
                raise ValueError(f"{text}: expected a number, got {number!r}")
            if not low <= number <= high:  # refuses NaN too
                raise ValueError(f"{text}: expected {low:g} to {high:g}, got {number:g}")
            yield _key(text), float(number)

    def _config(
        self, name: str, control: AxisControl, values: Mapping[AxisKey, float]
    ) -> AxisSection:
        try:
            config = adjusted(control.bound.config, values, self._deployment.config.axes[name])
        except ValueError as error:
            raise ValueError(f"axes.{name}.{error}") from None
        before = control.limits(control.bound.config)
        if control.limits(config) != before and not control.axis.neutral:
            state = control.axis.state.name
            raise ValueError(f"axes.{name}.limits: the axis is {state}; limits change in neutral")
        if control.axis.output.commanded and not control.axis.demand:
            # A new filter could open the valve again, though no one demands motion any more.
            raise ValueError(f"axes.{name}: it runs on with its joystick released; wait for rest")
        rate = config.limits.slowest_per_s
        if fault := filter_fault(config.filter, config.sway, control.period_s, rate):
            raise ValueError(f"axes.{name}.filter: {fault}")
        if fault := stop_fault(self._deployment, name, config):
            raise ValueError(f"axes.{name}.limits.stop_distance_m: {fault}")
        return config


def _key(text: str) -> AxisKey:
    key = AxisKey.parsed(text)
    assert key is not None  # checked with the deployment
    return key
