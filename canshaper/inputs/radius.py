"""Measured radius of the tip."""

from canshaper.codec.signals import find_signal
from canshaper.config.motion import Radius
from canshaper.inputs.value import ValueInput
from canshaper.machine.inputs import Bound


def radius_input(bound: Bound[Radius]) -> ValueInput:
    """A radius that comes in frames; what lies outside its DBC range is none."""
    signal = find_signal(bound.message, bound.config.signal)
    # All checked with the deployment.
    assert signal is not None
    assert signal.minimum is not None
    assert signal.maximum is not None
    return ValueInput(bound, signal.name, signal.minimum, signal.maximum)
