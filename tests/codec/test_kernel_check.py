"""Checks that can-gw makes are those that we make: computed here as net/can/gw.c of Linux does."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.checksums.algorithms import Xor
from canshaper.checksums.kinds import CHECKSUMS, Checksum, ChecksumKind
from canshaper.codec.e2e import COUNTER, E2e, Profile1, Profile2, Profile4, Profile5, Profile6
from canshaper.codec.message import Protection
from canshaper.codec.rewrite import kernel_check, neutral_fault
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


POSSIBLE = [
    Checksum(kind, byte)
    for kind in CHECKSUMS
    for byte in range(LENGTH)
    if neutral_fault(Protection(check=Checksum(kind, byte)), LENGTH) is None
]


def test_a_row_is_possible_by_what_it_says() -> None:
    kernel = {kind: row.kernel for kind, row in CHECKSUMS.items()}
    assert {check.kind for check in POSSIBLE} == {kind for kind, one in kernel.items() if one}
    assert [c.byte for c in POSSIBLE if c.kind == "xor"] == list(range(LENGTH))
    assert [c.byte for c in POSSIBLE if c.kind == "crc8_autosar"] == [0, LENGTH - 1]


def test_what_is_impossible() -> None:
    def fault(check: Checksum | E2e | None) -> str | None:
        return neutral_fault(Protection(check=check), LENGTH)

    known = "can-gw of the kernel knows no"
    places = "can-gw of the kernel computes crc8_autosar in the first or last byte only"
    assert fault(None) is fault(Checksum("xor", 3)) is None
    assert [fault(Checksum("crc8_autosar", byte)) for byte in range(LENGTH)] == [
        None,
        *(places,) * (LENGTH - 2),
        None,
    ]
    assert fault(Checksum("sum", 0)) == f"{known} checksum of the kind sum"
    for wide in (Profile4(0x0A0B0C0D), Profile5(1), Profile6(0x1234)):
        assert fault(wide) == f"{known} CRC of more than 8 bits"
    assert fault(Profile1(0x102, "alternating")) == f"{known} data ID that alternates"
    assert fault(Profile1(0x102, "both")) is None


def test_only_an_exclusive_or_is_0_before() -> None:
    assert kernel_check(Protection(), LENGTH) == ((), 0)
    checks = Checksum("crc8_autosar", 0), Profile1(1, "both"), Profile2(range(16))
    assert [kernel_check(Protection(check=check), LENGTH)[1] for check in checks] == [0, 0, 0]
    assert kernel_check(Protection(check=Checksum("xor", 2)), LENGTH)[1] == 0xFF0000


@pytest.mark.parametrize("check", POSSIBLE, ids=str)
@given(data=frames)
def test_checksums(check: Checksum, data: bytes) -> None:
    assert by_the_kernel(check, data) == check.protect(data, 0)


@pytest.mark.parametrize("kind", [kind for kind, row in CHECKSUMS.items() if not row.kernel])
def test_no_other_is_sent_in_place_of_one_that_the_kernel_cannot_make(kind: str) -> None:
    protection = Protection(check=Checksum(kind, 0))
    text = f"can-gw of the kernel knows no checksum of the kind {kind}"
    assert neutral_fault(protection, LENGTH) == text
    with pytest.raises(AssertionError):
        kernel_check(protection, LENGTH)


@given(data=frames)
def test_exclusive_or_with_another_start(data: bytes) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(CHECKSUMS, "xor_5a", ChecksumKind("from 0x5A", 8, Xor(0x5A)))
        check = Checksum("xor_5a", 2)
        assert by_the_kernel(check, data) == check.protect(data, 0)


@pytest.mark.parametrize("mode", ["both", "low", "nibble"])
@given(data=frames, count=st.integers(0, 14))
def test_profile_1(mode: str, data: bytes, count: int) -> None:
    profile = Profile1(0x5A7, mode)
    protected = profile.protect(
        data, count
    )  # what the joystick sent; then a joystick is made neutral
    changed = protected[:3] + b"\0\0" + protected[5:]
    assert by_the_kernel(profile, changed) == profile.protect(changed, count)


@given(data=frames)
def test_profile_2(data: bytes) -> None:
    profile = Profile2(range(3, 35, 2))
    assert by_the_kernel(profile, data) == profile.protect(data, data[1] & COUNTER)


def test_bytes_behind_a_short_message_stay() -> None:
    (_, keep), (_, put) = changed_bytes(~0xFFFF, 0x1234, 4)
    assert (keep[8:16], put[8:16]) == (b"\0\0" + b"\xff" * 6, b"\x34\x12" + bytes(6))
