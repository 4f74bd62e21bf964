"""Runs the tests of one directory in a lane: what hil and services have in common."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from . import cli

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT_S = 3600  # for all tests together, on an emulated processor that shares its core
KVASER = 4  # two buses: joystick and valves apart


def run(folder: str, arguments: Sequence[str], options: Sequence[str] = ()) -> int:
    """Run pytest on ``folder``, or on the paths among ``arguments``, in a lane with ``options``.

    Return pytest's status; NO_LANE where no lane can be had.
    """
    os.chdir(ROOT)
    given = any(Path(word.partition("::")[0]).exists() for word in arguments)
    pytest = [sys.executable, "-m", "pytest", *([] if given else [folder])]
    pytest += ["-p", "no:cacheprovider", *arguments]
    limits = ["--timeout", str(TIMEOUT_S), "--kvaser", str(KVASER)]
    return cli.main([*limits, *options, "--", *pytest])
