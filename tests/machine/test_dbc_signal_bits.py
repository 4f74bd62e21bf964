"""Bits of the signals of a message that no one uses: which of them overlap, and which may."""

import pytest

from canshaper.machine.dbc_text import signals_fault


def fault(length: int, *signals: str) -> str | None:
    text = "".join(f' SG_ {signal}+ (1,0) [0|0] "" A\n' for signal in signals)
    names, text_of_fault = signals_fault(text.encode(), length)
    assert names == [signal.split()[0].encode() for signal in signals]
    return text_of_fault


@pytest.mark.parametrize(
    ("length", "signals"),
    [
        (1, ("A m0 : 0|8@1", "B m1 : 0|8@1")),
        (2, ("A m0 : 8|8@1", "B m0 : 0|8@1")),
        (2, ("A : 7|8@0", "B : 15|8@0")),
        (3, ("A : 7|8@0", "B : 15|8@0", "C : 23|8@0")),
        (2, ("A : 7|4@0", "B : 0|4@1")),
        (2, ("A : 3|8@0", "B : 4|4@1", "C : 8|4@1")),
    ],
)
def test_signals_without_a_common_bit_have_no_fault(length: int, signals: tuple[str, ...]) -> None:
    assert fault(length, *signals) is None


@pytest.mark.parametrize(
    ("length", "signals", "first", "second"),
    [
        (1, ("M M : 0|8@1", "A m0 : 4|4@1"), "M", "A"),
        (2, ("M M : 0|8@1", "A m0 : 8|8@1", "B m0 : 12|4@1"), "A", "B"),
        (2, ("M M : 0|4@1", "N m0M : 4|4@1", "A : 8|8@1", "B : 8|8@1"), "A", "B"),
        (1, ("A : 0|4@1", "B : 4|4@1", "C : 0|4@1"), "A", "C"),
        (2, ("A : 7|4@0", "B : 4|4@1"), "A", "B"),
        (2, ("A : 3|8@0", "B : 12|4@1"), "A", "B"),
        (2, ("A : 0|12@1", "B : 8|4@1"), "A", "B"),
    ],
)
def test_signals_with_a_common_bit_overlap(
    length: int, signals: tuple[str, ...], first: str, second: str
) -> None:
    assert fault(length, *signals) == f"has overlapping signals, {first} and {second}"
