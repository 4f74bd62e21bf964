"""Exit statuses of a lane and the errors that lead to them."""

import sys

TIME_LIMIT = 124  # as timeout(1)
LANE_FAILED = 125  # as env(1), timeout(1): the runner itself failed, not the command
NO_LANE = 77  # as in automake's test protocol: skipped
OUTPUT_CLOSED = 141  # 128 + SIGPIPE, what a command in a shell pipeline would give


class LaneError(Exception):
    """The lane failed; ``log`` holds what the machine said before."""

    status = LANE_FAILED

    def __init__(self, reason: str, log: str = "") -> None:
        super().__init__(reason)
        self.log = log


class NoLane(LaneError):
    """This machine cannot have the lane; the message says why and what to install."""

    status = NO_LANE


def say(*words: object) -> None:
    """Print a message of the lane itself, apart from the command's output."""
    print("lane:", *words, file=sys.stderr, flush=True)
