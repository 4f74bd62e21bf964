"""What an adapter of python-can does not report, and what that costs."""

from collections.abc import Iterator

from canshaper.bus.apart import LOOK_S
from canshaper.bus.python_can import NEVER_BLOCK
from canshaper.commissioning.doctor.finding import Finding, Level
from canshaper.config.bus import Bus

# Interfaces that hand out the error frames of their controller (python-can 4.6; by its source).
ERROR_FRAMES = frozenset(("etas", "gs_usb", "ixxat", "kvaser", "neovi", "nican", "nixnet", "pcan"))
ERROR_FRAMES |= {"serial", "socketcand", "usb2can", "vector"}


def adapter_findings(name: str, bus: Bus, tick_ms: int) -> Iterator[Finding]:
    """One finding for each thing that SocketCAN reports and this interface may not.

    Args:
        name: of the bus in the deployment file.
        bus: its section.
        tick_ms: period of the loop.
    """
    subject = f"bus {name} {bus.interface}"
    yield Finding(
        subject, Level.NOTE, f"python-can on {bus.channel}: cannot be checked without opening it"
    )
    older_ms = tick_ms if bus.interface in NEVER_BLOCK else LOOK_S * 1000
    yield Finding(
        f"{subject} time stamps",
        Level.NOTE,
        f"none that can be trusted: a frame counts as up to {older_ms:g} ms older than it is",
        f"give the timeout_ms of inputs {older_ms:g} ms more",
    )
    if bus.interface in ERROR_FRAMES:
        yield Finding(f"{subject} error frames", Level.OK, "handed out, and counted")
    else:
        text = "none: a disturbed bus is noticed when the frames of the joysticks stay away"
        yield Finding(f"{subject} error frames", Level.NOTE, text)
    yield Finding(
        f"{subject} send confirmation",
        Level.WARNING,
        "none: a frame that no node acknowledges counts as sent, so a cut line to a valve trips no"
        " axis",
        "an interface of SocketCAN (for slcan: slcand), or feedback of the valve",
    )
