"""Our node on a bus of J1939: what it takes, and what it sends besides commands and status."""

from collections.abc import Iterator, Sequence
from typing import Self

from canshaper.codec.frame import Frame, FrameFault
from canshaper.codec.j1939 import DM1
from canshaper.config.bus import J1939
from canshaper.protocols.j1939.claim import AddressClaim, ClaimState
from canshaper.protocols.j1939.dm1 import ActiveFaults
from canshaper.shaping.states import Reason


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
        self,
        bus: str,
        config: J1939,
        cyclic: frozenset[int] = frozenset(),
        *,
        guest: bool = False,
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
        """What is due now; ``active`` are (SPN, FMI) of the faults that are there."""
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
        """A frame did not reach the bus; one that was a claim is no claim."""
        if claim:
            self._claim.not_sent()
        else:
            self._claim.repeat()

    def copy_state(self, before: Self) -> None:
        """Continue with the same address and NAME."""
        self._claim.copy_state(before._claim)

    def on_bus_off(self) -> None:
        """Claims of others were missed."""
        self._claim.restart()
