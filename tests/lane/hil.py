"""``python -m tests.lane.hil [pytest arguments]``: the tests of tests/hil where SocketCAN exists.

Ends with pytest's status; where no lane can be had, it says why and ends with 0.
"""

import sys
from collections.abc import Sequence

from . import suite


def main(arguments: Sequence[str]) -> int:
    """Run pytest on tests/hil, or on the paths among ``arguments``."""
    return suite.run("tests/hil", arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
