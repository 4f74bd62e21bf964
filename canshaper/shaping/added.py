"""How far an axis carries out a velocity that the motion of two axes adds to its own.

Its operator answers for the axis only where he commands it; what is added beyond that is the other
operator's, and has bounds of its own.
"""


def range_with_added(
    command: float, recent_low: float, recent_high: float, target: float, largest: float
) -> tuple[float, float]:
    """Range of the axis' own velocity and the added one together.

    Never against a joystick that is held, but as far as the own part may run on; never faster than
    commanded within the tail in that direction. In a direction that no one commanded within the
    tail and no joystick is held against, at most ``largest``.

    Args:
        command: the operator's command now, [-1, 1].
        recent_low: smallest command within the tail, 0 or negative.
        recent_high: largest command within the tail, 0 or positive.
        target: the axis' own velocity before the rates.
        largest: largest velocity that may be added where no one commanded.

    Returns:
        (low, high) with low <= 0 <= high and low <= target <= high.
    """
    low, high = recent_low, recent_high
    if command > 0.0:
        low = 0.0
    elif command < 0.0:
        high = 0.0
    else:
        if low == 0.0:
            low = -largest
        if high == 0.0:
            high = largest
    return (target if target < low else low), (target if target > high else high)


class AddedTime:
    """How long an axis that no one commands may be moved by what is added.

    Args:
        ticks: longest time in motion, in ticks of the axis.
    """

    __slots__ = ("_left", "_ticks")

    def __init__(self, ticks: int) -> None:
        self._ticks = self._left = ticks

    def allowed(self, added: float, *, commanded: bool, moved: bool, ticks: int = 1) -> bool:
        """Whether so much may be added in this tick.

        Args:
            added: the velocity to add; with 0 the next motion begins.
            commanded: the operator commanded this axis within the tail.
            moved: the axis was moved in the last tick.
            ticks: for how many ticks that was.
        """
        if commanded or not added:
            self._left = self._ticks
        elif moved:
            self._left -= ticks
        return self._left > 0
