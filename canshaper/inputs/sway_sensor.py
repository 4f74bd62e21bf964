"""Measurements of sway: their message, and the signal that each axis reads from it."""

import math
from typing import Protocol

from canshaper.codec.frame import FrameFault
from canshaper.inputs.input import GOOD, Input, Raw
from canshaper.inputs.value import MeasuredSignal, measurable
from canshaper.machine.sway_sensor import BoundSwaySensor, SensorMessage

GOOD_MERIT = 0
"""Figure of merit of SSI: within the specification of the sensor. 1 is degraded, 2 an error."""
# Largest measurement that counts, rad or rad/s: no grapple swings by a whole turn, nor with one a
# second. A signal without a range may carry more, and the observer would remember it for hours.
MOST = 2.0 * math.pi


class SwaySensorInput(Input):
    """A message with measurements for one axis or several.

    Attributes:
        number: number of accepted frames so far.
        values: values of the last one by signal, in the unit of the DBC; None for a code without
            a value.
    """

    def __init__(self, bound: SensorMessage) -> None:
        super().__init__(bound)
        self._signals = [MeasuredSignal(signal, *measurable(signal)) for signal in bound.signals]
        self._merits = bound.merits
        self.number = 0
        self.values: dict[str, float | None] = {}

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Take an accepted frame's values; in any frame an error code or a bad merit is a fault."""
        values = {one.name: self._value(one, raw) for one in self._signals}
        if accepted:
            self.number += 1
            self.values = values
        return FrameFault.INVALID_SIGNAL if None in values.values() else GOOD

    def _value(self, signal: MeasuredSignal, raw: Raw) -> float | None:
        """Return the value of a signal; None without one, or where its figure of merit is bad."""
        merit = self._merits.get(signal.name)
        return None if merit and raw[merit] != GOOD_MERIT else signal.value(raw)

    def invalidate(self) -> None:
        """Invalidate everything received so far."""
        super().invalidate()
        self.values.clear()


class SensorNode(Protocol):
    """Node that sends the measurements of a sensor."""

    @property
    def works(self) -> bool:
        """Whether the node works, so that its measurements count."""


class SwaySignal:
    """Signal of a sway sensor, as one axis reads it.

    Args:
        message: input of its message.
        bound: sway sensor of the axis.

    Attributes:
        node: node of the sensor, or None where it is not known.
    """

    def __init__(self, message: SwaySensorInput, bound: BoundSwaySensor) -> None:
        self.node: SensorNode | None = None
        self._message = message
        self._name, self._factor = bound.signal.name, bound.factor
        self._number = message.number

    def new_value(self) -> float | None:
        """Return a new measurement, rad or rad/s with the sign of the model; None without one.

        It is None too while the node does not work, and above ``MOST``.
        """
        message = self._message
        if message.number == self._number:
            return None
        self._number = message.number
        value, node = message.values.get(self._name), self.node
        if value is None or not (node is None or node.works):
            return None
        measured = value * self._factor
        return measured if abs(measured) <= MOST else None
