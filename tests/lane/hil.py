"""``python -m tests.lane.hil [--steady] [pytest arguments]``: tests/hil where SocketCAN exists.

With --steady in a machine that has its own time: tests that measure time hold there whatever else
runs. Ends with pytest's status; where no lane can be had, it says why and
ends with 77.
"""

import sys
from collections.abc import Sequence

from . import suite

STEADY = "--steady"


def main(arguments: Sequence[str]) -> int:
    """Run pytest on tests/hil, or on the paths among ``arguments``."""
    rest = [word for word in arguments if word != STEADY]
    return suite.run("tests/hil", rest, [STEADY] if STEADY in arguments else ())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
