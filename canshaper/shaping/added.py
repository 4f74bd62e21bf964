"""Bounds of the velocity that the motion of two axes adds to one of them.

The operator of an axis answers for its motion only where he commands it. What the motion adds
beyond that is the other operator's doing, so it has bounds of its own: in speed
(``range_with_added``), and in time (``AddedTime``).
"""


def range_with_added(
    demand: float, recent_low: float, recent_high: float, own: float, largest: float
) -> tuple[float, float]:
    """Range of an axis' own velocity and the added one together.

    - Against a joystick that is held: no further than the own velocity already runs on.
    - In a direction that was commanded within the tail: no faster than commanded there.
    - In a direction that no one commanded, with the joystick released: no faster than ``largest``.

    Args:
        demand: the operator's demand now, [-1, 1].
        recent_low: smallest demand within the tail, 0 or negative.
        recent_high: largest demand within the tail, 0 or positive.
        own: the axis' own velocity, before the ramp.
        largest: largest velocity that may be added where no one commanded.

    Returns:
        (low, high) with low <= 0 <= high and low <= own <= high.
    """
    low, high = recent_low, recent_high
    if demand > 0.0:
        low = 0.0
    elif demand < 0.0:
        high = 0.0
    else:
        if low == 0.0:
            low = -largest
        if high == 0.0:
            high = largest
    return (own if own < low else low), (own if own > high else high)


class AddedTime:
    """How long a motion may move an axis that no one commands.

    Args:
        ticks: longest time in motion, in ticks of the axis.
    """

    __slots__ = ("_left", "_ticks")

    def __init__(self, ticks: int) -> None:
        self._ticks = self._left = ticks

    def renew(self) -> None:
        """Give the axis its full time back: neither of its motion's operators is at work."""
        self._left = self._ticks

    def allows(self, asked: bool, commanded: bool, moved: bool, ticks: int = 1) -> bool:
        """Count time, and say whether the motion may move the axis now.

        Args:
            asked: the motion asks for it.
            commanded: the operator demanded motion within the tail. The axis gets its full time
                back.
            moved: the valve was open. An axis that stands uses up no time, and gets none back.
            ticks: how many ticks have passed.
        """
        if commanded:
            self.renew()
        elif moved:
            self._left -= ticks
        return asked and self._left > 0
