"""States of other nodes, by CiA 301, CiA 408 and SAE J1939-81, and their consequences."""

from canshaper.codec.frame import Frame
from tests.faults.axis import Node, Words
from tests.faults.received import LONG_AGO

BOOT_UP, OPERATIONAL = 0, 5
ACTIVE, STATE_BITS = 0xF, 0xF
# Ticks from a claim that does not win over ours to our answer, at most.
ANSWER_TICKS = 5
WAIT_NS, SLACK_NS = 250_000_000, 1_000_000


class NodeRules:
    """A node of CANopen whose heartbeats and emergencies count."""

    def __init__(self, node: Node, tick_ns: int) -> None:
        self.node = node
        self._state: int | None = None
        self._emergency = False
        self._received_ns = LONG_AGO
        self._since: set[str] = set()
        self._limit_ns = node.timeout_ns + 3 * tick_ns

    def receive(self, frame: Frame, now_ns: int) -> None:
        """A frame was read."""
        if frame.bus != self.node.bus or frame.extended:
            return
        if frame.can_id == 0x700 + self.node.number and len(frame.data) == 1:
            self._state, self._received_ns = frame.data[0] & 0x7F, now_ns
            if self._state != OPERATIONAL:
                self._since.add("the node is not operational")
            if self._state == BOOT_UP:
                self._emergency = False
        elif frame.can_id == 0x80 + self.node.number and len(frame.data) == 8:
            code, register = int.from_bytes(frame.data[:2], "little"), frame.data[2]
            if code:
                self._since.add("the node has an emergency")
            self._emergency = bool(code or register)  # only with both 0 all errors are over

    def seen(self, now_ns: int) -> set[str]:
        """Return its fault, now or since the last call."""
        causes = set(self._since)
        if self._state != OPERATIONAL:
            causes.add("the node is not operational")
        if self._emergency:
            causes.add("the node has an emergency")
        if now_ns - self._received_ns > self._limit_ns:
            causes.add("no heartbeat")
        return causes

    causes = seen

    def may_be_lost(self, now_ns: int) -> bool:
        """Whether the daemon may already take it for silent."""
        return now_ns - self._received_ns > self.node.timeout_ns

    def looked_at(self) -> None:
        """Every axis knows of it."""
        self._since.clear()


class WordRules:
    """The status word of a valve of CiA 408."""

    def __init__(self, words: Words, tick_ns: int) -> None:
        self.words = words
        self._state: int | None = None
        self._received_ns = LONG_AGO
        self._left = False
        self._limit_ns = words.timeout_ns + 2 * tick_ns

    def receive(self, frame: Frame, now_ns: int) -> None:
        """A frame was read."""
        if frame[:3] == self.words.key and len(frame.data) == self.words.length:
            word = self.words.status.get(int.from_bytes(frame.data, "little"))
            self._state, self._received_ns = word & STATE_BITS, now_ns
            self._left |= self._state != ACTIVE

    def causes(self, now_ns: int) -> set[str]:
        """Why the valve has to be neutral."""
        left, self._left = self._left, False
        causes = {"the valve is not active"} if left or self._state != ACTIVE else set()
        if now_ns - self._received_ns > self._limit_ns:
            causes.add("no status word")
        return causes


class AddressRules:
    """Our address on a bus of J1939."""

    def __init__(self, bus: str, own: int) -> None:
        self._bus, self._own = bus, own
        self._claim = (bus, 0x18EEFF00 | own, True)
        self._name: int | None = None
        self._claimed_ns = 0
        self._unanswered: int | None = None  # so many ticks
        self.lost = False
        self.reloaded = False

    def ticked(self) -> None:
        """A tick begins."""
        if self._unanswered is not None:
            self._unanswered += 1

    def receive(self, frame: Frame) -> None:
        """A frame was read: is it a claim for our address?"""
        if frame[:3] != self._claim or len(frame.data) != 8 or self._name is None:
            return
        if int.from_bytes(frame.data, "little") <= self._name:
            self.lost, self.reloaded = True, False
        elif not self.lost and self._unanswered is None:
            self._unanswered = 0

    def sent(self, frame: Frame, now_ns: int) -> str:
        """Return the fault of a frame of ours."""
        if frame.bus != self._bus or not frame.extended:
            return ""
        if frame[:3] == self._claim:
            if self.lost and not self.reloaded:
                return "a claim of an address that is lost"
            if self._name is None or self.lost:
                self._claimed_ns = now_ns
            self._name = int.from_bytes(frame.data, "little")
            self.lost, self._unanswered = False, None
            return ""
        return self._under_it(now_ns) if frame.can_id & 0xFF == self._own else ""

    def usable(self, now_ns: int) -> bool:
        """Whether anything may be sent under our address."""
        waited = self._name is not None and now_ns - self._claimed_ns >= WAIT_NS - SLACK_NS
        return waited and not self.lost

    def _under_it(self, now_ns: int) -> str:
        """Return why nothing may be sent under our address now."""
        if self._name is None or now_ns - self._claimed_ns < WAIT_NS - SLACK_NS:
            return "a frame before the address is ours"
        if self.lost:
            return "a frame from an address that is another's"
        if self._unanswered is not None and self._unanswered > ANSWER_TICKS:
            return "a claim of our address was not answered"
        return ""
