"""Frames of the address claim to the bit, and their times to the nanosecond."""

import pytest

from canshaper.codec.frame import CLAIMED, Frame
from canshaper.config.bus import J1939, J1939Name
from canshaper.protocols.j1939.claim import AddressClaim, ClaimState
from tests.rigs.j1939 import CLAIM, NACK, NO_CLAIM, OTHER, OWN, WHO_HAS_IT, request

MS = 1_000_000
WAIT_NS = 250 * MS
BETWEEN_NS = 5 * MS
SERIAL = 7
DELAY_NS = 4_200_000  # 7 steps of 0.6 ms
NAME = bytes.fromhex("0700200000810020")
OURS = Frame("crane", CLAIM, True, NAME)
CANNOT_CLAIM = Frame("crane", NO_CLAIM, True, NAME)
WHO = Frame("crane", WHO_HAS_IT, True, bytes.fromhex("00EE00"))
LOWER_NAME = Frame("crane", CLAIM, True, bytes(8))
UNKNOWN = 0xFEE5


def address(*, guest: bool = False) -> AddressClaim:
    name = J1939Name(identity_number=SERIAL, manufacturer_code=1)
    return AddressClaim("crane", J1939(address=OWN, name=name), guest=guest)


def claimed() -> AddressClaim:
    claim = address()
    assert list(claim.frames(0)) == [OURS]
    assert list(claim.frames(WAIT_NS)) == []
    assert claim.state is ClaimState.CLAIMED
    return claim


def lost(now_ns: int) -> AddressClaim:
    """An address that was lost at this time, which was said."""
    claim = claimed()
    claim.receive(LOWER_NAME, now_ns)
    assert list(claim.frames(now_ns + DELAY_NS)) == [CANNOT_CLAIM]
    return claim


def refusal(source: int) -> Frame:
    return Frame("crane", NACK, True, bytes((1, 0xFF, 0xFF, 0xFF, source, 0xE5, 0xFE, 0)))


def test_the_address_is_ours_at_250_ms_after_the_claim() -> None:
    claim = address()
    assert list(claim.frames(3 * MS)) == [OURS]
    assert list(claim.frames(3 * MS + WAIT_NS - 1)) == []
    assert claim.state is ClaimState.WAITING
    assert list(claim.frames(3 * MS + WAIT_NS)) == []
    assert claim.state is ClaimState.CLAIMED


def test_a_guest_asks_with_an_extended_frame_of_three_bytes_and_claims_250_ms_later() -> None:
    claim = address(guest=True)
    assert list(claim.frames(0)) == [WHO]
    assert list(claim.frames(WAIT_NS - 1)) == []
    assert list(claim.frames(WAIT_NS)) == [OURS]


def test_a_guest_that_begins_again_at_time_zero_asks_again_at_once() -> None:
    claim = address(guest=True)
    assert list(claim.frames(0)) == [WHO]
    claim.restart()
    assert list(claim.frames(0)) == [WHO]


def test_a_request_after_the_address_was_lost_is_answered_after_our_delay() -> None:
    claim = lost(300 * MS)
    claim.receive(request(CLAIMED), 400 * MS)
    assert list(claim.frames(400 * MS + DELAY_NS - 1)) == []
    assert list(claim.frames(400 * MS + DELAY_NS)) == [CANNOT_CLAIM]
    assert list(claim.frames(500 * MS)) == []


def test_a_request_for_an_address_that_is_ours_is_answered_without_delay() -> None:
    claim = claimed()
    claim.receive(request(CLAIMED), 400 * MS)
    assert list(claim.frames(400 * MS - 1)) == []
    assert list(claim.frames(400 * MS)) == [OURS]


def test_a_request_that_arrived_before_the_address_was_lost_counts_from_its_arrival() -> None:
    claim = address()
    claim.receive(LOWER_NAME, 10 * MS)
    claim.receive(request(CLAIMED), 8 * MS)
    assert list(claim.frames(8 * MS + DELAY_NS - 1)) == []
    assert list(claim.frames(8 * MS + DELAY_NS)) == [CANNOT_CLAIM]


def test_cannot_claim_that_did_not_go_out_is_sent_again_5_ms_later() -> None:
    claim = lost(300 * MS)
    claim.not_sent()
    again_ns = 300 * MS + DELAY_NS + BETWEEN_NS
    assert list(claim.frames(again_ns - 1)) == []
    assert list(claim.frames(again_ns)) == [CANNOT_CLAIM]
    assert claim.state is ClaimState.LOST


@pytest.mark.parametrize("source", [0, OTHER, 0xFD])
def test_a_refusal_is_an_extended_frame_that_names_who_asked(source: int) -> None:
    claim = claimed()
    claim.receive(request(UNKNOWN, source=source, to=OWN), 300 * MS)
    assert list(claim.frames(300 * MS)) == [refusal(source)]
    assert list(claim.frames(320 * MS)) == []


@pytest.mark.parametrize("source", [0xFE, 0xFF])
def test_who_asks_without_an_address_is_not_refused(source: int) -> None:
    claim = claimed()
    claim.receive(request(UNKNOWN, source=source, to=OWN), 300 * MS)
    assert list(claim.frames(300 * MS)) == []


def test_the_first_eight_requests_of_a_tick_are_refused_and_no_more() -> None:
    claim = claimed()
    for source in range(10):
        claim.receive(request(UNKNOWN, source=source, to=OWN), 300 * MS)
    assert list(claim.frames(300 * MS)) == [refusal(source) for source in range(8)]
    assert list(claim.frames(320 * MS)) == []


def test_a_refusal_that_is_due_is_dropped_when_the_claim_begins_again() -> None:
    claim = claimed()
    claim.receive(request(UNKNOWN, to=OWN), 300 * MS)
    claim.restart()
    assert list(claim.frames(300 * MS)) == [OURS]
    assert list(claim.frames(300 * MS + WAIT_NS)) == []
