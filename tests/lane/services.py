"""``python -m tests.lane.services [pytest arguments]``: the tests of tests/systemd under systemd.

They run in a machine whose PID 1 is a real systemd, with the Debian packages that they install
there, built here before. Ends with pytest's status; where no such machine can be had, it says why
and ends with 77.
"""

import os
import subprocess
import sys
from collections.abc import Sequence

from tests.systemd.packages import build

from . import cli, suite
from .outcome import LANE_FAILED, say

FOLDER = "tests/systemd"
OPTIONS = ["--systemd", "--steady"]


def main(arguments: Sequence[str]) -> int:
    """Run pytest on tests/systemd, or on the paths among ``arguments``."""
    status = cli.main(["--prepare", *OPTIONS])
    if status:
        return status
    try:
        os.environ.update(build())
    except subprocess.CalledProcessError as error:
        say(f"building the packages failed: {error}")
        return LANE_FAILED
    return suite.run(FOLDER, arguments, OPTIONS)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
