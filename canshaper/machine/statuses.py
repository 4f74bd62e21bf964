"""Status messages of a deployment, bound to the DBC."""

from collections.abc import Sequence

from canshaper.codec.status import Source, StatusCodec, StatusField, status_faults
from canshaper.config.schema import Status
from canshaper.config.source import Place
from canshaper.machine.lookup import Lookup
from canshaper.machine.protections import bind_protection


def bind_status(
    lookup: Lookup, place: Place, status: Status | None, fields: Sequence[StatusField[Source]]
) -> tuple[StatusCodec[Source] | None, int]:
    """A status message, and the ticks between two of them; (None, 0) where there is none."""
    if status is None:
        return None, 0
    used = lookup.message(place, status, received=False)
    if not used:
        return None, 0
    for fault in status_faults(used.message, fields):
        used.add_fault(fault)
    used.uses.update(dict.fromkeys((one.name for one in fields), "a signal of the status"))
    protection = bind_protection(used, status)
    message = lookup.sent(status.bus, used.message, protection)
    return StatusCodec(message, fields), lookup.period(used)
