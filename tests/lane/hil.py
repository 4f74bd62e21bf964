"""``python -m tests.lane.hil [pytest arguments]``: the tests of tests/hil where SocketCAN exists.

Ends with pytest's status; where no lane can be had, it says why and ends with 0.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from . import cli
from .outcome import NO_LANE, say

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT_S = 900  # for all tests together, on an emulated processor
KVASER = 4  # two buses: joystick and valves apart


def main(arguments: Sequence[str]) -> int:
    """Run pytest on tests/hil, or on the paths among ``arguments``."""
    os.chdir(ROOT)
    given = any(Path(word.partition("::")[0]).exists() for word in arguments)
    pytest = [sys.executable, "-m", "pytest", *([] if given else ["tests/hil"])]
    pytest += ["-p", "no:cacheprovider", *arguments]
    status = cli.main(["--timeout", str(TIMEOUT_S), "--kvaser", str(KVASER), "--", *pytest])
    if status == NO_LANE:
        say("tests/hil NOT run, for the reason above")
        return 0
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
