"""Machines whose joysticks can be protected."""

import pytest

from tests.machine.protected_joystick import SIGNALS
from tests.rigs.files import Machine


@pytest.fixture
def protected(machine: Machine) -> Machine:
    """The shipped machine with room for a checksum in the left joystick."""
    last = ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n'
    machine.in_dbc(last, last + SIGNALS)
    return machine
