"""Measured radius of the tip."""

from canshaper.config.limits import Radius
from canshaper.inputs.value import ValueInput
from canshaper.machine.inputs import BoundValue


def radius_input(bound: BoundValue[Radius]) -> ValueInput:
    """A radius that comes in frames; what lies outside its DBC range is none."""
    low, high = bound.signal.minimum, bound.signal.maximum
    assert low is not None and high is not None
    return ValueInput(bound, bound.signal, low, high)
