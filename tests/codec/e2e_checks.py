"""Checks that the tests of AUTOSAR E2E share."""

from hypothesis import strategies as st

from canshaper.codec.e2e import E2e
from canshaper.codec.frame import FrameFault
from canshaper.codec.message import Protection, SequenceChecker

GOOD, WRONG = FrameFault.NONE, FrameFault.CHECKSUM
REPEATED, JUMP = FrameFault.COUNTER_REPEATED, FrameFault.COUNTER_JUMP
data_ids = st.integers(0, 0xFFFF)


def made(check: E2e, max_step: int = 3, qualify: int = 1) -> SequenceChecker:
    return SequenceChecker(Protection(None, check.counts, check), max_step, qualify)


def flipped(frame: bytes, bit: int) -> bytes:
    data = bytearray(frame)
    data[bit // 8] ^= 1 << bit % 8
    return bytes(data)
