"""``python -m tests.hostile.measured ARGUMENTS``: canshaper, and how much memory it took.

The last line on standard error is in MB. Asked from outside, that of who started it counts too.
"""

import re
import sys
from pathlib import Path

from canshaper.cli.app import main

if __name__ == "__main__":
    try:
        main()
    finally:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        peak = re.search(r"VmHWM:\s+(\d+) kB", status)
        assert peak
        print(f"{int(peak[1]) / 1024:.0f}", file=sys.stderr)
