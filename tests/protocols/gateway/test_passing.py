"""Which frames pass: every id but those that are excluded, and each of them once."""

import socket

from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.frame import EFF_FLAG
from canshaper.protocols.gateway.forwarding import EVERYTHING, Pattern, all_but, exactly

narrow = st.integers(0, 0x7FF)
wide = st.integers(0, 0x1FFFFFFF).map(lambda i: i | EFF_FLAG)
words = narrow | wide


@st.composite
def holes(draw: st.DrawFn) -> Pattern:
    """A pattern with any bits that do not matter."""
    word = draw(words)
    mask = draw(st.integers(0, 0x1FFFFFFF if word & EFF_FLAG else 0x7FF)) | EFF_FLAG
    return Pattern(word & mask, mask)


@given(st.lists(holes(), max_size=6), words)
def test_a_frame_passes_once_unless_it_is_excluded(excluded: list[Pattern], word: int) -> None:
    passes = sum(pattern.fits(word) for pattern in all_but(excluded))
    assert passes == (not any(hole.fits(word) for hole in excluded))


@given(st.sets(words, max_size=6), words)
def test_ids_of_both_widths_are_distinguished(excluded: set[int], word: int) -> None:
    hidden = [exactly(i & ~EFF_FLAG, bool(i & EFF_FLAG)) for i in excluded]
    passes = any(pattern.fits(word) for pattern in all_but(hidden))
    assert passes == (word not in excluded)


@given(st.lists(holes(), min_size=1, max_size=4))
def test_what_is_excluded_does_not_pass(excluded: list[Pattern]) -> None:
    for hole in excluded:
        assert not any(pattern.fits(hole.value) for pattern in all_but(excluded))


def test_one_id_is_a_pattern_of_its_own_width() -> None:
    assert exactly(0x123, False) == Pattern(0x123, 0x800007FF)
    assert exactly(0x123, True) == Pattern(0x80000123, 0x9FFFFFFF)
    assert exactly(0x18FF0300, True) == Pattern(0x98FF0300, 0x9FFFFFFF)


def test_without_an_exclusion_everything_passes() -> None:
    assert all_but([]) == sorted(EVERYTHING)


def test_remote_frames_of_an_excluded_id_do_not_pass_either() -> None:
    """Its flag is in no mask."""
    word = 0x110 | socket.CAN_RTR_FLAG
    assert not any(pattern.fits(word) for pattern in all_but([exactly(0x110, False)]))
    assert any(pattern.fits(word + 1) for pattern in all_but([exactly(0x110, False)]))


def test_a_few_ids_take_a_few_patterns() -> None:
    assert len(all_but(exactly(i, False) for i in (0x110, 0x111))) == 11
