"""Profiles 4 to 7 of AUTOSAR E2E, whose CRC is wider than a byte: published frames, the library.

The frames are from the tests of the Python package autosar-e2e (the first of profile 4 is in
PRS_E2EProtocol).
"""

import pytest
from crccheck.crc import Crc16CcittFalse, Crc32Autosar, Crc64Xz
from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.e2e import E2e, Profile4, Profile5, Profile6, Profile7
from tests.codec.e2e_checks import GOOD, JUMP, REPEATED, data_ids, flipped, made


@pytest.mark.parametrize(
    ("profile", "first", "second"),
    [
        (Profile5(0x1234), "1cca000000000000", "cf8d010000000000"),
        (Profile6(0x1234), "b155000800000000", "f4f5000801000000"),
    ],
)
def test_the_examples_of_profiles_5_and_6(profile: E2e, first: str, second: str) -> None:
    for count, text in enumerate((first, second)):
        frame = bytes.fromhex(text)
        assert profile.protect(bytes(8), count) == frame
        assert profile.verify(frame)
        assert not profile.verify(frame[:-1] + b"\x01")


@given(data_ids, st.binary(min_size=3, max_size=8), st.integers(0, 255))
def test_profile_5_by_the_library(data_id: int, data: bytes, count: int) -> None:
    body = bytes([count]) + data[3:]
    crc = Crc16CcittFalse.calc(body + data_id.to_bytes(2, "little"))
    frame = Profile5(data_id).protect(data, count)
    assert frame == crc.to_bytes(2, "little") + body
    assert Profile5(data_id).verify(frame)


@given(data_ids, st.binary(min_size=5, max_size=8), st.integers(0, 255))
def test_profile_6_by_the_library(data_id: int, data: bytes, count: int) -> None:
    body = bytes([0, len(data), count]) + data[5:]
    crc = Crc16CcittFalse.calc(body + data_id.to_bytes(2, "big"))
    frame = Profile6(data_id).protect(data, count)
    assert frame == crc.to_bytes(2, "big") + body
    assert Profile6(data_id).verify(frame)


@pytest.mark.parametrize("profile", [Profile5(0xBEEF), Profile6(0xBEEF)], ids=["p05", "p06"])
def test_every_flipped_bit_of_a_wide_crc_is_seen(profile: E2e) -> None:
    frame = profile.protect(bytes(range(8)), 200)
    assert not any(profile.verify(flipped(frame, bit)) for bit in range(64))


@pytest.mark.parametrize("profile", [Profile5(1), Profile6(1)], ids=["p05", "p06"])
def test_their_counters_run_over_a_byte(profile: E2e) -> None:
    check = made(profile)
    assert [check.check(profile.protect(bytes(8), n % 256), 0) for n in range(253, 258)] == [
        GOOD
    ] * 5
    assert check.check(profile.protect(bytes(8), 1), 0) is REPEATED
    assert check.check(profile.protect(bytes(8), 5), 0) is JUMP


DATA_ID = 0x0A0B0C0D
PUBLISHED = {
    4: ("001000000a0b0c0d862b055600000000", "001000010a0b0c0da58e680700000000"),
    7: (
        "1fb2e737fcedbcd900000018000000000a0b0c0d00000000",
        "7bde7268b8e9bc2700000018000000010a0b0c0d00000000",
    ),
}
WIDE: dict[int, Profile4] = {4: Profile4(DATA_ID), 7: Profile7(DATA_ID)}
fd_frames = st.integers(20, 64).flatmap(lambda n: st.binary(min_size=n, max_size=n))


@pytest.mark.parametrize("number", WIDE)
def test_the_examples_of_profiles_4_and_7(number: int) -> None:
    profile = WIDE[number]
    for count, text in enumerate(PUBLISHED[number]):
        frame = bytes.fromhex(text)
        assert profile.protect(bytes(len(frame)), count) == frame
        assert profile.verify(frame)
        assert profile.count(frame) == count
        assert not profile.verify(frame[:-1] + b"\x01")


@given(st.integers(0, 2**32 - 1), fd_frames, st.integers(0, 2**16 - 1))
def test_profile_4_by_the_library(data_id: int, data: bytes, count: int) -> None:
    head = bytes((0, len(data))) + count.to_bytes(2, "big") + data_id.to_bytes(4, "big")
    crc = Crc32Autosar.calc(head + data[12:]).to_bytes(4, "big")
    frame = Profile4(data_id).protect(data, count)
    assert frame == head + crc + data[12:]
    assert Profile4(data_id).verify(frame)


@given(st.integers(0, 2**32 - 1), fd_frames, st.integers(0, 2**32 - 1))
def test_profile_7_by_the_library(data_id: int, data: bytes, count: int) -> None:
    rest = bytes((0, 0, 0, len(data))) + count.to_bytes(4, "big") + data_id.to_bytes(4, "big")
    rest += data[20:]
    frame = Profile7(data_id).protect(data, count)
    assert frame == Crc64Xz.calc(rest).to_bytes(8, "big") + rest
    assert Profile7(data_id).verify(frame)


@pytest.mark.parametrize("number", WIDE)
def test_every_flipped_bit_of_a_long_frame_is_seen(number: int) -> None:
    """Of length and data ID too, whatever the CRC says."""
    frame = WIDE[number].protect(bytes(range(32)), 40_000)
    assert not any(WIDE[number].verify(flipped(frame, bit)) for bit in range(8 * len(frame)))


@pytest.mark.parametrize("number", WIDE)
def test_the_frame_of_another_message_is_seen(number: int) -> None:
    """Its CRC is right."""
    assert not WIDE[number].verify(type(WIDE[number])(DATA_ID ^ 1).protect(bytes(24), 7))
    assert not WIDE[number].verify(WIDE[number].protect(bytes(24), 7) + b"\0")


@pytest.mark.parametrize(("number", "last"), [(4, 2**16 - 1), (7, 2**32 - 1)])
def test_their_counters_run_over_all_their_bytes(number: int, last: int) -> None:
    profile = WIDE[number]
    check = made(profile)
    counts = [254, 255, 256, 257]
    assert [check.check(profile.protect(bytes(24), n), 0) for n in counts] == [GOOD] * 4
    assert check.check(profile.protect(bytes(24), 257), 0) is REPEATED
    assert check.check(profile.protect(bytes(24), 257 + 256), 0) is JUMP
    check = made(profile)
    assert [check.check(profile.protect(bytes(24), n), 0) for n in (last, 0, 1)] == [GOOD] * 3
