"""The clock of the control loop."""

import time
from collections.abc import Callable
from functools import partial

# Time since the machine was booted, ns. No one can set it, and unlike CLOCK_MONOTONIC it goes on
# while the machine is suspended: an age, and a standstill of the loop, includes that time. Other
# systems than Linux only simulate a machine, and there any clock that runs forward serves.
boottime_ns: Callable[[], int] = (
    partial(time.clock_gettime_ns, time.CLOCK_BOOTTIME)
    if hasattr(time, "CLOCK_BOOTTIME")
    else time.monotonic_ns
)
