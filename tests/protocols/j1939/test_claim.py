"""The address of our node: claimed, defended, lost."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.frame import CLAIMED, Frame, name_bytes
from canshaper.config.bus import J1939, J1939Name
from canshaper.protocols.j1939.claim import LEAST_BETWEEN_NS, AddressClaim, ClaimState
from canshaper.shaping.states import State
from tests.rigs.j1939 import (
    AVC,
    CLAIM,
    NACK,
    NO_CLAIM,
    OTHER,
    OWN,
    TICK_NS,
    Rig,
    bjm,
    flow,
    ids,
    request,
)

LEAST_WAIT_NS = 250_000_000


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_nothing_but_the_claim_before_250_ms_have_passed(rig: Rig) -> None:
    first = rig.tick()
    assert ids(first) == [CLAIM]
    assert first[0].data == rig.name.to_bytes(8, "little")
    while not (sent := rig.tick()):
        assert rig.reason() == "ADDRESS_NOT_CLAIMED"
    assert rig.now_ns - TICK_NS >= LEAST_WAIT_NS
    assert CLAIM not in ids(sent)


def test_a_higher_name_is_answered_by_our_claim_and_changes_nothing(rig: Rig) -> None:
    rig.moving()
    sent = rig.tick(rig.claim(+1))
    assert ids(sent).count(CLAIM) == 1
    assert flow(sent) > 50.0
    assert CLAIM not in ids(rig.tick())


@pytest.mark.parametrize("difference", [-1, 0])
def test_a_lower_name_and_our_own_take_the_address_and_all_is_silent(
    rig: Rig, difference: int
) -> None:
    rig.moving()
    sent = rig.tick(rig.claim(difference))
    assert AVC | OWN not in ids(sent)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ADDRESS_LOST")
    assert rig.fault == "ADDRESS_LOST"
    assert rig.events[-1] == "bus=crane address=0x9c state=lost"
    # "cannot claim" once, and then nothing for ever: no valve, no status, no DM1
    later = sent + [frame for frames in rig.run(200, X=100.0) for frame in frames]
    assert ids(later) == [NO_CLAIM]
    assert later[0].data == rig.name.to_bytes(8, "little")
    assert rig.controller.neutral_frames() == []
    assert rig.controller.neutral  # so that a reload, which claims again, is not waited for


def test_a_claim_is_lost_while_it_is_waited_for(rig: Rig) -> None:
    rig.tick()
    later = rig.tick(rig.claim(-1)) + [f for _ in range(50) for f in rig.tick()]
    assert ids(later) == [NO_CLAIM]


@pytest.mark.parametrize("serial", [0, 1, 255, 256, 511])
def test_who_cannot_claim_waits_by_its_serial_number(serial: int) -> None:
    config = J1939(address=OWN, name=J1939Name(identity_number=serial, manufacturer_code=1))
    claim = AddressClaim("crane", config)
    list(claim.frames(0))
    claim.receive(Frame("crane", CLAIM, True, bytes(8)), 10_000_000)
    delay_ns = serial % 256 * 600_000
    assert not list(claim.frames(10_000_000 + delay_ns - 1)) or delay_ns == 0
    if delay_ns:
        assert ids(list(claim.frames(10_000_000 + delay_ns))) == [NO_CLAIM]


def test_claims_for_other_addresses_and_cannot_claim_are_none_of_ours(rig: Rig) -> None:
    rig.moving()
    sent = rig.tick(rig.claim(-1, source=0x21), rig.claim(-1, source=0xFE))
    assert CLAIM not in ids(sent)
    assert flow(sent) > 50.0


@pytest.mark.parametrize("to", [0xFF, OWN])
def test_our_address_is_sent_on_request_also_while_waiting_and_when_lost(rig: Rig, to: int) -> None:
    rig.tick()
    assert ids(rig.tick(request(CLAIMED, to=to))) == [CLAIM]
    rig.claimed()
    assert ids(rig.tick(request(CLAIMED, to=to))).count(CLAIM) == 1
    rig.tick(rig.claim(-1))
    assert ids([f for sent in rig.run(20) for f in sent]) == [NO_CLAIM]
    answer = rig.tick(request(CLAIMED, to=to)) + [f for sent in rig.run(20) for f in sent]
    assert ids(answer) == ([NO_CLAIM] if to == 0xFF else [])  # OWN is another's now
    assert rig.tick(request(CLAIMED, to=0x44)) == []


def test_repeated_requests_do_not_put_the_answer_off(rig: Rig) -> None:
    rig.claimed().tick(rig.claim(-1))
    rig.run(20)
    answers = [f for _ in range(50) for f in rig.tick(*[request(CLAIMED)] * 5)]
    assert answers
    assert set(ids(answers)) == {NO_CLAIM}


def test_claims_are_5_ms_apart_in_a_quick_loop_too() -> None:
    name = J1939Name(identity_number=7, manufacturer_code=1)
    claim, at = AddressClaim("crane", J1939(address=OWN, name=name)), []
    for ms in range(100):
        claim.receive(request(CLAIMED), ms * 1_000_000)
        claim.receive(Frame("crane", CLAIM, True, b"\xff" * 8), ms * 1_000_000)
        at += [ms for _ in claim.frames(ms * 1_000_000)]
    assert {b - a for a, b in pairwise(at)} == {5}


def test_a_storm_of_claims_is_answered_once_a_tick_at_most(rig: Rig) -> None:
    rig.moving()
    for _ in range(20):
        storm = [rig.claim(+1)] * 100 + [request(CLAIMED)] * 100
        sent = rig.tick(bjm("BJM1", X=100.0), bjm("BJM2"), *storm)
        assert ids(sent).count(CLAIM) == 1
        assert flow(sent) > 20.0


def test_unknown_groups_are_refused_only_when_requested_of_us_alone(rig: Rig) -> None:
    rig.claimed()
    assert NACK not in ids(rig.tick(request(0xFEE5)))
    assert NACK not in ids(rig.tick(request(0xFEE5, to=0x44)))
    (nack,) = [f for f in rig.tick(request(0xFEE5, to=OWN)) if f.can_id == NACK]
    assert nack.data == bytes((1, 0xFF, 0xFF, 0xFF, OTHER, 0xE5, 0xFE, 0x00))
    assert NACK not in ids(rig.tick())


def test_groups_that_we_send_anyhow_are_not_refused(rig: Rig) -> None:
    rig.claimed()
    for pgn in (0xFE30, 0xFE31, 0xFECA):
        assert NACK not in ids(rig.tick(request(pgn, to=OWN)))


def test_no_refusal_under_an_address_that_is_lost_in_the_same_tick(rig: Rig) -> None:
    rig.claimed()
    sent = rig.tick(request(0xFEE5, to=OWN), rig.claim(-1))
    assert set(ids(sent)) <= {NO_CLAIM}


def test_malformed_claims_and_requests_are_passed_over(rig: Rig) -> None:
    rig.moving()
    short = Frame("crane", CLAIM, True, bytes(7))
    requested = Frame("crane", 0x18EAFF21, True, b"\x00\xee")
    sent = rig.tick(short, requested, Frame("crane", 0x18EAFF21, True, b""))
    assert CLAIM not in ids(sent)
    assert flow(sent) > 50.0


def test_a_claim_that_did_not_go_out_is_no_claim(rig: Rig) -> None:
    for _ in range(30):  # the interface is down
        (claim,) = rig.tick()
        assert claim.can_id == CLAIM
        rig.controller.send_failed(claim)
    assert ids(rig.tick()) == [CLAIM]
    began_ns = rig.now_ns - TICK_NS
    while not rig.tick():
        pass
    assert rig.now_ns - TICK_NS - began_ns >= LEAST_WAIT_NS


def test_a_frame_that_did_not_go_out_has_us_say_our_address_again(rig: Rig) -> None:
    rig.moving()
    sent = rig.tick()
    assert CLAIM not in ids(sent)
    rig.controller.send_failed(sent[0])
    again = rig.tick()
    assert ids(again).count(CLAIM) == 1
    assert AVC | OWN in ids(again)


def test_off_the_bus_no_axis_goes_on_and_the_address_is_claimed_again(rig: Rig) -> None:
    rig.moving()
    rig.controller.on_bus_off("crane")
    assert ids(rig.tick()) == [CLAIM]
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SEND_FAILED")
    began_ns = rig.now_ns - TICK_NS
    while not (sent := rig.run(1, X=100.0)[0]):
        pass
    assert rig.now_ns - TICK_NS - began_ns >= LEAST_WAIT_NS
    assert AVC | OWN not in ids(sent)  # from the next tick on
    assert flow(rig.run(1, X=100.0)[0]) == 0.0


def test_claims_missed_in_a_stall_are_provoked_again(rig: Rig) -> None:
    rig.moving()
    rig.controller.stalled()
    assert ids(rig.tick()) == [CLAIM]
    assert rig.reason() == "LOOP_STALLED"
    sent = rig.tick(rig.claim(-1))  # who took it meanwhile answers
    assert AVC | OWN not in ids(sent)
    assert rig.events[-1] == "bus=crane address=0x9c state=lost"


def test_a_lost_address_stays_lost_off_the_bus_and_after_a_stall(rig: Rig) -> None:
    rig.claimed().tick(rig.claim(-1))
    rig.run(20)
    rig.controller.on_bus_off("crane")
    rig.controller.stalled()
    rig.controller.send_failed(Frame("crane", AVC | OWN, True, bytes(8)))
    assert [f for frames in rig.run(50) for f in frames] == []


def test_what_happens_on_another_bus_is_nothing_to_our_address(rig: Rig) -> None:
    rig.moving()
    rig.controller.send_failed(Frame("other", AVC | OWN, True, bytes(8)))
    rig.controller.on_bus_off("other")
    rig.controller._invalidate("other")
    sent = ids(rig.tick())
    assert CLAIM not in sent
    assert AVC | OWN in sent
    assert rig.state() is State.ACTIVE


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["higher", "lower", "same", "request", "ask", "nothing", "lost frame"]),
            st.integers(1, 60),
        ),
        max_size=60,
    )
)
def test_whatever_comes_the_rules_hold(steps: list[tuple[str, int]]) -> None:
    """Never a word under a lost address; never one but claims before the wait; never a flood."""
    config = J1939(address=OWN, name=J1939Name(identity_number=77, manufacturer_code=1))
    name = int.from_bytes(name_bytes(config.name), "little")
    claim, now_ns, waits_since_ns, last_ns = AddressClaim("crane", config), 0, None, None
    beaten = False
    for what, ms in steps:
        number = name + {"higher": 1, "lower": -1}.get(what, 0)
        data = number.to_bytes(8, "little")
        if what in ("higher", "lower", "same"):
            claim.receive(Frame("crane", CLAIM, True, data), now_ns)
            beaten |= what != "higher"
        elif what in ("request", "ask"):
            pgn = CLAIMED if what == "request" else 0xFEE5
            claim.receive(request(pgn, to=OWN), now_ns)
        elif what == "lost frame":
            claim.not_sent()
            waits_since_ns = None
        for frame in claim.frames(now_ns):
            if frame.can_id == NACK:
                assert claim.state is ClaimState.CLAIMED
                continue
            assert frame.can_id == (NO_CLAIM if beaten else CLAIM)
            assert last_ns is None or now_ns - last_ns >= LEAST_BETWEEN_NS
            last_ns = now_ns
            waits_since_ns = now_ns if waits_since_ns is None else waits_since_ns
        assert (claim.state is ClaimState.LOST) == beaten
        if claim.sends:
            assert waits_since_ns is not None
            assert now_ns - waits_since_ns >= LEAST_WAIT_NS
        now_ns += ms * 1_000_000
