"""Our address on a bus of J1939: claiming it, defending it, being silent when it is lost.

SAE J1939-81, for a node that cannot take another address: it claims its address, waits, and begins
to send; the lower NAME wins. A node that has lost says so once, and sends nothing more.
"""

from collections.abc import Iterator, Sequence
from enum import Enum
from typing import Self

from canshaper.codec.frame import (
    ACKNOWLEDGE,
    CLAIMED,
    DM1,
    GLOBAL,
    NULL,
    REQUEST,
    Frame,
    FrameFault,
    group_of,
    identifier,
    name_bytes,
)
from canshaper.config.bus import J1939
from canshaper.protocols.j1939.dm1 import ActiveFaults
from canshaper.shaping.states import Reason

# Time for others to object before anything else is sent.
WAIT_NS = 250_000_000
# A node that cannot claim waits 0 to 153 ms, so that not all answer at once: here by serial number.
STEP_NS = 600_000
# Least time between two claims: two nodes with one address must not fill the bus with answers.
LEAST_BETWEEN_NS = 5_000_000
# Most refusals in one tick; further requests get no answer, as on a full bus.
MOST_REFUSED = 8


class ClaimState(Enum):
    """State of our address."""

    WAITING = "waiting"
    CLAIMED = "claimed"
    LOST = "lost"


class AddressClaim:
    """Our address on one bus.

    Args:
        bus: name of the bus.
        config: address and NAME.
        answered: groups (PGN) that other parts of ours send on request.
        cyclic: groups (PGN) that we send anyway; no request for one of them is refused.
        guest: whether the address may belong to another node: we ask first, claim it only if no
            one answers, give it up to any node that claims it, whatever its NAME, and refuse
            nothing.

    Attributes:
        state: state of our address; unless it is CLAIMED, we may send only what ``frames`` yields.
        requested: groups among ``answered`` that were requested since the owner emptied the set.
    """

    def __init__(
        self,
        bus: str,
        config: J1939,
        answered: frozenset[int] = frozenset(),
        cyclic: frozenset[int] = frozenset(),
        *,
        guest: bool = False,
    ) -> None:
        self.state = ClaimState.WAITING
        self.requested: set[int] = set()
        self._bus = bus
        self._address = config.address
        self._name = name_bytes(config.name)
        self._number = int.from_bytes(self._name, "little")
        self._answered = answered
        self._cyclic = cyclic
        self._guest = guest
        self._requesting = False  # we ask which node has the address, and do not claim meanwhile
        self._request_first = guest
        self._delay_ns = config.name.identity_number % 256 * STEP_NS
        self._due_ns: int | None = 0  # when to send a claim, or that there is none
        self._until_ns: int | None = None
        self._again_ns = 0  # not before then another claim
        self._refused: list[tuple[int, int]] = []

    @property
    def sends(self) -> bool:
        """Return whether messages may be sent under our address."""
        return self.state is ClaimState.CLAIMED

    def copy_state(self, before: Self) -> None:
        """Continue the claim of the same address and NAME; a lost address is claimed afresh."""
        if before.state is ClaimState.LOST:
            return
        self.state, self.requested = before.state, set(before.requested)
        self._requesting, self._request_first = before._requesting, before._request_first
        self._due_ns, self._until_ns = before._due_ns, before._until_ns
        self._again_ns, self._refused = before._again_ns, list(before._refused)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Receive a claim or a request of another node; the caller drops echoes of our own."""
        destination, source = frame.can_id >> 8 & 0xFF, frame.can_id & 0xFF
        group, lost = group_of(frame.can_id), self.state is ClaimState.LOST
        if group == CLAIMED << 8 and len(frame.data) == 8:
            if source == self._address and not lost:
                self._contended(int.from_bytes(frame.data, "little"), now_ns)
        elif (
            group == REQUEST << 8
            and len(frame.data) == 3
            # A lost address belongs to another node, which answers requests to it.
            and (destination == GLOBAL or (destination == self._address and not lost))
        ):
            pgn = int.from_bytes(frame.data, "little")
            self._on_request(pgn, source, now_ns, by_name=destination != GLOBAL)

    def _contended(self, other: int, now_ns: int) -> None:
        if other > self._number and not self._guest:
            self._claim_at(now_ns)
            return
        # An equal NAME loses too: two nodes set up alike cannot agree which of them keeps it.
        self.state = ClaimState.LOST
        self._refused.clear()
        self._due_ns = now_ns + self._delay_ns

    def _on_request(self, pgn: int, source: int, now_ns: int, *, by_name: bool) -> None:
        if pgn == CLAIMED:
            lost = self.state is ClaimState.LOST
            self._claim_at(now_ns + (self._delay_ns if lost else 0))
        elif pgn in self._answered:
            self.requested.add(pgn)
        elif (
            by_name
            and self.sends
            and not self._guest
            and pgn not in self._cyclic
            and source < NULL
            and len(self._refused) < MOST_REFUSED
        ):
            self._refused.append((pgn, source))

    def _claim_at(self, time_ns: int) -> None:
        """Schedule a claim, unless we ask first; a claim that is due earlier stays due."""
        if self._requesting:
            return
        time_ns = max(time_ns, self._again_ns)
        self._due_ns = time_ns if self._due_ns is None else min(time_ns, self._due_ns)

    def frames(self, now_ns: int) -> Iterator[Frame]:
        """Yield the frames due now: claims, a guest's request for the address, and refusals."""
        if self._due_ns is not None and now_ns >= self._due_ns:
            lost = self.state is ClaimState.LOST
            if self._request_first and not lost:
                self._request_first, self._requesting, self._due_ns = False, True, now_ns + WAIT_NS
                data = CLAIMED.to_bytes(3, "little")
                yield Frame(self._bus, identifier(REQUEST, NULL), True, data)
                return
            self._requesting, self._due_ns = False, None
            self._again_ns = now_ns + LEAST_BETWEEN_NS
            if self._until_ns is None:
                self._until_ns = now_ns + WAIT_NS
            can_id = identifier(CLAIMED, NULL if lost else self._address)
            yield Frame(self._bus, can_id, True, self._name)
        elif (
            self.state is ClaimState.WAITING
            and self._until_ns is not None
            and now_ns >= self._until_ns
        ):
            self.state = ClaimState.CLAIMED
        for pgn, source in self._refused:
            data = bytes((1, 0xFF, 0xFF, 0xFF, source)) + pgn.to_bytes(3, "little")
            can_id = identifier(ACKNOWLEDGE, self._address)
            yield Frame(self._bus, can_id, True, data)
        self._refused.clear()

    def repeat(self) -> None:
        """Claim once more after a frame did not reach the bus, unless the address is lost."""
        if self.state is not ClaimState.LOST:
            self._claim_at(self._again_ns)

    def not_sent(self) -> None:
        """Claim again, because the last claim did not reach the bus; the wait starts again too."""
        self.restart()
        self._claim_at(self._again_ns)

    def restart(self) -> None:
        """Claim and wait as at the start; a lost address stays lost."""
        if self.state is not ClaimState.LOST:
            self.state = ClaimState.WAITING
            self._until_ns = None
            self._refused.clear()
            self._request_first, self._requesting = self._guest, False
            self._claim_at(self._again_ns)


class Node:
    """Our J1939 node on one bus: its address claim and its active faults (DM1).

    Args:
        bus: name of the bus.
        config: address and NAME.
        cyclic: groups (PGN) that we send anyway; no request for one of them is refused.
        guest: whether the address may belong to another node; then no fault is sent.

    Attributes:
        state: state of our address.
        faults: sends our active faults.
    """

    def __init__(
        self, bus: str, config: J1939, cyclic: frozenset[int] = frozenset(), *, guest: bool = False
    ) -> None:
        answered = frozenset(() if guest else (DM1,))
        self._claim = AddressClaim(bus, config, answered, cyclic, guest=guest)
        self._guest = guest
        self.faults = ActiveFaults(bus, config.address)

    @property
    def state(self) -> ClaimState:
        """State of our address; unless it is CLAIMED, only the node itself may send."""
        return self._claim.state

    def gate(self, neutral: bool, _now_ns: int) -> Reason | None:
        """Return why no axis may move while our address is not claimed, or None.

        Without an address we are silent, and silence is no shaped stop: an axis in motion trips.
        """
        if self._claim.state is ClaimState.LOST:
            return Reason.ADDRESS_LOST
        if self._claim.state is ClaimState.WAITING:
            return Reason.ADDRESS_NOT_CLAIMED if neutral else Reason.SEND_FAILED
        return None

    def receive(self, frame: Frame, arrived_ns: int) -> FrameFault:
        """Receive a claim or a request; return a fault when another claim wins over ours."""
        before = self._claim.state
        self._claim.receive(frame, arrived_ns)
        lost = self._claim.state is ClaimState.LOST and before is not ClaimState.LOST
        return FrameFault.ADDRESS_LOST if lost else FrameFault.NONE

    def frames(self, active: Sequence[tuple[int, int]], now_ns: int) -> Iterator[Frame]:
        """Yield the frames due now; ``active`` has (SPN, FMI) of the present faults."""
        yield from self._claim.frames(now_ns)
        if self._guest:
            return
        if self._claim.sends:
            requested = DM1 in self._claim.requested
            self._claim.requested.clear()
            yield from self.faults.frames(active, now_ns, requested=requested)
        else:
            self.faults.interrupt()

    def send_failed(self, *, claim: bool) -> None:
        """Claim again, because a frame of ours (``claim``: our claim) did not reach the bus."""
        if claim:
            self._claim.not_sent()
        else:
            self._claim.repeat()

    def copy_state(self, before: Self) -> None:
        """Continue the claim of the same address and NAME; ``faults`` are copied apart."""
        self._claim.copy_state(before._claim)

    def on_bus_off(self) -> None:
        """Claim again, because claims of others were missed."""
        self._claim.restart()
