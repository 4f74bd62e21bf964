"""A loop that only sleeps until its next deadline, and writes how late it was each time, ns.

sleeper.py PERIOD_NS COUNT
"""

import sys
import time

period, count = int(sys.argv[1]), int(sys.argv[2])
late = [0] * count
deadline = time.monotonic_ns()
for i in range(count):
    deadline += period
    time.sleep(max(0, deadline - time.monotonic_ns()) / 1e9)
    late[i] = time.monotonic_ns() - deadline
print(*late, sep="\n", flush=True)
