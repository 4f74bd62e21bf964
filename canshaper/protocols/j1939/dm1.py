"""Active faults for the other nodes of a J1939 bus: DM1 of SAE J1939-73.

One fault fits into one frame; several are sent by the broadcast (BAM) of SAE J1939-21.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Self

from canshaper.codec.frame import (
    DEFAULT_PRIORITY,
    DM1,
    LOWEST_PRIORITY,
    TRANSPORT,
    TRANSPORT_DATA,
    Frame,
    identifier,
)
from canshaper.inputs.value import Following
from canshaper.shaping.reasons import REASON_TEXTS

CYCLE_NS = 1_000_000_000
# A change is sent at once, but changes no more often than this.
LEAST_BETWEEN_NS = 200_000_000
# SAE J1939-21: 50 to 200 ms between the packets of a broadcast.
PACKET_NS = 50_000_000
BROADCAST = 32
AMBER_LAMP = 0x04
NO_LAMP_FLASHES = 0xFF

# Failure mode identifiers of SAE J1939-73.
NOT_RESPONDING, ABNORMAL_RATE = 7, 9
FMI_OF = {reason: text.fmi for reason, text in REASON_TEXTS.items() if text.fmi is not None}
"""Failure mode of an axis by its reason; reasons that the operator causes are no faults."""

FMI_OF_FOLLOWING = {Following.NO: NOT_RESPONDING, Following.LOST: ABNORMAL_RATE}
"""Failure mode of a valve by the result of its feedback check."""


class Fault(NamedTuple):
    """A diagnostic trouble code.

    Attributes:
        spn: suspect parameter number.
        fmi: failure mode identifier.
        times: how often the fault occurred; sent as 126 at most.
    """

    spn: int
    fmi: int
    times: int


def dm1_data(faults: Sequence[Fault]) -> bytes:
    """Return the content of DM1: two bytes of lamps, four for each fault; four zeros for none."""
    lamps = bytes((AMBER_LAMP if faults else 0, NO_LAMP_FLASHES))
    codes = (
        (f.spn & 0xFFFF).to_bytes(2, "little")
        + bytes((f.spn >> 16 << 5 | f.fmi, min(f.times, 126)))
        for f in faults
    )
    return lamps + (b"".join(codes) or bytes(4))


class ActiveFaults:
    """Sends DM1 every second, on request, and on a change, one in ``LEAST_BETWEEN_NS`` at most."""

    def __init__(self, bus: str, address: int) -> None:
        self._bus = bus
        self._address = address
        self._active: set[tuple[int, int]] = set()
        self._sent: set[tuple[int, int]] = set()
        self._count: dict[tuple[int, int], int] = {}
        self._next_ns = 0
        self._change_ns = 0
        self._packets: list[bytes] = []
        self._packet_ns = 0

    def copy_state(self, before: Self) -> None:
        """Continue with the faults of ``before``: their counts, and a broadcast under way."""
        self._active, self._sent = set(before._active), set(before._sent)
        self._count, self._packets = dict(before._count), list(before._packets)
        self._next_ns, self._change_ns = before._next_ns, before._change_ns
        self._packet_ns = before._packet_ns

    def frames(
        self, active: Sequence[tuple[int, int]], now_ns: int, *, requested: bool = False
    ) -> Iterator[Frame]:
        """Yield the frames due now.

        Args:
            active: (SPN, FMI) of every present fault.
            now_ns: time of the tick.
            requested: whether another node has requested DM1.
        """
        now = set(active)
        for code in now - self._active:
            self._count[code] = self._count.get(code, 0) + 1
        self._active = now
        changed = now != self._sent and now_ns >= self._change_ns
        if not self._packets and (requested or changed or now_ns >= self._next_ns):
            self._sent = now
            self._next_ns = now_ns + CYCLE_NS
            self._change_ns = now_ns + LEAST_BETWEEN_NS
            data = dm1_data([Fault(*code, self._count[code]) for code in active])
            if len(data) <= 8:
                yield self._frame(DM1, data.ljust(8, b"\xff"))
            else:
                parts = [data[i : i + 7].ljust(7, b"\xff") for i in range(0, len(data), 7)]
                self._packets = [bytes((n, *part)) for n, part in enumerate(parts, 1)]
                self._packet_ns = now_ns + PACKET_NS
                head = bytes((BROADCAST,)) + len(data).to_bytes(2, "little")
                tail = bytes((len(parts), 0xFF)) + DM1.to_bytes(3, "little")
                yield self._frame(TRANSPORT, head + tail, LOWEST_PRIORITY)
        elif self._packets and now_ns >= self._packet_ns:
            self._packet_ns = now_ns + PACKET_NS
            yield self._frame(TRANSPORT_DATA, self._packets.pop(0), LOWEST_PRIORITY)

    def interrupt(self) -> None:
        """Drop a broadcast under way, because nothing may be sent now."""
        self._packets.clear()
        self._next_ns = 0

    def _frame(self, pgn: int, data: bytes, priority: int = DEFAULT_PRIORITY) -> Frame:
        return Frame(self._bus, identifier(pgn, self._address, priority=priority), True, data)
