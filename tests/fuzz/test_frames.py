"""Whatever comes from the buses, whenever: no exception, and no move that no operator commanded.

The judge is that of the random drives with faults; here the frames are anything at all.
"""

import pytest
from hypothesis import event, example, given, settings
from hypothesis import strategies as st

from tests.faults.variants import NAMES
from tests.fuzz import frames

# Kinds of steps that the first byte of each distinguishes (``frames.run``).
TICK, JOYSTICK, HEALTHY, MISSED, LATE, NOT_SENT, OURS, ANY = 0, 80, 110, 170, 180, 190, 200, 225


def step(kind: int, *parts: st.SearchStrategy[bytes]) -> st.SearchStrategy[bytes]:
    return st.tuples(*parts).map(lambda drawn: bytes([kind]) + b"".join(drawn))


def some(count: int) -> st.SearchStrategy[bytes]:
    return st.binary(min_size=count, max_size=count)


steps = st.one_of(
    st.just(bytes([TICK])),
    step(JOYSTICK, some(9)),
    step(HEALTHY, some(1)),
    step(HEALTHY + 1, some(1)),
    step(MISSED, st.integers(0, 12).map(lambda n: bytes([n]))),
    step(LATE, some(4)),
    step(NOT_SENT, some(1)),
    step(OURS, some(2), some(9)),
    step(ANY, some(6), some(8)),
)
moving = bytes([HEALTHY, 0, HEALTHY, 0, HEALTHY, 0]) + bytes([HEALTHY, 90]) * 8
machines = st.integers(0, len(NAMES) - 1).map(lambda n: bytes([n]))


@pytest.mark.slow
@settings(max_examples=300)
@given(name=machines, armed=st.booleans(), script=st.lists(steps, max_size=60))
@example(name=b"\0", armed=True, script=[])
def test_nothing_on_the_buses_makes_a_wrong_move(
    name: bytes, armed: bool, script: list[bytes]
) -> None:
    moves = frames.run(name + (moving if armed else b"") + b"".join(script))
    event("moved" if moves else "still")
    assert moves or not armed


@settings(max_examples=200)
@given(data=st.binary(max_size=400))
@example(data=b"\0\xe1\x01\x11\x03" + bytes(12))  # our identity, on a bus it is not sent on
def test_any_bytes_are_a_script_without_a_wrong_move(data: bytes) -> None:
    frames.run(data)
