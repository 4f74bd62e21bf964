"""The alive counter of a message that we send: over a reload, and where a frame did not leave."""

from typing import Any

import pytest

from canshaper.checksums.kinds import Checksum
from canshaper.codec.protection import UNPROTECTED, Protection, Protector

SAME = Protection("C", 16, Checksum("xor", 0))


class Encoded:
    """A layout that no one looks at."""

    def encode(self, _raw: dict[str, Any]) -> bytes:
        return b""


@pytest.mark.parametrize(
    ("after", "next_count"),
    [
        (SAME, 4),
        (Protection("C", 16, Checksum("sum", 0)), 4),  # receivers look at the counter alone
        (Protection("D", 16, Checksum("xor", 0)), 1),
        (Protection("C", 4, Checksum("xor", 0)), 1),
    ],
)
def test_a_counter_that_we_send_goes_on_where_it_is_the_same(
    after: Protection, next_count: int
) -> None:
    raw = {"C": 0, "D": 0}
    first, second = (Protector(p, Encoded()) for p in (SAME, after))  # type: ignore[arg-type]
    for _ in range(3):
        first.without_check(raw)
    second.copy_state(first)
    raw = {"C": 0, "D": 0}
    second.without_check(raw)
    assert max(raw.values()) == next_count


def test_a_frame_that_did_not_leave_gives_its_count_back() -> None:
    raw = {"C": 0}
    protector = Protector(Protection("C", 4, Checksum("xor", 0)), Encoded())  # type: ignore[arg-type]
    counts = []
    for _ in range(5):
        protector.without_check(raw)
        protector.take_back()
        protector.without_check(raw)
        counts.append(raw["C"])
    assert counts == [1, 2, 3, 0, 1]
    plain = Protector(UNPROTECTED, Encoded())  # type: ignore[arg-type]
    plain.without_check(raw)
    plain.take_back()
    assert plain.protect(raw) == b""
