"""Profiles 1 and 2 of AUTOSAR E2E: published frames, the library's CRCs, every flipped bit.

The frames of profile 1 are the protocol examples of AUTOSAR PRS_E2EProtocol (data ID 0x123, eight
bytes, counter 0 and 1), as torsko/autosar-e2e and the Python package autosar-e2e test them; those
of profile 2 are from the tests of that package.
"""

import pytest
from crccheck.crc import Crc8Autosar, Crc8SaeJ1850
from hypothesis import assume, given
from hypothesis import strategies as st

from canshaper.codec.e2e import E2e, Profile1, Profile2
from canshaper.codec.frame import FrameFault
from tests.codec.e2e_checks import GOOD, JUMP, REPEATED, WRONG, data_ids, flipped, made

MODES = ("both", "low", "alternating", "nibble")
modes = st.sampled_from(MODES)
lists = st.lists(st.integers(0, 255), min_size=16, max_size=16)
frames = st.binary(min_size=2, max_size=8)


# -- published frames ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "first", "second"),
    [
        ("both", "cc00000000000000", "9101000000000000"),
        ("alternating", "ce00000000000000", "0201000000000000"),
        ("low", "ce00000000000000", "9301000000000000"),
        ("nibble", "2a10000000000000", "7711000000000000"),
    ],
)
def test_the_examples_of_profile_1(mode: str, first: str, second: str) -> None:
    profile = Profile1(0x123, mode)
    for count, text in enumerate((first, second)):
        frame = bytes.fromhex(text)
        assert profile.protect(bytes(8), count) == frame
        assert profile.verify(frame)


CRCS_OF_ZEROS = "0e1b98310d189b65081d9e370b1e9dcd"


def test_the_counters_of_profile_2() -> None:
    """Eight zeros with the data IDs 1 to 16, counter 0 to 15."""
    profile = Profile2(range(1, 17))
    for count, crc in enumerate(bytes.fromhex(CRCS_OF_ZEROS)):
        frame = bytes((crc, count)) + bytes(6)
        assert profile.protect(bytes(8), count) == frame
        assert profile.verify(frame)


# -- against the library ---------------------------------------------------------------------------


@given(data_ids, modes, frames, st.integers(0, 14))
def test_profile_1_by_the_library(data_id: int, mode: str, data: bytes, count: int) -> None:
    """A CRC that starts with 0 and is not inverted, over the data ID and all but its own byte."""
    low, high = data_id & 0xFF, data_id >> 8
    included = {
        "both": [low, high],
        "low": [low],
        "alternating": [high if count % 2 else low],
        "nibble": [low, 0],
    }[mode]
    top = (high & 0x0F) << 4 if mode == "nibble" else data[1] & 0xF0
    body = bytes([top | count]) + data[2:]
    crc = Crc8SaeJ1850.calc(bytes(included) + body, initvalue=0) ^ 0xFF
    profile = Profile1(data_id, mode)
    assert profile.protect(data, count) == bytes([crc]) + body
    assert profile.verify(bytes([crc]) + body)


@given(lists, frames, st.integers(0, 15))
def test_profile_2_by_the_library(ids: list[int], data: bytes, count: int) -> None:
    body = bytes([data[1] & 0xF0 | count]) + data[2:]
    crc = Crc8Autosar.calc(body + bytes([ids[count]]))
    assert Profile2(ids).protect(data, count) == bytes([crc]) + body
    assert Profile2(ids).verify(bytes([crc]) + body)


# -- what is refused -------------------------------------------------------------------------------


@given(data_ids, modes, frames, st.integers(0, 14))
def test_every_flipped_bit_of_profile_1_is_seen(
    data_id: int, mode: str, data: bytes, count: int
) -> None:
    profile = Profile1(data_id, mode)
    frame = profile.protect(data, count)
    # The one weak place: the counter's lowest bit chooses another byte of the data ID, and with
    # some IDs both changes cancel.
    low, high = data_id & 0xFF, data_id >> 8
    change = Crc8SaeJ1850.calc(bytes([low ^ high]), initvalue=0) ^ 0xFF
    assume(mode != "alternating" or change != 1)
    for bit in range(8 * len(frame)):
        assert not profile.verify(flipped(frame, bit)), bit


@given(lists, frames, st.integers(0, 15))
def test_every_flipped_bit_of_profile_2_is_seen(ids: list[int], data: bytes, count: int) -> None:
    """A flipped bit of the counter chooses another data ID; with the same one in all it is seen."""
    profile = Profile2(ids)
    frame = profile.protect(data, count)
    same = Profile2([ids[0]] * 16)
    for bit in range(8 * len(frame)):
        if not 8 <= bit < 12:
            assert not profile.verify(flipped(frame, bit)), bit
        assert not same.verify(flipped(same.protect(data, count), bit)), bit


@given(modes, st.integers(0, 0xFFF), st.integers(0, 0xFFF), frames)
def test_a_frame_for_another_data_id_is_refused(
    mode: str, mine: int, other: int, data: bytes
) -> None:
    """Where the mode distinguishes the IDs; of 16 bits in 8 some must coincide (see below)."""
    if mode == "both":
        other = mine & 0xFF00 | other & 0xFF
    differs = mine != other if mode in ("both", "nibble") else mine & 0xFF != other & 0xFF
    assume(differs)
    frame = Profile1(other, mode).protect(data, 0)
    assert not Profile1(mine, mode).verify(frame)
    assert Profile1(mine, mode).verify(Profile1(mine, mode).protect(data, 0))


@pytest.mark.parametrize("mine", range(16))
def test_the_part_of_the_data_id_that_is_sent_is_compared(mine: int) -> None:
    """The CRC covers it, so only that distinguishes it from another sender's."""
    for other in range(16):
        frame = Profile1(other << 8 | 0x42, "nibble").protect(bytes(8), 3)
        assert Profile1(mine << 8 | 0x42, "nibble").verify(frame) is (mine == other)


@pytest.mark.parametrize("mode", MODES)
def test_counter_15_of_profile_1_is_invalid_even_with_its_crc(mode: str) -> None:
    profile = Profile1(0x123, mode)
    assert not profile.verify(profile.protect(bytes(8), 15))
    assert profile.verify(profile.protect(bytes(8), 14))


# -- sequence --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("check", "counts", "expected"),
    [
        (Profile1(1, "both"), [12, 13, 14, 0, 1], [GOOD] * 5),
        (Profile1(1, "both"), [13, 1, 4, 8], [GOOD, GOOD, GOOD, JUMP]),
        (Profile1(1, "both"), [14, 14, 0], [GOOD, REPEATED, GOOD]),
        (Profile1(1, "both"), [14, 15, 0], [GOOD, WRONG, GOOD]),
        (Profile2(range(16)), [13, 14, 15, 0, 1], [GOOD] * 5),
        (Profile2(range(16)), [14, 1, 5], [GOOD, GOOD, JUMP]),
        (Profile2(range(16)), [3, 2, 3], [GOOD, JUMP, GOOD]),
    ],
)
def test_the_counter_is_that_of_the_header(
    check: E2e, counts: list[int], expected: list[FrameFault]
) -> None:
    """With any other value as the counter."""
    checker = made(check)
    assert [checker.check(check.protect(bytes(8), c), 99) for c in counts] == expected


def test_qualification_counts_good_headers() -> None:
    check = Profile1(0x123, "both")
    checker = made(check, qualify=3)
    reported = []
    for count in (0, 1, 2, 3):
        checker.check(check.protect(bytes(8), count), 0)
        reported.append(checker.qualified)
    checker.check(flipped(check.protect(bytes(8), 4), 60), 0)
    reported.append(checker.qualified)
    for count in (5, 6, 7):
        checker.check(check.protect(bytes(8), count), 0)
        reported.append(checker.qualified)
    assert reported == [False, False, True, True, False, False, False, True]


def test_bits_of_the_header() -> None:
    assert [Profile1(1, mode).bits for mode in ("both", "low", "alternating", "nibble")] == [
        *(12, 12, 12),
        16,  # with four bits of the data ID
    ]
    with pytest.raises(NotImplementedError):
        E2e().crc(b"", 0)
