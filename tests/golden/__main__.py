"""Rewrite the golden logs and say what has changed: python -m tests.golden [record]."""

import sys

from tests.golden.record import record
from tests.golden.replay import DEPLOYMENTS, DRIVE, difference, golden, margin, read, replay, write


def main(arguments: list[str]) -> int:
    """Replay the drive, with ``record`` after recording it again."""
    if arguments not in ([], ["record"]):
        print(__doc__, file=sys.stderr)
        return 2
    if arguments:
        drive = record()
        print(f"{DRIVE.name}: {difference(read(DRIVE), drive) or 'as it was'}")
        write(DRIVE, drive)
    drive = read(DRIVE)
    for name in DEPLOYMENTS:
        with margin() as nearest:
            sent = replay(name, drive)
        print(f"{name}.log: {difference(read(golden(name)), sent) or 'as it was'}")
        print(
            f"  nearest to a rounding edge: {nearest.least:.2g} steps ({nearest.of}),"
            f" {nearest.exact} exactly on one"
        )
        write(golden(name), sent)
    return 0


sys.exit(main(sys.argv[1:]))
