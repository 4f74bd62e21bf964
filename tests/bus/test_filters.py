"""Which of the sockets of a bus receives a message, by the filters that they are given."""

import socket
import struct
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from canshaper.bus.socketcan import CAN_INV_FILTER, set_filters
from canshaper.machine.routing import BusRoutes


class Filtered(socket.socket):
    """Keeps the filters that it is given, and applies them as net/can/af_can.c and raw.c do."""

    def setsockopt(self, *arguments: Any) -> None:
        level, option, value = arguments
        assert (level, option) == (socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER)
        self.filters = list(struct.iter_unpack("=II", value))

    def passes(self, word: int, *, join: bool) -> bool:
        matches = []
        for can_id, mask in self.filters:
            expected = can_id & ~CAN_INV_FILTER
            matches.append((word & mask == expected & mask) is not bool(can_id & CAN_INV_FILTER))
        return all(matches) if join else any(matches)


MESSAGES = st.frozensets(
    st.one_of(
        st.tuples(st.integers(0, 0x7FF), st.just(False)),
        st.tuples(st.integers(0, 0x7FF), st.just(True)),
        st.tuples(st.integers(0, 2**29 - 1), st.just(True)),
    ),
    max_size=8,
)


@given(ours=MESSAGES, sent=MESSAGES, known=MESSAGES, others=MESSAGES)
def test_each_message_is_received_by_the_socket_that_is_for_it(
    ours: frozenset[tuple[int, bool]],
    sent: frozenset[tuple[int, bool]],
    known: frozenset[tuple[int, bool]],
    others: frozenset[tuple[int, bool]],
) -> None:
    """And by no other one, whatever ids of the two widths are alike."""
    sent -= ours  # checked with the deployment
    with Filtered() as first, Filtered() as second, Filtered() as third:
        set_filters([first, second, third], BusRoutes(ours, sent, sent, known))
        everything = ours | sent | known | others
        for can_id, extended in everything | {(i & 0x7FF, not e) for i, e in everything}:
            word = can_id | (socket.CAN_EFF_FLAG if extended else 0)
            received = [
                first.passes(word, join=False),
                second.passes(word, join=False),
                third.passes(word, join=True),
            ]
            message = (can_id, extended)
            assert received == [
                message in ours,
                message in sent,
                message not in ours | sent | known,
            ]
