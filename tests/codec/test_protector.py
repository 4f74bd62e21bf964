"""The alive counter of a message that we send: over a reload, and where a frame did not leave."""

import cantools
import pytest

from canshaper.checksums.kinds import Checksum
from canshaper.codec.message import UNPROTECTED, Protection, Sender, SentMessage

(MESSAGE,) = cantools.database.load_string(
    """BO_ 1 M: 2 A
 SG_ C : 0|4@1+ (1,0) [0|15] "" A
 SG_ D : 4|4@1+ (1,0) [0|15] "" A
""",
    "dbc",
).messages
SAME = Protection("C", 16, Checksum("xor", 1))


def made(protection: Protection) -> Sender:
    return SentMessage("b", MESSAGE, protection=protection).sender()


@pytest.mark.parametrize(
    ("after", "next_count"),
    [
        (SAME, 4),
        (Protection("C", 16, Checksum("sum", 1)), 4),  # receivers look at the counter alone
        (Protection("D", 16, Checksum("xor", 1)), 4),  # the file may rename the same bits
        (Protection("C", 4, Checksum("xor", 1)), 1),
    ],
)
def test_a_counter_that_we_send_goes_on_where_it_counts_as_far(
    after: Protection, next_count: int
) -> None:
    first, second = made(SAME), made(after)
    for _ in range(3):
        first.frame()
    second.copy_state(first)
    second.frame()
    assert max(second.raw.values()) == next_count


def test_a_frame_that_did_not_leave_gives_its_count_back() -> None:
    sender = made(Protection("C", 4, Checksum("xor", 1)))
    counts = []
    for _ in range(5):
        sender.frame()
        sender.take_back()
        sender.frame()
        counts.append(sender.raw["C"])
    assert counts == [1, 2, 3, 0, 1]


def test_without_a_counter_there_is_none_to_give_back() -> None:
    sender = made(UNPROTECTED)
    first = sender.frame()
    assert sender.instead(first) == first
