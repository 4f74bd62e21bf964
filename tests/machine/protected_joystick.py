"""A joystick with signals for its protection."""

from tests.rigs.files import Machine

COUNTER = "alive_counter: AliveCounter"
# Signals that the tests add to the left joystick, in bytes that it does not use.
SIGNALS = """ SG_ Check : 48|8@1+ (1,0) [0|255] "" SHAPER
 SG_ Half : 40|4@1+ (1,0) [0|15] "" SHAPER
 SG_ Count2 : 44|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Count1 : 46|1@1+ (1,0) [0|1] "" SHAPER
"""


def joystick(machine: Machine, *lines: str) -> int:
    """Add lines to the left joystick; the number of the first of them."""
    return machine.in_yaml(COUNTER, "\n    ".join((COUNTER, *lines))) + 1
