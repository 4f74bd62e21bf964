"""A command in a process of its own: how it ends, what it says, what it takes."""

import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.hostile.inputs import ROOT, Make

LIMIT_S = 120.0  # only to end one that hangs; benchmarks/hostile.py says how long they take


@dataclass(frozen=True)
class Ran:
    """Exit code and output of a command.

    Attributes:
        code: exit code.
        text: standard output and error.
        peak_mb: most memory, MB.
        seconds: from its start to its end.
    """

    code: int
    text: str
    peak_mb: int
    seconds: float


def run(make: Make) -> Ran:
    """Make the files and run the command.

    Raises:
        subprocess.TimeoutExpired: it hangs.
    """
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "tests.hostile.measured", *make(Path(folder))]
        begin = time.monotonic()
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
        seconds = time.monotonic() - begin
    *error, peak = done.stderr.splitlines()
    return Ran(done.returncode, "\n".join([done.stdout, *error]).strip(), int(peak), seconds)
