"""Whether a log is of a simulated crane."""

from ipaddress import ip_address
from itertools import islice
from pathlib import Path

from canshaper.commissioning.identification.table import is_table
from canshaper.errors import CutOffError
from canshaper.machine.database import Messages
from canshaper.recording.log import read_log

# Of the simulated crane alone: no sensor of a machine reports the swing in both directions.
_OWN = "GrappleSway"
# So many frames hold every message of a bus; the simulated crane sends its own every 20 ms.
_FRAMES = 5000


def is_simulated(log: Path, messages: Messages) -> bool:
    """Whether a log was recorded on a virtual bus, or has what only the simulated crane sends.

    Args:
        log: a CAN log, or a table: that is of a machine.
        messages: of the DBC files.

    Raises:
        LogError: the log cannot be read.
    """
    if is_table(log):
        return False
    message = messages.find(_OWN)
    own = None if isinstance(message, str) else (message[1].frame_id, message[1].is_extended_frame)
    try:
        return any(
            (frame.can_id, frame.extended) == own or _is_virtual(frame.channel)
            for frame in islice(read_log(log), _FRAMES)
        )
    except CutOffError:
        return False


def _is_virtual(channel: str) -> bool:
    """Whether a channel of a log is one of vcan, or the address of a bus over UDP."""
    if channel.startswith(("vcan", "vxcan")):
        return True
    try:
        ip_address(channel)
    except ValueError:
        return False
    return True
