"""A loop that only sleeps until its next deadline; prints each and how late it was, ns.

sleeper.py PERIOD_NS COUNT
"""

import sys
import time

period, count = int(sys.argv[1]), int(sys.argv[2])
late = [0] * count
begin = deadline = time.monotonic_ns()
for i in range(count):
    deadline += period
    time.sleep(max(0, deadline - time.monotonic_ns()) / 1e9)
    late[i] = time.monotonic_ns() - deadline
for i in range(count):
    print(begin + (i + 1) * period, late[i])
