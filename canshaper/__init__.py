"""canshaper: sensor-less anti-sway for hydraulic cranes, between joystick and valves on CAN.

What stands in ``__all__`` is for other programs; everything else may change. Nothing of it is
imported before it is used. Programs of ten to forty lines that use it stand in ``examples/``.

Drive a machine without buses:

>>> from canshaper import Controller, Frame, load_machine
>>> controller = Controller(load_machine("forwarder.yaml"))
>>> controller.receive(Frame("crane", 0x110, False, bytes(8)), arrived_ns=0)
>>> for frame in controller.tick(now_ns=20_000_000)[:1]:
...     print(frame.bus, hex(frame.can_id), frame.data.hex())
crane 0x200 0001

Everything that it raises for a person derives from ``canshaper.errors.CanshaperError``:

>>> from canshaper import errors
>>> try:
...     load_machine("no-such-file.yaml")
... except errors.ConfigError as error:
...     print(error)
no-such-file.yaml: No such file or directory
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from canshaper import errors
    from canshaper.api import AxisState, Controller, load_machine
    from canshaper.checksums.algorithms import Crc8, Xor
    from canshaper.checksums.kinds import Checksum, ChecksumKind
    from canshaper.codec.frame import Frame
    from canshaper.controller.events import (
        FeedbackEvent,
        MotionEvent,
        RefusalEvent,
        StateEvent,
        SwaySensorEvent,
        SwingLengthEvent,
    )
    from canshaper.machine.deployment import Deployment
    from canshaper.protocols.interface import Event
    from canshaper.shaping.registry import build_shaper
    from canshaper.shaping.shapers.fir import Fir
    from canshaper.shaping.shapers.kind import Parameter, Shaper, ShaperKind
    from canshaper.shaping.states import Reason, State
    from canshaper.shaping.sway import SwayMode, SwayModel

__version__: str

__all__ = [
    "AxisState",
    "Checksum",
    "ChecksumKind",
    "Controller",
    "Crc8",
    "Deployment",
    "Event",
    "FeedbackEvent",
    "Fir",
    "Frame",
    "MotionEvent",
    "Parameter",
    "Reason",
    "RefusalEvent",
    "Shaper",
    "ShaperKind",
    "State",
    "StateEvent",
    "SwayMode",
    "SwayModel",
    "SwaySensorEvent",
    "SwingLengthEvent",
    "Xor",
    "build_shaper",
    "errors",
    "load_machine",
]

_HOMES = {
    "api": ("AxisState", "Controller", "load_machine"),
    "checksums.algorithms": ("Crc8", "Xor"),
    "checksums.kinds": ("Checksum", "ChecksumKind"),
    "codec.frame": ("Frame",),
    "controller.events": (
        "FeedbackEvent",
        "MotionEvent",
        "RefusalEvent",
        "StateEvent",
        "SwaySensorEvent",
        "SwingLengthEvent",
    ),
    "machine.deployment": ("Deployment",),
    "protocols.interface": ("Event",),
    "shaping.registry": ("build_shaper",),
    "shaping.shapers.fir": ("Fir",),
    "shaping.shapers.kind": ("Parameter", "Shaper", "ShaperKind"),
    "shaping.states": ("Reason", "State"),
    "shaping.sway": ("SwayMode", "SwayModel"),
}


def __getattr__(name: str) -> object:
    """Load what is used when it is (PEP 562)."""
    if name == "__version__":
        return import_module("canshaper.shipped").version()
    if name == "errors":
        return import_module("canshaper.errors")
    for home, names in _HOMES.items():
        if name in names:
            value: object = getattr(import_module(f"canshaper.{home}"), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
