"""Our node on a bus: which requests it answers, and what it reports of claims."""

from canshaper.codec.frame import Frame, FrameFault
from canshaper.config.bus import J1939, J1939Name
from canshaper.protocols.j1939.claim import ClaimState, Node
from tests.rigs.j1939 import CLAIM, DM1, OWN, WHO_HAS_IT, request

MS = 1_000_000
WAIT_NS = 250 * MS
NAME = bytes.fromhex("0700200000810020")
OURS = Frame("crane", CLAIM, True, NAME)
WHO = Frame("crane", WHO_HAS_IT, True, bytes.fromhex("00EE00"))
NO_FAULT = Frame("crane", DM1, True, bytes.fromhex("00FF00000000FFFF"))
LOWER_NAME = Frame("crane", CLAIM, True, bytes(8))
HIGHER_NAME = Frame("crane", CLAIM, True, b"\xff" * 8)
DM1_GROUP, COMMAND_GROUP, UNKNOWN = 0xFECA, 0xFE30, 0xFEE5
CONFIG = J1939(address=OWN, name=J1939Name(identity_number=7, manufacturer_code=1))


def claimed() -> Node:
    """The owner of an address, which sent its first DM1 at 250 ms."""
    node = Node("crane", CONFIG, frozenset({COMMAND_GROUP}))
    assert list(node.frames([], 0)) == [OURS]
    assert list(node.frames([], WAIT_NS)) == [NO_FAULT]
    return node


def test_a_guest_asks_and_claims_and_sends_no_faults() -> None:
    node = Node("crane", CONFIG, guest=True)
    assert list(node.frames([], 0)) == [WHO]
    assert list(node.frames([], WAIT_NS)) == [OURS]
    assert list(node.frames([(520192, 9)], 2 * WAIT_NS)) == []
    assert node.state is ClaimState.CLAIMED
    assert list(node.frames([(520192, 9)], 10 * WAIT_NS)) == []


def test_a_request_that_a_guest_took_is_not_answered_by_the_owner_after_it() -> None:
    guest, owner = Node("crane", CONFIG, guest=True), Node("crane", CONFIG)
    for now_ns in (0, WAIT_NS, 2 * WAIT_NS):
        list(guest.frames([], now_ns))
    assert guest.receive(request(DM1_GROUP, to=OWN), 510 * MS) is FrameFault.NONE
    owner.copy_state(guest)
    assert owner.state is ClaimState.CLAIMED
    assert list(owner.faults.frames([], 520 * MS)) == [NO_FAULT]
    assert list(owner.frames([], 540 * MS)) == []


def test_dm1_is_sent_at_once_on_request_and_is_not_refused() -> None:
    node = claimed()
    for now_ns, to in ((300 * MS, 0xFF), (400 * MS, OWN)):
        node.receive(request(DM1_GROUP, to=to), now_ns)
        assert list(node.frames([], now_ns)) == [NO_FAULT]
        assert list(node.frames([], now_ns + 20 * MS)) == []


def test_only_the_claim_that_takes_our_address_is_a_fault() -> None:
    node = claimed()
    assert node.receive(request(UNKNOWN, to=OWN), 300 * MS) is FrameFault.NONE
    assert node.receive(HIGHER_NAME, 310 * MS) is FrameFault.NONE
    assert node.state is ClaimState.CLAIMED
    assert node.receive(LOWER_NAME, 320 * MS) is FrameFault.ADDRESS_LOST
    assert node.state is ClaimState.LOST
    assert node.receive(LOWER_NAME, 330 * MS) is FrameFault.NONE
    assert node.receive(request(UNKNOWN), 340 * MS) is FrameFault.NONE
