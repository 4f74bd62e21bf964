"""Our address on a bus of J1939: claiming it, defending it, being silent when it is lost.

SAE J1939-81, for a node that has one address and cannot take another: it claims, waits, and
begins; the lower NAME wins. Who has lost says so once, and sends nothing more.
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
# Who cannot claim waits 0 to 153 ms, so that not all answer at once; here by the serial number.
STEP_NS = 600_000
# Claims in answer to claims: two nodes that are set up wrong must not fill the bus.
LEAST_BETWEEN_NS = 5_000_000
# Refusals in one tick; a node that asks for more at once gets no answer, as on a bus that is full.
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
        answered: groups (PGN) that are sent on request by others of us.
        cyclic: groups that are sent anyhow; a request for one is answered by the next of them.
        guest: the address may be another's: we ask first, claim it only when no one answers, give
            it up to any node that claims it, whatever its NAME, and refuse nothing.

    Attributes:
        state: of our address; nothing but claims may be sent in any other than CLAIMED.
        requested: groups among ``answered`` that were asked for since the owner emptied it.
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
        self._requesting = False  # which node has the address; nothing is claimed meanwhile
        self._request_first = guest
        self._delay_ns = config.name.identity_number % 256 * STEP_NS
        self._due_ns: int | None = 0  # when to send a claim, or that there is none
        self._until_ns: int | None = None
        self._again_ns = 0  # not before then another claim
        self._refused: list[tuple[int, int]] = []

    @property
    def sends(self) -> bool:
        """Whether messages may be sent under our address."""
        return self.state is ClaimState.CLAIMED

    def copy_state(self, before: Self) -> None:
        """Continue with the same address and NAME; of a lost one a reload is the way back."""
        if before.state is ClaimState.LOST:
            return
        self.state, self.requested = before.state, set(before.requested)
        self._requesting, self._request_first = before._requesting, before._request_first
        self._due_ns, self._until_ns = before._due_ns, before._until_ns
        self._again_ns, self._refused = before._again_ns, list(before._refused)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take a claim or a request of another node; never one of ours, seen back."""
        destination, source = frame.can_id >> 8 & 0xFF, frame.can_id & 0xFF
        group, lost = group_of(frame.can_id), self.state is ClaimState.LOST
        if group == CLAIMED << 8 and len(frame.data) == 8:
            if source == self._address and not lost:
                self._contended(int.from_bytes(frame.data, "little"), now_ns)
        elif (
            group == REQUEST << 8
            and len(frame.data) == 3
            # One that is lost is the address of the node that has it now.
            and (destination == GLOBAL or (destination == self._address and not lost))
        ):
            pgn = int.from_bytes(frame.data, "little")
            self._on_request(pgn, source, now_ns, by_name=destination != GLOBAL)

    def _contended(self, other: int, now_ns: int) -> None:
        if other > self._number and not self._guest:
            self._claim_at(now_ns)
            return
        # The same NAME too: two nodes that were set up alike cannot agree which of them it is.
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
        """Schedule a claim; one that is due already is not put off by another request."""
        if self._requesting:
            return
        time_ns = max(time_ns, self._again_ns)
        self._due_ns = time_ns if self._due_ns is None else min(time_ns, self._due_ns)

    def frames(self, now_ns: int) -> Iterator[Frame]:
        """Yield the frames due now: claims, and answers to requests for what we do not have."""
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
        """Claim once more, unless the address is lost: something did not go out."""
        if self.state is not ClaimState.LOST:
            self._claim_at(self._again_ns)

    def not_sent(self) -> None:
        """Claim again, because the last claim did not go out; the wait begins with it."""
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
    """Address and active faults on one bus.

    Args:
        bus: name of the bus.
        config: address and NAME.
        cyclic: groups (PGN) that are sent anyhow, so that no one has to ask for them.
        guest: whether the address may be another's, and no fault is sent.

    Attributes:
        state: of our address.
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
        """State of our address; in any other than CLAIMED all but the node itself is silent."""
        return self._claim.state

    def gate(self, neutral: bool, _now_ns: int) -> Reason | None:
        """Why nothing may move: silence is no shaped stop, and no axis goes on after it."""
        if self._claim.state is ClaimState.LOST:
            return Reason.ADDRESS_LOST
        if self._claim.state is ClaimState.WAITING:
            return Reason.ADDRESS_NOT_CLAIMED if neutral else Reason.SEND_FAILED
        return None

    def receive(self, frame: Frame, arrived_ns: int) -> FrameFault:
        """Take a claim or a request; a claim that wins over ours is a fault."""
        before = self._claim.state
        self._claim.receive(frame, arrived_ns)
        lost = self._claim.state is ClaimState.LOST and before is not ClaimState.LOST
        return FrameFault.ADDRESS_LOST if lost else FrameFault.NONE

    def frames(self, active: Sequence[tuple[int, int]], now_ns: int) -> Iterator[Frame]:
        """Yield the frames due now; ``active``: (SPN, FMI) of the present faults."""
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
        """Take note that a frame did not reach the bus; a claim is then repeated."""
        if claim:
            self._claim.not_sent()
        else:
            self._claim.repeat()

    def copy_state(self, before: Self) -> None:
        """Continue with the same address and NAME."""
        self._claim.copy_state(before._claim)

    def on_bus_off(self) -> None:
        """Claim again, because claims of others were missed."""
        self._claim.restart()
