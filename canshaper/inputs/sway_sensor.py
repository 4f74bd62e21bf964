"""Measurements of sway: one message, and what each axis reads of it."""

from typing import Any

from canshaper.codec.frame import FrameFault
from canshaper.inputs.input import GOOD, Input
from canshaper.inputs.value import MeasuredSignal, measurable
from canshaper.machine.sway_sensor import BoundSwaySensor, SensorMessage
from canshaper.shaping.states import Reason


class SwaySensorInput(Input):
    """A message with measurements for one axis or several.

    Attributes:
        number: frames that counted so far.
        values: of the last one, by signal, in the unit of the DBC; None for one that is none.
    """

    def __init__(self, bound: SensorMessage) -> None:
        super().__init__(bound)
        self._signals = [MeasuredSignal(signal, *measurable(signal)) for signal in bound.signals]
        self.number = 0
        self.values: dict[str, float | None] = {}

    def on_frame(
        self,
        raw: dict[str, Any],
        commands: dict[str, float | Reason],
        arrived_ns: int,
        accepted: bool,
    ) -> FrameFault:
        """What is no value is a fault, and no measurement."""
        values = {signal.name: signal.value(raw) for signal in self._signals}
        if accepted:
            self.number += 1
            self.values = values
        return FrameFault.INVALID_SIGNAL if None in values.values() else GOOD

    def invalidate(self) -> None:
        """Nothing received so far counts any more."""
        super().invalidate()
        self.values.clear()


class SwaySignal:
    """What one axis reads of it.

    Args:
        message: the message.
        bound: sway sensor of the axis.
    """

    def __init__(self, message: SwaySensorInput, bound: BoundSwaySensor) -> None:
        self.bound = bound
        self._message = message
        self._name, self._factor = bound.signal.name, bound.factor
        self._number = message.number

    def take(self) -> float | None:
        """A measurement that is new, rad or rad/s with the sign of the model; None without one."""
        message = self._message
        if message.number == self._number:
            return None
        self._number = message.number
        value = message.values.get(self._name)
        return None if value is None else value * self._factor
