"""Which frames pass a gateway: all but some, in the words that filters of the kernel take.

A filter of can-gw, and each of those of a socket, names the frames that it passes. All frames but a
few are the union of patterns that cover the rest; no two of them meet, so no frame passes twice.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from canshaper.codec.can_id import EFF_FLAG, EFF_MASK, SFF_MASK


@dataclass(frozen=True, slots=True, order=True)
class Pattern:
    """Ids that are ``value`` in the bits of ``mask``: the words of ``struct can_filter``.

    The flag of 29 bits is in the mask; that of remote frames is not, so a pattern fits them too.
    """

    value: int
    mask: int

    def fits(self, word: int) -> bool:
        """Whether a frame with this id of the kernel (29 bits with their flag) is one of them."""
        return word & self.mask == self.value


EVERYTHING = (Pattern(0, EFF_FLAG), Pattern(EFF_FLAG, EFF_FLAG))
"""Ids of 11 bits, and ids of 29 bits."""


def exactly(can_id: int, extended: bool) -> Pattern:
    """The one id."""
    return (
        Pattern(can_id | EFF_FLAG, EFF_MASK | EFF_FLAG)
        if extended
        else Pattern(can_id, SFF_MASK | EFF_FLAG)
    )


def all_but(excluded: Iterable[Pattern]) -> list[Pattern]:
    """Patterns that fit every id but those that one of ``excluded`` fits; no two of them meet."""
    left = list(EVERYTHING)
    for pattern in sorted(set(excluded)):
        left = [part for whole in left for part in _without(whole, pattern)]
    return sorted(left)


def _without(whole: Pattern, hole: Pattern) -> list[Pattern]:
    """What of ``whole`` is left: for each bit that only ``hole`` cares about, the other value."""
    if (whole.value ^ hole.value) & whole.mask & hole.mask:
        return [whole]  # they do not meet
    left = []
    value, mask = whole.value, whole.mask
    for bit in (1 << n for n in reversed(range(EFF_MASK.bit_length()))):
        if hole.mask & ~mask & bit:
            mask |= bit
            left.append(Pattern(value | ~hole.value & bit, mask))
            value |= hole.value & bit
    return left
