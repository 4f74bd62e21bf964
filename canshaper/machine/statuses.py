"""Status messages of a deployment, bound to the DBC."""

from typing import TypeVar

from canshaper.codec.codecs import AxisStatusCodec, IdentityCodec, ServiceStatusCodec
from canshaper.codec.signals import status_faults
from canshaper.config.schema import Status
from canshaper.config.source import Place
from canshaper.machine.lookup import Lookup
from canshaper.machine.protections import bind_protection

Codec = TypeVar("Codec", AxisStatusCodec, IdentityCodec, ServiceStatusCodec)


def bind_status(
    lookup: Lookup, place: Place, status: Status | None, codec: type[Codec]
) -> tuple[Codec | None, int]:
    """A status message, and the ticks between two of them; (None, 0) where there is none."""
    if status is None:
        return None, 0
    used = lookup.message(place, status.bus, status.message, received=False)
    if not used:
        return None, 0
    for fault in status_faults(used.message, codec.SIGNALS, codec.CODES):
        used.add_fault(fault)
    used.uses.update(dict.fromkeys(codec.SIGNALS, "a signal of the status"))
    protection = bind_protection(used, status)
    return codec(lookup.sender(status.bus, used.message, protection)), lookup.period(used)
