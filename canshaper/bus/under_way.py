"""Frames of ours that are queued, and not seen on the bus yet."""

from collections import deque
from typing import Any

# Of one id for so long without one of them getting onto the bus: one waits, one is being sent, one
# more for a confirmation that comes just after the tick. A slow bus with a fast loop is no fault,
# so time has to pass as well: 30 frames of 250 kbit/s.
MOST_UNCONFIRMED = 3
UNCONFIRMED_NS = 20_000_000
# Claims: on a bus that takes none one is sent now and then, until its queue is full.
MOST_CLAIMS = 32


class UnderWay:
    """How many there are of each id, and since when more than one.

    Attributes:
        counts: number of frames, by the kernel's id.
        claims: address claims; they come back to the socket of the inputs.
    """

    def __init__(self) -> None:
        self.counts: dict[int, int] = {}
        self.claims: deque[Any] = deque(maxlen=MOST_CLAIMS)
        self._since_ns: dict[int, int] = {}

    def waited_ns(self, word: int, now_ns: int) -> int:
        """How long frames of an id have been under way; 0 where that is no fault yet."""
        waited_ns = now_ns - self._since_ns.setdefault(word, now_ns)
        if self.counts[word] < MOST_UNCONFIRMED or waited_ns < UNCONFIRMED_NS:
            return 0
        return waited_ns

    def confirmed(self, word: int) -> None:
        """One of them is on the bus."""
        self.counts[word] = max(0, self.counts.get(word, 0) - 1)
        self._since_ns.pop(word, None)

    def is_claim(self, content: Any) -> bool:
        """Whether this is a claim of ours, seen back."""
        if content not in self.claims:
            return False
        self.claims.remove(content)
        return True

    def restart(self, word: int) -> None:
        """Count the frames of an id from 0."""
        self.counts[word] = 0
        del self._since_ns[word]

    def clear(self) -> None:
        """Count all of them from 0; of claims it is known which they are."""
        self.counts.clear()
        self._since_ns.clear()
