"""The input of a measured radius by itself."""

from canshaper.codec.frame import FrameFault
from canshaper.config.crane import Radius
from canshaper.inputs.value import PositionInput
from canshaper.machine.inputs import BoundValue


class RadiusInput:
    """A message with a radius, and that radius."""

    def __init__(self, bound: BoundValue[Radius]) -> None:
        self._message = PositionInput(bound)
        self._value = self._message.read(bound)
        self.fresh, self.invalidate = self._value.fresh, self._message.invalidate

    def receive(self, data: bytes, arrived_ns: int) -> FrameFault:
        return self._message.receive(data, arrived_ns)
