"""Files that others may have written: read with a limit, and regular ones only."""

import errno
import os
import stat
from pathlib import Path


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """Content of a file.

    Raises:
        OSError: it cannot be read, is a device, a pipe or a directory, or has more bytes.
    """
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # no one need write to a pipe
    try:
        mode = os.fstat(number).st_mode
        if stat.S_ISDIR(mode):
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            text = "expected a regular file, got a device or a pipe"
            raise OSError(errno.EINVAL, text, str(path))
        with os.fdopen(number, "rb", closefd=False) as file:
            data = file.read(most_bytes + 1)
    finally:
        os.close(number)
    if len(data) > most_bytes:
        text = f"expected {most_bytes} bytes at most, got more"
        raise OSError(errno.EFBIG, text, str(path))
    return data
