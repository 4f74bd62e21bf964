"""Processes that end with the process that started them, however that ends."""

import ctypes
import os
import signal
import sys

PR_SET_PDEATHSIG = 1  # linux/prctl.h

_CODE = f"""
import os, signal, sys
from {__name__} import end_with_parent
end_with_parent(signal.SIGTERM)
if os.getppid() != int(sys.argv.pop(1)):
    sys.exit(1)
from canshaper.__main__ import main
main()
"""


def end_with_parent(how: signal.Signals) -> None:
    """Have the kernel send this process a signal when its parent ends (prctl(2)).

    A parent that ended before the call is not seen: the caller looks for it afterwards.
    Only Linux has it; elsewhere nothing is done.

    Args:
        how: the signal.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, how)


def canshaper_command(*words: str) -> list[str]:
    """Command line of ``canshaper`` as a child of this process.

    It gets SIGTERM when this process ends without ending it: a daemon leaves the valves neutral.

    Args:
        words: the verb, its arguments and options.
    """
    return [sys.executable, "-c", _CODE, str(os.getpid()), *words]
