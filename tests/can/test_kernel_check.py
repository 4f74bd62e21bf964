"""Checks that can-gw makes are those that we make: reckoned here as net/can/gw.c of Linux does."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.e2e import COUNTER, E2e, Profile1, Profile2
from canshaper.codec.kernel_check import kernel_check, neutral_fault
from canshaper.codec.protection import CHECKSUMS, Checksum, Protection
from canshaper.protocols.gateway.cangw import CS_CRC8, CS_XOR, changed_bytes

LENGTH = 8


def by_the_kernel(check: Checksum | E2e, data: bytes) -> bytes:
    """cgw_csum_xor_pos and cgw_csum_crc8_pos, after the AND and OR of the rule."""
    ((kind, packed),), clear = kernel_check(Protection(check=check), LENGTH)
    (_, keep), (_, put) = changed_bytes(~clear, 0, LENGTH)
    frame = bytearray(a & k | p for a, k, p in zip(data, keep[8:16], put[8:16], strict=True))
    if kind == CS_XOR:
        first, last, place, value = struct.unpack("=bbbB", packed)
        for i in range(first, last + 1):
            value ^= frame[i]
        frame[place] = value
        return bytes(frame)
    assert kind == CS_CRC8
    first, last, place, value, end, table, profile, ids = struct.unpack("=bbbBB256sB20s", packed)
    for i in range(first, last + 1):
        value = table[value ^ frame[i]]
    if profile == 2:  # CGW_CRC8PRF_16U8
        value = table[value ^ ids[frame[1] & 0xF]]
    frame[place] = value ^ end
    return bytes(frame)


frames = st.binary(min_size=LENGTH, max_size=LENGTH)


@pytest.mark.parametrize(("kind", "byte"), [
    ("xor", 0), ("xor", 3), ("xor", 7), ("crc8_sae_j1850", 0), ("crc8_sae_j1850", 7),
    ("crc8_autosar", 0), ("crc8_autosar", 7),
])  # fmt: skip
@given(data=frames)
def test_checksums(kind: str, byte: int, data: bytes) -> None:
    check = Checksum(kind, byte)
    assert kind in CHECKSUMS
    assert by_the_kernel(check, data) == check.seal(data, 0)


@pytest.mark.parametrize("mode", ["both", "low", "nibble"])
@given(data=frames, count=st.integers(0, 14))
def test_profile_1(mode: str, data: bytes, count: int) -> None:
    profile = Profile1(0x5A7, mode)
    sealed = profile.seal(data, count)  # what the joystick sent; then a stick is made neutral
    changed = sealed[:3] + b"\0\0" + sealed[5:]
    assert by_the_kernel(profile, changed) == profile.seal(changed, count)


@given(data=frames)
def test_profile_2(data: bytes) -> None:
    profile = Profile2(range(3, 35, 2))
    assert by_the_kernel(profile, data) == profile.seal(data, data[1] & COUNTER)


def test_a_data_id_that_alternates_is_refused() -> None:
    assert neutral_fault(Protection(check=Profile1(0x1234, "alternating")), LENGTH)
    assert neutral_fault(Protection(check=Profile1(0x1234, "both")), LENGTH) is None


def test_bytes_behind_a_short_message_stay() -> None:
    (_, keep), (_, put) = changed_bytes(~0xFFFF, 0x1234, 4)
    assert (keep[8:16], put[8:16]) == (b"\0\0" + b"\xff" * 6, b"\x34\x12" + bytes(6))
