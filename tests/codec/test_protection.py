"""Alive counter and checksum of a message: every sequence that one may meet."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.checksums.kinds import CHECKSUMS, Checksum
from canshaper.codec.e2e import Profile1, Profile2
from canshaper.codec.frame import FrameFault
from canshaper.codec.message import Protection, SequenceChecker

GOOD, WRONG = FrameFault.NONE, FrameFault.CHECKSUM
REPEATED, JUMP = FrameFault.COUNTER_REPEATED, FrameFault.COUNTER_JUMP


def made(
    bits: int = 8, max_step: int = 3, qualify: int = 1, checksum: tuple[str, int] | None = None
) -> SequenceChecker:
    check = Checksum(*checksum) if checksum else None
    counts = 1 << bits if bits else 0
    return SequenceChecker(Protection("C" if bits else None, counts, check), max_step, qualify)


def faults(checker: SequenceChecker, *counts: int) -> list[FrameFault]:
    return [checker.check(b"", count) for count in counts]


# -- checksums -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", CHECKSUMS)
def test_a_frame_whose_checksum_is_wrong_is_not_qualified(kind: str) -> None:
    frame = Checksum(kind, 3).protect(bytes(range(1, 9)), 0)
    checker = made(bits=0, checksum=(kind, 3))
    assert checker.check(frame, 0) is GOOD
    wrong = frame[:7] + bytes((frame[7] ^ 0x10,))
    assert checker.check(wrong, 0) is WRONG
    assert not checker.qualified
    assert checker.check(frame, 0) is GOOD
    assert checker.qualified


# -- the alive counter -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("bits", "max_step", "counts", "expected"),
    [
        (8, 1, [7, 8, 9, 10], [GOOD] * 4),
        (8, 3, [7, 10, 11, 13], [GOOD] * 4),  # some were lost
        (8, 3, [7, 11, 12], [GOOD, JUMP, GOOD]),
        (8, 1, [7, 9, 10], [GOOD, JUMP, GOOD]),
        (8, 3, [7, 6, 7], [GOOD, JUMP, GOOD]),  # one back is 255 on
        (8, 3, [7, 7, 7, 8], [GOOD, REPEATED, REPEATED, GOOD]),
        (8, 3, [7, 7, 11], [GOOD, REPEATED, JUMP]),  # frames that were no news count no step
        (8, 3, [254, 255, 0, 3], [GOOD] * 4),
        (8, 3, [254, 2, 3], [GOOD, JUMP, GOOD]),
        (4, 3, [14, 15, 0, 1], [GOOD] * 4),
        (4, 3, [14, 0, 3, 7], [GOOD, GOOD, GOOD, JUMP]),  # E2E profile 1 has no 15
        (4, 8, [0, 8, 0, 9], [GOOD, GOOD, GOOD, JUMP]),
        (2, 2, [0, 2, 1], [GOOD, GOOD, JUMP]),
        (1, 1, [0, 1, 0, 0, 1], [GOOD, GOOD, GOOD, REPEATED, GOOD]),
        (16, 255, [65535, 254, 510], [GOOD, GOOD, JUMP]),
    ],
)
def test_steps_of_the_counter(
    bits: int, max_step: int, counts: list[int], expected: list[FrameFault]
) -> None:
    assert faults(made(bits, max_step), *counts) == expected


def test_without_a_counter_every_frame_is_new() -> None:
    checker = made(bits=0)
    assert faults(checker, 0, 0, 0) == [GOOD] * 3
    assert checker.qualified


def test_a_frozen_counter_is_never_new_however_often_its_sender_was_silent() -> None:
    checker = made()
    faults(checker, 7)
    for _ in range(5):
        checker.resync()
        assert faults(checker, 7, 7, 7) == [REPEATED] * 3
        assert not checker.qualified


def test_after_silence_any_counter_but_the_last_begins_again_once() -> None:
    for restart in range(256):
        checker = made()
        faults(checker, 100)
        checker.resync()
        first, second = faults(checker, restart, (restart + 50) % 256)
        assert first is (REPEATED if restart == 100 else GOOD)
        # what was repeated has not begun again yet
        assert second is (GOOD if restart == 100 else JUMP)


def test_a_wrong_checksum_says_nothing_about_the_sequence() -> None:
    """Not even its counter is believed: it may be the one that was hit."""

    def frame(count: int, error: int = 0) -> bytes:
        return bytes([count, count ^ error])

    checker = made(checksum=("xor", 1))
    assert checker.check(frame(7), 7) is GOOD
    assert checker.check(frame(90, error=1), 90) is WRONG
    assert checker.check(frame(7, error=1), 7) is WRONG
    assert checker.check(frame(8), 8) is GOOD


# -- qualification ---------------------------------------------------------------------------------


def qualified(checker: SequenceChecker, counts: list[int]) -> list[bool]:
    """Whether each frame may be used."""
    return [checker.check(b"", count) is GOOD and checker.qualified for count in counts]


@pytest.mark.parametrize("qualify", [2, 5, 20])
def test_so_many_good_frames_in_a_row_at_the_start_and_after_a_wrong_one(qualify: int) -> None:
    checker = made(qualify=qualify)
    counts = list(range(qualify + 3))
    expected = [False] * (qualify - 1) + [True] * 4
    assert qualified(checker, counts) == expected
    jump = [counts[-1] + 50]
    assert qualified(checker, jump) == [False]
    assert qualified(checker, [jump[0] + 1 + i for i in counts]) == expected


def test_a_repeated_frame_neither_counts_as_good_nor_breaks_the_row() -> None:
    checker = made(qualify=3)
    assert qualified(checker, [0, 0, 0, 1, 1, 2, 2, 3]) == [False] * 5 + [True, False, True]


def test_a_wrong_checksum_breaks_the_row() -> None:
    checker = made(bits=0, qualify=2, checksum=("sum", 0))
    good, wrong = b"\x05\x05", b"\x05\x06"
    results: list[tuple[Any, bool]] = []
    for frame in (good, wrong, good, good, wrong, good):
        results.append((checker.check(frame, 0), checker.qualified))
    assert results == [
        (GOOD, False),
        (WRONG, False),
        (GOOD, False),
        (GOOD, True),
        (WRONG, False),
        (GOOD, False),
    ]


@given(
    counts=st.lists(st.tuples(st.integers(0, 15), st.booleans()), max_size=60),
    max_step=st.integers(1, 8),
    qualify=st.integers(1, 4),
)
def test_what_is_used_is_always_the_end_of_a_row(
    counts: list[tuple[int, bool]], max_step: int, qualify: int
) -> None:
    """Whatever comes: a used frame ends ``qualify`` frames that each followed the one before."""
    checker = made(4, max_step, qualify)
    row: list[int] = []  # steps since the last wrong frame or silence, as far as they are good
    last: int | None = None
    rested = True
    for count, silent in counts:
        if silent:
            checker.resync()
            rested, row = True, []
        step = (count - last) % 16 if last is not None else None
        fault = checker.check(b"", count)
        if step == 0:
            assert fault is REPEATED
            continue
        follows = rested or step is None or step <= max_step
        assert fault is (GOOD if follows else JUMP)
        row = [*row, count] if follows else []
        assert checker.qualified is (len(row) >= qualify)
        last, rested = count, False


# -- from one deployment to the next ---------------------------------------------------------------

SAME = Protection("C", 16, Checksum("xor", 0))


@pytest.mark.parametrize(
    ("after", "good"),
    [
        (SAME, False),
        (Protection("D", 16, Checksum("xor", 0)), True),
        (Protection("C", 32, Checksum("xor", 0)), True),
        (Protection("C", 16, Checksum("sum", 0)), True),
    ],
)
def test_a_sequence_goes_on_where_its_protection_is_the_same(after: Protection, good: bool) -> None:
    """After counter 5 comes 5 again: with another protection that is a first frame."""
    before, checker = SequenceChecker(SAME, 3, 1), SequenceChecker(after, 3, 1)
    assert before.check(b"\0\0", 5) is FrameFault.NONE
    checker.copy_state(before)
    assert checker.qualified is not good
    fault = checker.check(b"\0\0", 5)
    assert fault is (FrameFault.NONE if good else FrameFault.COUNTER_REPEATED)


def test_a_jump_from_one_deployment_to_the_next_is_one() -> None:
    before, checker = SequenceChecker(SAME, 3, 1), SequenceChecker(SAME, 3, 1)
    before.check(b"\0\0", 5)
    checker.copy_state(before)
    assert checker.check(b"\0\0", 9) is FrameFault.COUNTER_JUMP


def test_frames_in_a_row_count_on_up_to_the_number_that_is_required_now() -> None:
    before = SequenceChecker(SAME, 3, 2)
    for count in (1, 2):
        before.check(b"\0\0", count)
    assert before.qualified
    checker = SequenceChecker(SAME, 3, 3)
    checker.copy_state(before)
    assert not checker.qualified
    assert checker.check(b"\0\0", 3) is FrameFault.NONE
    assert checker.qualified


def test_two_profiles_are_the_same_with_the_same_data_id_only() -> None:
    same = Profile1(0x123, "both"), Profile1(0x123, "both")
    assert same[0] == same[1]
    assert hash(same[0]) == hash(same[1])
    ids = tuple(range(16))
    others = Profile1(0x124, "both"), Profile1(0x123, "low"), Profile2(ids)
    assert all(same[0] != other for other in others)
    assert Profile2(ids) == Profile2(ids) != Profile2(ids[::-1])
