"""The clock of the control loop."""

import time
from functools import partial

# Time since the machine was booted, ns. No one can set it, and unlike CLOCK_MONOTONIC it goes on
# while the machine is suspended: an age, and a standstill of the loop, includes that time.
boottime_ns = partial(time.clock_gettime_ns, time.CLOCK_BOOTTIME)
