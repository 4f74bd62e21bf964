"""Any bytes out of the sockets of a port, and any errors of them."""

import struct

import pytest
from hypothesis import event, example, given, settings
from hypothesis import strategies as st

from canshaper.codec.frame import BusState
from tests.bus.raw_line import MARK_AT, SENT_BACK
from tests.fuzz import ports

# Kinds of steps that the first byte of each distinguishes (``ports.run``).
ANY, FRAME, TIME, FAIL, SEND, RECEIVE = 0, 80, 150, 171, 190, 220
# linux/can/error.h: bus-off, restarted, state of the controller, no acknowledgement
WORDS = st.sampled_from([0x20000040, 0x20000100, 0x20000004, 0x20000020, 0x200, 0x80000200])


def step(kind: int, *parts: st.SearchStrategy[bytes]) -> st.SearchStrategy[bytes]:
    number = st.integers(0, 255).map(lambda n: bytes([kind, n]))
    return st.tuples(number, *parts).map(b"".join)


def some(count: int) -> st.SearchStrategy[bytes]:
    return st.binary(min_size=count, max_size=count)


words = WORDS.map(lambda w: struct.pack("<I", w)) | some(4)
controller = st.sampled_from([0x01, 0x08, 0x10, 0x20, 0x40]).map(lambda c: bytes([0, c]) + bytes(6))
steps = st.one_of(
    st.integers(0, 23).flatmap(lambda size: step(ANY + size, some(size))),
    step(FRAME, words, controller | some(8)),
    step(TIME, st.sampled_from([0, 20_000_000, 600_000_000]).map(lambda t: struct.pack("<I", t))),
    step(FAIL),
    step(FAIL + 1),
    step(SEND),
    step(RECEIVE),
)
machines = st.sampled_from([b"\0", b"\1"])


def put(kind: int, number: int, data: bytes = b"") -> bytes:
    return bytes([kind, number]) + data


def error(word: int, controller: int) -> bytes:
    """An error frame to the socket that receives them."""
    return put(FRAME, 1, struct.pack("<I", word) + bytes([0, controller]) + bytes(6))


GONE = put(FAIL, 0) + put(RECEIVE, 0)
# One of our own frames comes back, and not whole.
CUT_SHORT = put(ANY + 15, SENT_BACK, bytes(MARK_AT) + b"\1" + bytes(9))


@pytest.mark.slow
@settings(max_examples=300)
@given(name=machines, script=st.lists(steps, max_size=60))
@example(name=b"\0", script=[])
@example(name=b"\1", script=[CUT_SHORT, put(RECEIVE, 0)])
def test_any_bytes_from_the_sockets_are_accepted(name: bytes, script: list[bytes]) -> None:
    for state in ports.run(name + b"".join(script)):
        event(state.value)


def test_the_bytes_can_make_every_state() -> None:
    confirmed = b"\1" + put(SEND, 0) * 3
    scripts = {
        BusState.PASSIVE: b"\1" + error(0x20000004, 0x10) + put(RECEIVE, 0),
        BusState.BUS_OFF: b"\1" + error(0x20000040, 0) + put(RECEIVE, 0),
        BusState.NOT_CONFIRMED: confirmed + (put(TIME, 0, b"\xff\xff\xff\x01") + put(SEND, 0)) * 2,
        BusState.DOWN: b"\1" + put(FAIL, 3) + put(SEND, 0),
        BusState.GONE: b"\1" + GONE,
        BusState.FAILED: b"\1" + put(FAIL, 6) + put(SEND, 0),
    }
    for state, script in scripts.items():
        assert state in ports.run(script), state
